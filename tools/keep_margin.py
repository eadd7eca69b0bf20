"""A policy that changes lanes only for more than a margin: the value of keeping is raised by it.

pip install "./python[train]"
python tools/keep_margin.py policies/table2.safetensors 0.1 runs/margin-0.1/policy.safetensors
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import torch
from tractrix.train.export import export, network_of
from tractrix.train.network import ACTIONS


def main() -> None:
    """Writes the policy and its sidecar; the margin is in the bias of the last layer."""
    file, margin_s, out = Path(sys.argv[1]), float(sys.argv[2]), Path(sys.argv[3])
    network = network_of(file)
    sidecar = json.loads(file.with_suffix(".json").read_text())
    with torch.no_grad():
        network.layers[-1].bias[ACTIONS.index("keep")] += margin_s
    export(
        network,
        out,
        spec="ours",
        seeds=sidecar["seeds"],
        training=sidecar["training"] | {"keep_margin_s": margin_s},
        evaluation={},
    )


if __name__ == "__main__":
    main()
