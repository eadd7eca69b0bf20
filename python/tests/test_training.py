"""Training with PyTorch: skipped where it is not installed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tractrix

torch = pytest.importorskip(
    "torch", reason='PyTorch is not installed: pip install "./python[train]"'
)

from tractrix.train.export import export, network_of
from tractrix.train.network import QNetwork


def test_the_truck_computes_what_pytorch_computes(tmp_path: Path) -> None:
    torch.manual_seed(3)
    network = QNetwork(237)
    file = tmp_path / "policy.safetensors"
    export(network, file, spec="ours", seeds=[3], training={}, evaluation={})
    policy = tractrix.Policy(file)
    assert policy.spec == "ours" and policy.sidecar["seeds"] == [3]
    rng = np.random.default_rng(5)
    observations = rng.uniform(-1.0, 1.0, (1000, 237)).astype(np.float32)
    observations[rng.random(observations.shape) < 0.4] = 0.0
    with torch.no_grad():
        wanted = network(torch.from_numpy(observations)).numpy()
        again = network_of(file)(torch.from_numpy(observations)).numpy()
    assert np.abs(policy.values(observations) - wanted).max() < 1e-5
    assert (again == wanted).all() and wanted.std() > 1e-3
    mask = np.tile([1, 1, 0], (1000, 1))
    assert (policy.choose(observations, mask) == wanted[:, :2].argmax(axis=1)).all()


def test_an_export_for_another_observation_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "policy.safetensors"
    export(QNetwork(237), file, spec="paper", seeds=[], training={}, evaluation={})
    with pytest.raises(ValueError, match="layer 0"):
        tractrix.Policy(file)
    with pytest.raises(ValueError, match="ours or paper"):
        export(QNetwork(8), file, spec="theirs", seeds=[], training={}, evaluation={})
    export(QNetwork(216), file, spec="paper", seeds=[], training={}, evaluation={})
    assert tractrix.Policy(file).spec == "paper"
    sidecar = json.loads(file.with_suffix(".json").read_text())
    sidecar["actions"] = ["right", "keep", "left"]
    before = tractrix.Policy(file).values(np.ones((1, 216), np.float32))
    file.with_suffix(".json").write_text(json.dumps(sidecar))
    after = tractrix.Policy(file).values(np.ones((1, 216), np.float32))
    assert (after == before[:, ::-1]).all()
    with pytest.raises(ValueError, match=r"shape \(1, 3\)"):
        tractrix.Policy(file).values(np.ones((1, 3), np.float32))
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(ValueError, match="SHA-256"):
        tractrix.Policy(file)
