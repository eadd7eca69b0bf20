"""Table II: deciders in the same traffic, seed by seed.

python -m tractrix.evaluate --seeds 20 --out runs/table2 --deciders rules:50 mobil
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from tractrix import __git_revision__, __version__
from tractrix.evaluate import report
from tractrix.evaluate.deciders import decider
from tractrix.evaluate.drive import TABLE2, drive


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m tractrix.evaluate",
        description="Drives deciders in the same traffic, seed by seed.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of its files")
    parser.add_argument(
        "--deciders",
        nargs="+",
        default=["rules:50", "rules:100", "rules:150", "mobil"],
        help="keep, rules:METRES, mobil, rollout, dqn:FILE, imagined[:BASE], ceiling[:BASE]; "
        "the first is the reference",
    )
    parser.add_argument("--scenarios", nargs="+", default=list(TABLE2), help=" ")
    parser.add_argument("--seeds", type=int, default=200, help="episodes of each")
    parser.add_argument("--first-seed", type=int, default=2_000_000, help=" ")
    parser.add_argument("--episode-s", type=float, default=600.0, help=" ")
    parser.add_argument("--fidelity", default="kinematic", help="kinematic or truck")
    parser.add_argument("--threads", type=int, default=1, help=" ")
    given = parser.parse_args(arguments)
    known = {word: decider(word) for word in given.deciders}
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    results: dict[str, dict[str, report.Figures]] = {s: {} for s in given.scenarios}
    cpu_s: dict[str, float] = {}
    for word, (decide, spec) in known.items():
        before_s = time.process_time()
        for scenario in given.scenarios:
            figures = drive(
                decide,
                [scenario],
                seeds,
                spec=spec,
                episode_s=given.episode_s,
                fidelity=given.fidelity,
                threads=given.threads,
            )
            found = {name: values[0] for name, values in figures.items()}
            results[scenario][word] = found
            delta = 100 * np.mean(found["delta_speed_frac"])
            print(f"{scenario} {word}: {delta:.2f} %", file=sys.stderr)
        cpu_s[word] = time.process_time() - before_s
    about = {
        "schema": 1,
        "version": __version__,
        "git_revision": __git_revision__,
        "seeds": [seeds.start, seeds.stop],
        "episode_s": given.episode_s,
        "fidelity": given.fidelity,
        "cpu_s": cpu_s,
    }
    reference = given.deciders[0]
    table = report.summary(results, reference)
    report.write(results, table, reference, about, given.out)
    print(report.markdown(table, reference), end="")
    try:
        report.plot(table, given.out / "front.svg")
    except ImportError:
        print("no plot: Matplotlib is not installed", file=sys.stderr)


if __name__ == "__main__":
    main()
