"""A policy that changes lanes only for more than a margin: the value of keeping is raised by it.

pip install "./python[train]"
python tools/keep_margin.py policies/table2.safetensors --margin-s 0.1 --out runs/margin/policy.safetensors

`--company-s` adds a margin for every vehicle that the newest frame shows beyond `--beyond` of them: in
sparse traffic a change that is put off now is put off for ever, in dense traffic the gate does not stay
open. The one margin is in the bias of the last layer, the other in one more neuron of each hidden layer.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import torch
from tractrix.train.export import export, network_of
from tractrix.train.network import ACTIONS, HIDDEN, QNetwork

COLUMNS, ROWS = 6, 9
"""Of a frame; column 0 of rows 1 to 8 says whether a vehicle is there."""


def with_margins(
    network: QNetwork, margin_s: float, company_s: float, beyond: float
) -> QNetwork:
    """The same values, but for keeping."""
    inputs = network.layers[0].in_features
    wider = QNetwork(inputs, [width + 1 for width in HIDDEN])
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


def main() -> None:
    """Writes the policy and its sidecar."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--out", type=Path, required=True, help=" ")
    parser.add_argument("--margin-s", type=float, default=0.0, help=" ")
    parser.add_argument("--company-s", type=float, default=0.0, help=" ")
    parser.add_argument("--beyond", type=float, default=1.0, help="vehicles")
    given = parser.parse_args()
    sidecar = json.loads(given.file.with_suffix(".json").read_text())
    margins = {
        "margin_s": given.margin_s,
        "company_s": given.company_s,
        "beyond": given.beyond,
    }
    export(
        with_margins(network_of(given.file), **margins),
        given.out,
        spec="ours",
        seeds=sidecar["seeds"],
        training=sidecar["training"] | {"keep_margin": margins},
        evaluation={},
    )


if __name__ == "__main__":
    main()
