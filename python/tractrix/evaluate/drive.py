"""Episodes of a decider: the same seeds give every decider the same start and the same traffic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tractrix._scenario import scenario
from tractrix._vector_env import Scenario, VectorEnv

Decide = Callable[
    [VectorEnv, npt.NDArray[np.float32], npt.NDArray[Any]], npt.NDArray[Any]
]
"""An action for every environment, from the environments, their observations and masks."""
TABLE2 = tuple(
    f"table2-{density}-{speed}"
    for density in ("dense", "medium", "sparse")
    for speed in ("12.5", "15")
)
"""The scenarios of the paper's Table II, by density and traffic speed in m/s."""


def with_spawn_interval(name: str, spawn_interval_s: float | None) -> Scenario:
    """A scenario with another time between two chances of an arrival.

    Raises:
        ValueError: A scenario whose demand is not that of a family.
    """
    if spawn_interval_s is None:
        return name
    changed = scenario(name)
    family = changed["traffic"].get("family")
    if not family:
        raise ValueError(
            f"{name}: no traffic.family whose spawn_interval_s could be set"
        )
    family["spawn_interval_s"] = spawn_interval_s
    return changed


def drive(
    decide: Decide,
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    **environment: Any,
) -> dict[str, npt.NDArray[Any]]:
    """Drives one episode of every seed in every scenario.

    Args:
        decide: Who decides.
        scenarios: Names, files or keys of scenarios.
        seeds: Seeds of the episodes.
        environment: More arguments of `tractrix.VectorEnv`.

    Returns:
        The figures of `VectorEnv.episodes`, each `[scenarios, seeds]`.
    """
    env = VectorEnv(len(seeds) * len(scenarios), list(scenarios), **environment)
    obs, infos = env.reset(seed=[seed for seed in seeds for _ in scenarios])
    figures: dict[str, npt.NDArray[Any]] = {}
    waits = np.ones(env.num_envs, np.bool_)
    while waits.any():
        obs, _, _, _, infos = env.step(decide(env, obs, infos["action_mask"]))
        if "final_info" not in infos:
            continue
        ended = waits & infos["_final_info"]
        for name, values in infos["final_info"].items():
            figures.setdefault(name, np.zeros_like(values))[ended] = values[ended]
        waits &= ~ended
    env.close()
    shape = (len(seeds), len(scenarios))
    return {name: values.reshape(shape).T for name, values in figures.items()}
