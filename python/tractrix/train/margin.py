"""A policy that changes lanes only for more than a margin: the value of keeping is raised by it.

A margin for every vehicle that the newest frame shows, and not one for all states: in sparse traffic a
change that is put off now is put off for ever, in company the gate does not stay open.
"""

from __future__ import annotations

import torch

from tractrix.train.network import ACTIONS, QNetwork

COLUMNS, ROWS = 6, 9
"""Of a frame; column 0 of rows 1 to 8 says whether a vehicle is there."""


def with_margins(
    network: QNetwork,
    *,
    margin_s: float = 0.0,
    company_s: float = 0.0,
    beyond: float = 1.0,
) -> QNetwork:
    """A network of the same values, but for keeping.

    The one margin is in the bias of the last layer, the other in one more neuron of each hidden layer,
    which counts the vehicles.

    Args:
        network: The network, of an observation that begins with the newest frame.
        margin_s: What keeping is raised by in every state, s at the reference speed.
        company_s: What it is raised by for each vehicle shown beyond the first `beyond`, s.
        beyond: Vehicles that cost nothing.
    """
    first = network.layers[0]
    wider = QNetwork(
        first.in_features, [layer.out_features + 1 for layer in network.layers[:-1]]
    )
    with torch.no_grad():
        for into, layer in zip(wider.layers, network.layers, strict=True):
            into.weight.zero_()
            into.bias.zero_()
            outputs, inner = layer.weight.shape
            into.weight[:outputs, :inner] = layer.weight
            into.bias[:outputs] = layer.bias
            into.weight[outputs:, inner:] = 1.0
        count = wider.layers[0]
        count.weight[-1, COLUMNS : ROWS * COLUMNS : COLUMNS] = 1.0
        count.bias[-1] = -beyond
        keep = ACTIONS.index("keep")
        wider.layers[-1].weight[keep, -1] = company_s
        wider.layers[-1].bias[keep] += margin_s
    return wider
