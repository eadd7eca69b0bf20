"""A learned policy as the truck runs it, without PyTorch."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from tractrix import _native

_ACTIONS = ("left", "keep", "right")
SHIPPED = "builtin:table2"
"""The policy that is shipped."""


class Policy:
    """Weights that a training has exported, and the forward pass of the truck's own decider.

    Args:
        file: `.safetensors` file with its `.json` beside it (`tractrix.train.export`). Default: the
            policy that is shipped, which `--decider dqn` drives.

    Raises:
        ValueError: Weights or sidecar that cannot be used; the text says why.
        FileNotFoundError: A file that is not there.
    """

    def __init__(self, file: str | os.PathLike[str] = SHIPPED) -> None:
        self._native = _native.Policy(os.fspath(file))
        self.sidecar: dict[str, Any] = json.loads(self._native.sidecar())
        """What is known of the training."""
        self.spec: str = self._native.spec()
        """`spec` of the `tractrix.VectorEnv` whose observations it wants."""
        self._order = [self.sidecar["actions"].index(action) for action in _ACTIONS]

    def values(self, observations: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Values of left, keep and right for rows of observations."""
        given = np.ascontiguousarray(observations, np.float32)
        size = self._native.observation_size()
        if given.ndim != 2 or given.shape[1] != size:
            raise ValueError(f"observations: shape {given.shape}, not (n, {size})")
        out = np.empty((len(given), len(_ACTIONS)), np.float32)
        self._native.values(given, out)
        return out[:, self._order]

    def choose(
        self, observations: npt.NDArray[np.float32], mask: npt.NDArray[Any]
    ) -> npt.NDArray[np.int64]:
        """The allowed action of the highest value for rows of observations and masks."""
        values = self.values(observations)
        chosen: npt.NDArray[np.int64] = np.where(mask, values, -np.inf).argmax(axis=1)
        return chosen
