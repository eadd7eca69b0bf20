"""A row per decider of episodes in traffic that is not ours; for `in_highway_env` and `in_recordings`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from tractrix.evaluate.statistics import LEAST_PAIRS, paired

FIGURES = ("delta_speed_frac", "lane_changes", "collisions", "distance_m")
"""Of `tractrix.World.summary()`."""


def tell(found: Mapping[str, Sequence[Mapping[str, float]]]) -> None:
    """Prints every decider's means, with the paired difference to the first (95 %, Student's t)."""
    first, *_ = found
    for word, episodes in found.items():
        delta, reference = (
            100.0 * np.array([episode["delta_speed_frac"] for episode in found[one]])
            for one in (word, first)
        )
        text = f"{word}: {len(episodes)} episodes, delta speed {delta.mean():.2f} %"
        if word != first and len(episodes) >= LEAST_PAIRS:
            low, high = paired(delta, reference).t
            text += f" ({low:+.2f} to {high:+.2f} against {first})"
        changes = np.mean([episode["lane_changes"] for episode in episodes])
        touched = sum(episode["collisions"] > 0 for episode in episodes)
        driven_km = sum(episode["distance_m"] for episode in episodes) / 1000.0
        print(
            f"{text}, {changes:.2f} changes, {touched} with a contact, {driven_km:.1f} km"
        )
