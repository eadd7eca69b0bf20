"""All deciders in all scenarios: in this process, or shared out over a Ray cluster.

An episode hangs on its seed alone, so the figures are the same bits however the seeds are shared out.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tractrix._cluster import each
from tractrix._vector_env import Scenario
from tractrix.evaluate.deciders import decider
from tractrix.evaluate.drive import drive

Found = tuple[dict[str, npt.NDArray[Any]], float]
"""Figures by seed, and the processor time that they took, s."""
SEEDS_AT_ONCE = 20
"""Seeds of a part on a cluster: what a killed worker costs."""


@dataclasses.dataclass(frozen=True)
class Part:
    """A decider in a scenario on some seeds."""

    word: str
    name: str
    """Of the scenario."""
    scenario: Scenario
    seeds: range
    weights: str
    environment: Mapping[str, Any]
    """More arguments of `tractrix.VectorEnv`."""

    def drive(self) -> Found:
        """Drives it."""
        before_s = time.process_time()
        decide, spec = decider(self.word, self.weights)
        figures = drive(
            decide, [self.scenario], self.seeds, spec=spec, **self.environment
        )
        found = {name: values[0] for name, values in figures.items()}
        return found, time.process_time() - before_s

    def pieces(self) -> list[Part]:
        """The same in parts of few seeds."""
        starts = range(0, len(self.seeds), SEEDS_AT_ONCE)
        return [
            dataclasses.replace(self, seeds=self.seeds[at : at + SEEDS_AT_ONCE])
            for at in starts
        ]


def here(parts: Sequence[Part], tell: Callable[[Part, Found], None]) -> list[Found]:
    """Drives one part after the other."""
    results = []
    for part in parts:
        results.append(part.drive())
        tell(part, results[-1])
    return results


def on_ray(parts: Sequence[Part], tell: Callable[[Part, Found], None]) -> list[Found]:
    """The same on a Ray cluster, which must see the same files of weights and scenarios. What a killed
    worker has begun is driven again.

    Raises:
        ImportError: Ray is not installed.
    """
    pieces = [part.pieces() for part in parts]
    cpus = max((part.environment.get("threads", 1) for part in parts), default=1)
    flat = each(_drive, [(one,) for some in pieces for one in some], cpus=cpus)
    results = []
    for part, some in zip(parts, pieces, strict=True):
        found, flat = flat[: len(some)], flat[len(some) :]
        figures = {
            name: np.concatenate([one[0][name] for one in found])
            for name in found[0][0]
        }
        results.append((figures, sum(one[1] for one in found)))
        tell(part, results[-1])
    return results


def _drive(part: Part) -> Found:
    return part.drive()
