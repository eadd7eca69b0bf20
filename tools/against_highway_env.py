"""Environments of Tractrix against highway-env, in one run on one core: simulated tenths of a second
per CPU second, both with a decision each second and an observation.

pip install "./python[gym]" highway-env
python tools/against_highway_env.py [SCENARIO[:AWAKE_M]...]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import gymnasium
import highway_env  # noqa: F401  (registers highway-v0)
import numpy as np
import tractrix

SUBSTEPS_PER_DECISION = 10
ENVIRONMENTS = 64
KEEP = 1


def rate(advance: Callable[[], int], at_least_s: float) -> float:
    """Steps of 0.1 s per CPU second of this process."""
    advance()
    steps, start_s = 0, time.process_time()
    while time.process_time() - start_s < at_least_s:
        steps += advance()
    return steps / (time.process_time() - start_s)


def highway(vehicles: int) -> Callable[[], int]:
    """highway-env's own road of two lanes; the ego keeps its lane, idle."""
    env = gymnasium.make(
        "highway-v0",
        config={
            "lanes_count": 2,
            "vehicles_count": vehicles,
            "simulation_frequency": 10,
            "policy_frequency": 1,
            "duration": 600,
        },
    )
    env.reset(seed=1)

    def advance() -> int:
        _, _, terminated, truncated, _ = env.step(KEEP)
        if terminated or truncated:
            env.reset()
        return SUBSTEPS_PER_DECISION

    return advance


def ours(scenario: str) -> Callable[[], int]:
    """Kinematic environments on the scenario's whole road, on one thread."""
    name, _, awake_m = scenario.partition(":")
    env = tractrix.VectorEnv(
        ENVIRONMENTS,
        name,
        seed=1,
        threads=1,
        copy=False,
        awake_m=float(awake_m) if awake_m else None,
    )
    env.reset()
    keep = np.full(ENVIRONMENTS, KEEP)

    def advance() -> int:
        env.step(keep)
        return ENVIRONMENTS * SUBSTEPS_PER_DECISION

    return advance


def main() -> None:
    """Prints both in turns, three times, and their ratio."""
    scenarios = sys.argv[1:] or [
        "table2-dense-12.5",
        "table2-medium-12.5",
        "table2-sparse-15",
    ]
    environments = {name: ours(name) for name in scenarios}
    peers = {"highway-v0, 40 vehicles": highway(40)}
    for turn in range(3):
        base = {name: rate(advance, 5.0) for name, advance in peers.items()}
        for name, steps in base.items():
            print(f"{turn}: {name:28} {steps:10.0f} steps/CPU s")
        for name, advance in environments.items():
            steps = rate(advance, 3.0)
            ratios = ", ".join(f"{steps / b:.0f} x {n}" for n, b in base.items())
            print(f"{turn}: {name:28} {steps:10.0f} steps/CPU s, {ratios}")


if __name__ == "__main__":
    main()
