"""What paired episodes say: the mean of the differences and how far it may be off."""

from __future__ import annotations

import dataclasses
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

LEAST_PAIRS = 5
"""Fewer differences say nothing, and the quantile of `t_quantile` is not exact enough."""
RESAMPLES = 10_000


@dataclasses.dataclass(frozen=True)
class Paired:
    """A mean difference with its 95 % intervals."""

    pairs: int
    mean: float
    t: tuple[float, float]
    """By Student's t: of differences that scatter normally."""
    bootstrap: tuple[float, float]
    """Percentiles of resampled means: of any differences."""


def t_quantile(share: float, degrees: int) -> float:
    """Quantile of Student's t, to 0.1 % from 4 degrees of freedom on.

    The expansion about the normal quantile of Abramowitz and Stegun, *Handbook of Mathematical
    Functions* (1964), 26.7.5.
    """
    z = NormalDist().inv_cdf(share)
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    quantile: float = z + sum(
        term / degrees**power for power, term in enumerate(terms, 1)
    )
    return quantile


def paired(
    ours: npt.NDArray[np.float64], theirs: npt.NDArray[np.float64], seed: int = 1
) -> Paired:
    """The mean of `ours - theirs`, of episodes with the same seeds in the same order.

    `seed` is the bootstrap's.

    Raises:
        ValueError: Not as many of the one as of the other, or fewer than five pairs.
    """
    if ours.shape != theirs.shape or ours.ndim != 1 or len(ours) < LEAST_PAIRS:
        raise ValueError(
            f"{ours.shape} and {theirs.shape} episodes: not pairs, or under {LEAST_PAIRS}"
        )
    differences = ours.astype(np.float64) - theirs
    count, mean = len(differences), float(differences.mean())
    error = float(differences.std(ddof=1)) / count**0.5
    half = t_quantile(0.975, count - 1) * error
    rng = np.random.default_rng(seed)
    means = [
        differences[rng.integers(count, size=(500, count))].mean(axis=1)
        for _ in range(RESAMPLES // 500)
    ]
    low, high = np.percentile(np.concatenate(means), (2.5, 97.5))
    return Paired(count, mean, (mean - half, mean + half), (float(low), float(high)))
