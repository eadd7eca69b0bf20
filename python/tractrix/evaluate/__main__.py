"""Table II: deciders in the same traffic, seed by seed.

python -m tractrix.evaluate --seeds 20 --out runs/table2 --deciders rules:50,mobil,dqn
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from tractrix import __git_revision__, __version__
from tractrix._policy import SHIPPED
from tractrix.evaluate import report
from tractrix.evaluate.deciders import decider
from tractrix.evaluate.drive import TABLE2, drive, with_spawn_interval


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m tractrix.evaluate",
        description=f"Drives deciders in the same traffic, seed by seed. {report.REFERENCE} is the "
        "reference: it is always driven.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of its files")
    parser.add_argument(
        "--deciders",
        nargs="+",
        default=["rules:50", "rules:100", "rules:150", "mobil", "rollout", "dqn"],
        help="keep, rules:METRES, mobil, rollout, dqn (the weights), dqn:FILE, imagined[:BASE], "
        "ceiling[:BASE]; with spaces or commas between",
    )
    parser.add_argument("--weights", default=SHIPPED, help="weights of the decider dqn")
    parser.add_argument("--scenarios", nargs="+", default=list(TABLE2), help=" ")
    parser.add_argument("--seeds", type=int, default=200, help="episodes of each")
    parser.add_argument("--first-seed", type=int, default=0, help=" ")
    parser.add_argument("--duration-s", type=float, default=600.0, help="of an episode")
    parser.add_argument(
        "--spawn-interval-s",
        type=float,
        help="the less, the denser the traffic: 0.4 in table2-*, 0.1 in the paper "
        "(default: as the scenario says)",
    )
    parser.add_argument("--fidelity", default="kinematic", help="kinematic or truck")
    parser.add_argument("--threads", type=int, default=1, help=" ")
    given = parser.parse_args(arguments)
    words = [word for text in given.deciders for word in text.split(",") if word]
    words = list(dict.fromkeys([report.REFERENCE, *words]))
    try:
        known = {word: decider(word, given.weights) for word in words}
        if given.seeds < 1:
            parser.error(f"--seeds {given.seeds}: at least 1")
        seeds = range(given.first_seed, given.first_seed + given.seeds)
        scenarios = {
            name: with_spawn_interval(name, given.spawn_interval_s)
            for name in given.scenarios
        }
        results: dict[str, dict[str, report.Figures]] = {s: {} for s in scenarios}
        cpu_s: dict[str, float] = {}
        for word, (decide, spec) in known.items():
            before_s = time.process_time()
            for name, scenario in scenarios.items():
                figures = drive(
                    decide,
                    [scenario],
                    seeds,
                    spec=spec,
                    episode_s=given.duration_s,
                    fidelity=given.fidelity,
                    threads=given.threads,
                )
                found = {figure: values[0] for figure, values in figures.items()}
                results[name][word] = found
                delta = 100 * np.mean(found["delta_speed_frac"])
                print(f"{name} {word}: {delta:.2f} %", file=sys.stderr)
            cpu_s[word] = time.process_time() - before_s
    except (ValueError, OSError) as wrong:
        parser.error(str(wrong))
    about = {
        "schema": 1,
        "version": __version__,
        "git_revision": __git_revision__,
        "seed": given.first_seed,
        "duration_s": given.duration_s,
        "spawn_interval_s": given.spawn_interval_s,
        "fidelity": given.fidelity,
        "weights": given.weights,
        "cpu_s": cpu_s,
    }
    rows = report.summary(results)
    report.write(results, rows, about, given.out)
    print(report.markdown(rows), end="")
    try:
        report.plot(rows, given.out / "front.svg")
    except ImportError:
        print("no plot: Matplotlib is not installed", file=sys.stderr)


if __name__ == "__main__":
    main()
