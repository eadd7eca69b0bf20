"""Training with PyTorch: skipped where it is not installed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tractrix

torch = pytest.importorskip(
    "torch", reason='PyTorch is not installed: pip install "./python[train]"'
)

from tractrix.evaluate.drive import drive
from tractrix.train.ddqn import Choices, Replay, Settings, Training
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


def small(**changes: Any) -> Settings:
    """A training of seconds."""
    given = {"scenarios": ("table2-sparse-12.5",), "envs": 8, "episode_s": 40.0}
    given |= {"rounds": 4, "warm_up": 50, "replay": 300, "updates_per_step": 1}
    given |= {"validate_every": 2, "validation_seeds": 2}
    return Settings(**{**given, **changes})


def weights(training: Training) -> bytes:
    tensors = training.learner.online.state_dict().values()
    return b"".join(tensor.numpy().tobytes() for tensor in tensors)


def test_one_seed_gives_one_network_on_any_threads_and_after_a_stop(
    tmp_path: Path,
) -> None:
    whole = Training(small(), tmp_path / "whole")
    whole.run()
    assert whole.learner.updates > 50
    threads = Training(small(), tmp_path / "threads", threads=3)
    threads.run()
    assert weights(whole) == weights(threads)
    Training(small(), tmp_path / "parts").run(until=2)
    resumed = Training(small(), tmp_path / "parts", resume=True)
    assert resumed.round == 2 and weights(resumed) != weights(whole)
    resumed.run()
    assert weights(resumed) == weights(whole)
    done = [json.loads((t.out / "curve.json").read_text()) for t in (resumed, whole)]
    losses = [[row["loss"] for row in curve[1:]] for curve in done]
    assert losses[0] == losses[1] and len(losses[0]) == 3
    other = Training(small(seed=2), tmp_path / "other")
    other.run(until=2)
    assert weights(other) != weights(whole)
    with pytest.raises(ValueError, match="trained otherwise"):
        Training(small(seed=2), tmp_path / "parts", resume=True)


def test_a_transition_leads_from_one_choice_to_the_nth_after_it() -> None:
    replay = Replay(10, 1)
    choices = Choices(2, 2, 0.5, replay)
    no = np.zeros(2, np.bool_)
    mask = np.ones((2, 3), np.bool_)

    def step(number: float, free: list[bool], ends: list[bool]) -> None:
        obs = np.full((2, 1), number, np.float32)
        reward = np.array([1.0, 10.0])
        choices.earned(reward, np.array(ends), no, obs, mask, np.array(free))
        choices.made(obs, np.array([2, 0]), np.array(free))

    choices.made(np.zeros((2, 1), np.float32), np.array([2, 0]), ~no)
    step(1.0, [False, True], [False, False])
    step(2.0, [True, False], [False, False])
    assert len(replay) == 0
    step(3.0, [True, True], [False, True])
    rows = {name: values[: len(replay)] for name, values in replay.rows.items()}
    # The first: choices at 0 and 2, the next at 3. The second: choices at 0 and 1, a collision at 3.
    assert rows["obs"].ravel().tolist() == [0.0, 0.0, 1.0]
    assert rows["next_obs"].ravel().tolist() == [3.0, 3.0, 3.0]
    assert rows["reward"].tolist() == [1.75, 17.5, 15.0]
    assert rows["discount"].tolist() == [0.125, 0.0, 0.0]


def test_a_minute_of_training_beats_keep_and_random_changes(tmp_path: Path) -> None:
    scenarios = ("table2-sparse-12.5", "table2-medium-12.5")
    settings = Settings(
        scenarios=scenarios,
        envs=24,
        rounds=10,
        episode_s=200.0,
        warm_up=1000,
        validate_every=1,
        validation_seeds=12,
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
