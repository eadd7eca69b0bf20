"""The command line of a trainer: one option for every setting."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol


class Trains(Protocol):
    """What a command line starts."""

    def run(self, until: int | None = None) -> None:
        """Trains to the last round."""


def command(
    name: str,
    description: str,
    settings: Callable[..., Any],
    training: Callable[..., Trains],
    *,
    scales: bool = False,
) -> None:
    """Reads the command line of `python -m tractrix.train.NAME` and trains.

    A folder that holds a training is refused unless it goes on.

    Args:
        name: Module of the trainer.
        description: What it does.
        settings: Data class of the settings, each with a default.
        training: Called with the settings, the folder, and what the other options say.
        scales: It may have actors on a Ray cluster.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m tractrix.train.{name}",
        description=description,
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    for field in dataclasses.fields(settings()):
        default: Any = field.default
        several = isinstance(default, tuple)
        parser.add_argument(
            "--" + field.name.replace("_", "-"),
            type=str if several else type(default),
            nargs="+" if several else None,
            default=default,
            help=" ",
        )
    parser.add_argument("--out", type=Path, required=True, help="folder of its files")
    parser.add_argument("--threads", type=int, default=1, help="of the environments")
    names = ["out", "threads", "resume", "tensorboard"]
    if scales:
        names.append("actors")
        text = "actors of a Ray cluster that drive and ask; 0: this process does"
        parser.add_argument("--actors", type=int, default=0, help=text)
    parser.add_argument("--resume", action="store_true", help="go on from --out")
    parser.add_argument("--tensorboard", action="store_true", help="also write events")
    given = vars(parser.parse_args())
    own = {name: given.pop(name) for name in names}
    out: Path = own.pop("out")
    files = ("checkpoint.pt", "curve.json", "policy.safetensors")
    if not own["resume"] and any((out / file).exists() for file in files):
        parser.error(f"--out {out}: holds a training; --resume goes on with it")
    given["scenarios"] = tuple(given["scenarios"])
    training(settings(**given), out, **own).run()
