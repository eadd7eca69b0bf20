"""Table II: deciders in the same traffic, seed by seed.

python -m tractrix.evaluate --seeds 20 --out runs/table2 --deciders rules:50,mobil,dqn
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from tractrix import __git_revision__, __version__
from tractrix._policy import SHIPPED
from tractrix.evaluate import report
from tractrix.evaluate.deciders import decider
from tractrix.evaluate.drive import TABLE2, with_spawn_interval
from tractrix.evaluate.sweep import Found, Part, here, on_ray


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
    parser.add_argument(
        "--ray", action="store_true", help="share the seeds out over a Ray cluster"
    )
    given = parser.parse_args(arguments)
    words = [word for text in given.deciders for word in text.split(",") if word]
    words = list(dict.fromkeys([report.REFERENCE, *words]))
    try:
        for word in words:
            decider(word, given.weights)
        if given.seeds < 1:
            parser.error(f"--seeds {given.seeds}: at least 1")
        environment = {
            "episode_s": given.duration_s,
            "fidelity": given.fidelity,
            "threads": given.threads,
        }
        parts = [
            Part(
                word,
                name,
                with_spawn_interval(name, given.spawn_interval_s),
                range(given.first_seed, given.first_seed + given.seeds),
                given.weights,
                environment,
            )
            for word in words
            for name in given.scenarios
        ]
        driven = (on_ray if given.ray else here)(parts, _tell)
    except (ValueError, OSError, ImportError) as wrong:
        parser.error(str(wrong))
    results: dict[str, dict[str, report.Figures]] = {s: {} for s in given.scenarios}
    cpu_s = dict.fromkeys(words, 0.0)
    for part, (found, took_s) in zip(parts, driven, strict=True):
        results[part.name][part.word] = found
        cpu_s[part.word] += took_s
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


def _tell(part: Part, found: Found) -> None:
    delta = 100 * np.mean(found[0]["delta_speed_frac"])
    print(f"{part.name} {part.word}: {delta:.2f} %", file=sys.stderr)


if __name__ == "__main__":
    main()
