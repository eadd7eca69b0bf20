"""The paper's network: fully connected, rectified between the layers, one value per action."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from torch import Tensor, nn

HIDDEN = (256, 512, 256)
"""Widths of the paper's hidden layers."""
ACTIONS = ("left", "keep", "right")
"""Meaning of the outputs, in their order."""


class QNetwork(nn.Module):
    """Values of the three actions for rows of observations.

    Its state has the names that the program's loader reads: `layers.<i>.weight` and
    `layers.<i>.bias`.

    Args:
        inputs: Numbers in an observation.
        hidden: Widths of the hidden layers.
    """

    def __init__(self, inputs: int, hidden: Sequence[int] = HIDDEN) -> None:
        super().__init__()
        sizes = (inputs, *hidden, len(ACTIONS))
        self.layers = nn.ModuleList(
            nn.Linear(before, after) for before, after in itertools.pairwise(sizes)
        )

    def forward(self, observations: Tensor) -> Tensor:
        """Values `[n, 3]` of observations `[n, inputs]`."""
        x = observations
        for layer in self.layers[:-1]:
            x = nn.functional.relu(layer(x))
        values: Tensor = self.layers[-1](x)
        return values
