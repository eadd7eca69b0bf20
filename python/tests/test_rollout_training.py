"""Training on rollout advantages: skipped where PyTorch is not installed."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tractrix
from cluster import two_workers

torch = pytest.importorskip(
    "torch", reason='PyTorch is not installed: pip install "./python[train]"'
)

from tractrix.evaluate.drive import drive
from tractrix.train.export import network_of
from tractrix.train.margin import COLUMNS, ROWS
from tractrix.train.rollout import Settings, Training


def small(**changes: Any) -> Settings:
    """A training of seconds."""
    given: dict[str, Any] = {"scenarios": ("table2-sparse-12.5",), "envs": 8}
    given |= {"episode_s": 60.0, "decisions": 60, "ask_every": 6, "horizon_s": 15.0}
    given |= {"rounds": 2, "epochs": 4, "validate_every": 2, "validation_seeds": 2}
    return Settings(**{**given, **changes})


def weights(training: Training) -> bytes:
    tensors = training.network.state_dict().values()
    return b"".join(tensor.numpy().tobytes() for tensor in tensors)


def test_one_seed_gives_one_network_on_any_threads_and_after_a_stop(
    tmp_path: Path,
) -> None:
    whole = Training(small(), tmp_path / "whole")
    whole.run()
    assert len(whole.obs) > 50 and len(whole.curve) == 4
    threads = Training(small(), tmp_path / "threads", threads=3)
    threads.run()
    assert weights(whole) == weights(threads)
    Training(small(), tmp_path / "parts").run(until=1)
    resumed = Training(small(), tmp_path / "parts", resume=True)
    assert resumed.round == 1 and weights(resumed) != weights(whole)
    resumed.run()
    assert weights(resumed) == weights(whole)
    other = Training(small(seed=2), tmp_path / "other")
    other.run(until=1)
    assert weights(other) != weights(whole)
    with pytest.raises(ValueError, match="trained otherwise"):
        Training(small(seed=2), tmp_path / "parts", resume=True)


def test_what_decides_keeps_its_lane_for_a_margin_in_company(tmp_path: Path) -> None:
    training = Training(small(rounds=1, company_s=0.2), tmp_path)
    training.run()
    obs = training.obs[:200]
    vehicles = obs[:, : ROWS * COLUMNS].reshape(-1, ROWS, COLUMNS)[:, 1:, 0].sum(axis=1)
    assert vehicles.min() < vehicles.max() and set(np.unique(vehicles)) <= set(range(9))
    with torch.no_grad():
        bare = training.network(torch.from_numpy(obs)).numpy()
        decides = training.policy(torch.from_numpy(obs)).numpy()
    more = np.stack([0 * vehicles, 0.2 * np.maximum(vehicles - 1, 0), 0 * vehicles], 1)
    np.testing.assert_allclose(decides, bare + more, atol=1e-5)
    # It is what is exported, in the last validation or one before it.
    exported = tractrix.Policy(tmp_path / "policy.safetensors")
    assert exported.sidecar["training"]["settings"]["company_s"] == 0.2
    wide = network_of(tmp_path / "policy.safetensors").layers[0].out_features
    assert wide == training.network.layers[0].out_features + 1


@pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed"
)
def test_actors_of_a_cluster_give_the_network_of_one_process(tmp_path: Path) -> None:
    whole = Training(small(), tmp_path / "whole")
    whole.run()
    with two_workers():
        shared = Training(small(), tmp_path / "shared", actors=2)
        shared.run()
    assert weights(shared) == weights(whole)


def test_a_minute_of_training_beats_keep_and_random_changes(tmp_path: Path) -> None:
    scenarios = ("table2-sparse-12.5", "table2-medium-12.5")
    settings = Settings(
        scenarios=scenarios, envs=32, decisions=200, rounds=2, validation_seeds=4
    )
    Training(settings, tmp_path).run()
    policy = tractrix.Policy(tmp_path / "policy.safetensors")
    rng = np.random.default_rng(1)

    def random(_: Any, __: Any, mask: Any) -> Any:
        return np.where(mask, rng.random(mask.shape), -1.0).argmax(axis=1)

    def reward_s(decide: Any) -> Any:
        seeds = range(5_000_000, 5_000_020)
        return drive(decide, scenarios, seeds, episode_s=300.0)["reward_s"].ravel()

    ours = reward_s(lambda _, obs, mask: policy.choose(obs, mask))
    for other in (lambda _, obs, __: np.ones(len(obs), np.int64), random):
        better = ours - reward_s(other)
        assert better.mean() > 2.0 * better.std(ddof=1) / np.sqrt(len(better))
