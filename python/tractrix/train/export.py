"""From a trained network to the two files that the truck's decider loads, and back.

`NAME.safetensors` has the weights, `NAME.json` beside it what they were trained on and how they did.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from safetensors.torch import load_file, save

from tractrix import _native
from tractrix.train.network import ACTIONS, QNetwork


def encoded(
    network: QNetwork,
    *,
    spec: str,
    seeds: Sequence[int] = (),
    training: Mapping[str, Any] | None = None,
    evaluation: Mapping[str, Any] | None = None,
) -> tuple[bytes, str]:
    """The contents of both files; the arguments are those of `export`."""
    tensors = {
        name: tensor.detach().cpu().contiguous()
        for name, tensor in network.state_dict().items()
    }
    weights = save(tensors)
    sidecar = {
        "schema": 1,
        "observation_hash": _native.observation_hash(spec),
        "actions": list(ACTIONS),
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
        "training_revision": _native.GIT_REVISION,
        "seeds": list(seeds),
        "training": dict(training or {}),
        "evaluation": dict(evaluation or {}),
    }
    return weights, json.dumps(sidecar, indent=2) + "\n"


def export(
    network: QNetwork,
    file: str | os.PathLike[str],
    *,
    spec: str,
    seeds: Sequence[int],
    training: Mapping[str, Any],
    evaluation: Mapping[str, Any],
) -> None:
    """Writes `file` (`.safetensors`) and its sidecar (`.json`).

    Args:
        network: The trained network.
        file: Name of the weights.
        spec: `ours` or `paper`: the `spec` of the environments it was trained in.
        seeds: Seeds of the training.
        training: How it was trained: settings, updates, CPU seconds.
        evaluation: What it came to, on which seeds.

    Raises:
        ValueError: A name that does not end with `.safetensors`, or another `spec`.
    """
    weights_file = Path(file)
    if weights_file.suffix != ".safetensors":
        raise ValueError(f"{weights_file}: the name has to end with .safetensors")
    weights, sidecar = encoded(
        network, spec=spec, seeds=seeds, training=training, evaluation=evaluation
    )
    weights_file.parent.mkdir(parents=True, exist_ok=True)
    weights_file.write_bytes(weights)
    weights_file.with_suffix(".json").write_text(sidecar)


def network_of(file: str | os.PathLike[str]) -> QNetwork:
    """The network of an exported file, to go on training it."""
    tensors = load_file(file)
    sizes = [
        tensors[f"layers.{i}.weight"].shape[0]
        for i in range(sum(name.endswith(".weight") for name in tensors))
    ]
    network = QNetwork(tensors["layers.0.weight"].shape[1], sizes[:-1])
    network.load_state_dict(tensors)
    return network
