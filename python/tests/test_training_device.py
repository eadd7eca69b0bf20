"""Where a network is fitted: skipped without PyTorch, on a GPU without one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip(
    "torch", reason='PyTorch is not installed: pip install "./python[train]"'
)

from tractrix.train import ddqn, rollout
from tractrix.train.device import device_of
from tractrix.train.network import QNetwork

on_a_gpu = pytest.mark.skipif(
    not torch.cuda.is_available(), reason="PyTorch finds no GPU"
)


@pytest.mark.parametrize("name", ["cuda:99", "abacus", ""])
def test_a_device_that_is_not_here_is_refused_by_its_name(name: str) -> None:
    with pytest.raises(ValueError, match=f"device = {name}: not here"):
        device_of(name)


def test_a_mean_of_weights_follows_those_that_are_fitted(tmp_path: Path) -> None:
    training = fitted(tmp_path, average_frac=0.5)
    mean, weights = training.network, QNetwork(training.obs.shape[1])
    with torch.no_grad():
        for parameter in mean.parameters():
            parameter.zero_()
        for parameter in weights.parameters():
            parameter.fill_(1.0)
    # The first update is followed by nine tenths, a later one by what the setting says.
    for updates, wanted in ((1, 0.9), (1000, 0.95), (1000, 0.975)):
        training._follow(weights, updates)
        for parameter in mean.parameters():
            assert torch.allclose(parameter, torch.tensor(wanted))


def fitted(out: Path, rounds: int = 0, **changes: Any) -> rollout.Training:
    """A training of seconds on rollout advantages."""
    given: dict[str, Any] = {"scenarios": ("table2-sparse-12.5",), "envs": 8}
    given |= {"episode_s": 60.0, "decisions": 60, "ask_every": 6, "horizon_s": 15.0}
    given |= {"rounds": 2, "epochs": 4, "validate_every": 2, "validation_seeds": 2}
    training = rollout.Training(rollout.Settings(**given | changes), out)
    training.run(until=rounds)
    return training


def by_double_dqn(out: Path, rounds: int, **changes: Any) -> ddqn.Training:
    """A training of seconds by double DQN."""
    given: dict[str, Any] = {"scenarios": ("table2-sparse-12.5",), "envs": 8}
    given |= {"episode_s": 40.0, "rounds": 4, "warm_up": 50, "replay": 300}
    given |= {"updates_per_step": 1, "validate_every": 2, "validation_seeds": 2}
    training = ddqn.Training(ddqn.Settings(**given | changes), out)
    training.run(until=rounds)
    return training


def bits(network: Any) -> bytes:
    return b"".join(t.cpu().numpy().tobytes() for t in network.state_dict().values())


@on_a_gpu
def test_a_gpu_fits_the_same_bits_again_and_after_a_stop(tmp_path: Path) -> None:
    gpu = {"device": "cuda"}
    whole = fitted(tmp_path / "whole", 2, **gpu)
    assert next(whole.network.parameters()).is_cuda
    assert bits(fitted(tmp_path / "again", 2, **gpu).network) == bits(whole.network)
    fitted(tmp_path / "parts", 1, **gpu)
    resumed = rollout.Training(whole.settings, tmp_path / "parts", resume=True)
    resumed.run()
    assert bits(resumed.network) == bits(whole.network)
    # The first round's states are those of a training on the CPU, the fit differs by rounding.
    cpu = fitted(tmp_path / "cpu", 2)
    ours, theirs = (t.curve[1]["loss"] for t in (whole, cpu))
    assert ours == pytest.approx(theirs, rel=0.05)


@on_a_gpu
def test_double_dqn_on_a_gpu_learns_the_same_bits_again_and_after_a_stop(
    tmp_path: Path,
) -> None:
    gpu = {"device": "cuda"}
    whole = by_double_dqn(tmp_path / "whole", 4, **gpu)
    assert whole.learner.updates > 50
    assert next(whole.learner.online.parameters()).is_cuda
    again = by_double_dqn(tmp_path / "again", 4, **gpu)
    by_double_dqn(tmp_path / "parts", 2, **gpu)
    resumed = ddqn.Training(whole.settings, tmp_path / "parts", resume=True)
    resumed.run()
    wanted = bits(whole.learner.online)
    assert bits(again.learner.online) == bits(resumed.learner.online) == wanted
