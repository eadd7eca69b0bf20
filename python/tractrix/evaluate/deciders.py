"""Deciders by their words."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tractrix._policy import SHIPPED, Policy
from tractrix._vector_env import VectorEnv
from tractrix.evaluate.drive import Decide

KEEP = 1
"""The action that keeps the lane."""


def decider(word: str, weights: str = SHIPPED) -> tuple[Decide, str]:
    """Who decides, and the `spec` of the environments that it wants.

    Args:
        word: `keep`, `rules:METRES`, `mobil` and `rollout` as in the truck; `dqn` or `dqn:FILE`, a
            learned policy; `imagined[:BASE]`, the change that imagined traffic of average drivers
            rewards most with `BASE` (`mobil`) deciding after it; `ceiling[:BASE]`, the same with the
            true drivers, which nobody on the road knows: an upper bound, not a competitor.
        weights: The file that `dqn` means.

    Raises:
        ValueError: Another word, or a policy that cannot be used.
        FileNotFoundError: A policy's file that is not there.
    """
    kind, _, rest = word.partition(":")
    if kind == "dqn":
        policy = Policy(rest or weights)
        masked = policy.spec == "ours"

        def learned(
            _: VectorEnv, obs: npt.NDArray[np.float32], mask: npt.NDArray[Any]
        ) -> npt.NDArray[Any]:
            return policy.choose(obs, mask if masked else np.ones_like(mask))

        return learned, policy.spec
    if kind in ("imagined", "ceiling"):
        drivers = "true" if kind == "ceiling" else "forgotten"

        def imagined(env: VectorEnv, *_: Any) -> npt.NDArray[Any]:
            worth = env.advantages(rest or "mobil", drivers=drivers)
            worth = np.where(np.isnan(worth), -np.inf, worth)
            worth[:, KEEP] = 0.0
            best: npt.NDArray[np.int64] = worth.argmax(axis=1)
            return best

        return imagined, "ours"
    return lambda env, *_: env.wishes(word), "ours"
