"""On a Ray cluster of two workers the numbers are those of one process, also where workers die."""

from __future__ import annotations

import dataclasses
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cluster import two_workers
from tractrix.evaluate.sweep import Found, Part, here, on_ray
from tractrix.train.asking import Asking, Draws, Team

ray = pytest.importorskip(
    "ray", reason='Ray is not installed: pip install "tractrix[scale]"'
)

POLICY = Path(__file__).parents[2] / "policies" / "table2.safetensors"
ENVS, DECISIONS = 8, 120


@pytest.fixture(scope="module", autouse=True)
def _cluster() -> Iterator[None]:
    with two_workers():
        yield


def asking() -> Asking:
    return Asking(
        scenarios=("table2-medium-12.5", "table2-sparse-12.5", "table2-sparse-15"),
        episode_s=60.0,
        first_base="mobil",
        ask_every=6,
        explore_frac=0.15,
        horizon_s=20.0,
        discount_frac_s=0.99,
        change_cost_s=0.25,
    )


def test_actors_find_what_one_process_finds_and_a_killed_one_loses_nothing() -> None:
    former = (POLICY.read_bytes(), POLICY.with_suffix(".json").read_text())
    one = Team(asking(), ENVS, 0, 1)
    rounds = [(1, None), (2, former)]
    wanted = [
        one.ask(Draws.of(np.random.default_rng(seed), DECISIONS, ENVS), files)
        for seed, files in rounds
    ]
    assert len(wanted[0][0]) > 30 and len(wanted[1][0]) > 30

    # the second actor's four environments begin with the second of three scenarios
    team = Team(asking(), ENVS, 2, 1)
    killed_s: list[float] = []

    def kill(process: int) -> None:
        os.kill(process, signal.SIGKILL)
        killed_s.append(time.monotonic())

    for (seed, files), states in zip(rounds, wanted, strict=True):
        process = ray.get(team.actors[1].process.remote())
        killer = threading.Timer(0.2, kill, (process,))
        killer.start()
        draws = Draws.of(np.random.default_rng(seed), DECISIONS, ENVS)
        found = team.ask(draws, files)
        ended_s = time.monotonic()
        killer.join()
        assert killed_s.pop() < ended_s, "it was killed at work"
        assert ray.get(team.actors[1].process.remote()) != process
        for ours, theirs in zip(found, states, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(ValueError, match="actors = 9"):
        Team(asking(), ENVS, 9, 1)


def test_a_sweep_gives_the_figures_of_one_process(tmp_path: Path) -> None:
    @dataclasses.dataclass(frozen=True)
    class Dies(Part):
        """Its worker is killed the first time that the last seeds are driven."""

        mark: str

        def drive(self) -> Found:
            mark = Path(self.mark)
            if self.mark and 20 not in self.seeds and not mark.exists():
                mark.touch()
                os.kill(os.getpid(), signal.SIGKILL)
            return super().drive()

    environment: dict[str, Any] = {"episode_s": 30.0}
    parts = [
        Part(word, name, name, range(1, 31), "builtin:table2", environment)
        for word in ("mobil", "dqn")
        for name in ("table2-medium-12.5", "table2-sparse-15")
    ]
    told: list[str] = []

    def tell(part: Part, _: Found) -> None:
        told.append(part.word)

    wanted = here(parts, tell)
    mark = tmp_path / "died"
    dying = [Dies(**vars(part), mark=str(mark)) for part in parts]
    found = on_ray(dying, tell)
    assert mark.exists() and told == 2 * ["mobil", "mobil", "dqn", "dqn"]
    for (ours, _), (theirs, _) in zip(found, wanted, strict=True):
        assert ours["seed"].tolist() == list(range(1, 31))
        for name, values in theirs.items():
            np.testing.assert_array_equal(ours[name], values)


def test_rllib_trains_an_iteration_on_the_registered_environment() -> None:
    pytest.importorskip(
        "ray.rllib.algorithms.dqn", reason="RLlib is not installed: ray[rllib]"
    )
    from ray.rllib.algorithms.dqn import DQNConfig
    from tractrix.train import rllib

    rllib.register()
    config = DQNConfig().framework("torch").env_runners(num_env_runners=1)
    config.environment(rllib.NAME, env_config={"scenario": "table2-sparse-15"})
    config.training(num_steps_sampled_before_learning_starts=20, train_batch_size=16)
    config.reporting(min_sample_timesteps_per_iteration=60, min_time_s_per_iteration=0)
    algorithm = config.build_algo()
    result = algorithm.train()
    algorithm.stop()
    assert result["training_iteration"] == 1
    assert result["num_env_steps_sampled_lifetime"] >= 60
