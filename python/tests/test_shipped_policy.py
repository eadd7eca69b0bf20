"""The shipped policy: whole, for the observation that is made, and better than keeping the lane."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tractrix
from tractrix.evaluate.drive import drive

FILE = Path(__file__).parents[2] / "policies" / "table2.safetensors"


def test_it_is_held_up_less_than_who_keeps_the_lane_and_touches_nobody() -> None:
    policy = tractrix.Policy(FILE)
    assert policy.spec == "ours"

    def driven(decide: Any) -> Any:
        scenarios = ["table2-medium-12.5", "table2-sparse-12.5"]
        return drive(decide, scenarios, range(7, 19), episode_s=300.0)

    ours = driven(lambda _, obs, mask: policy.choose(obs, mask))
    keep = driven(lambda _, obs, __: np.ones(len(obs), np.int64))
    assert not ours["collided"].any() and not ours["refused"].any()
    gained = (keep["delta_speed_frac"] - ours["delta_speed_frac"]).ravel()
    assert gained.mean() > 2.0 * gained.std(ddof=1) / np.sqrt(len(gained))
