"""A peer of our trainers: the DQN of Stable-Baselines3 on our environments, with the paper's network.

pip install "./python[train]" stable-baselines3
python tools/sb3_dqn.py --out runs/sb3 --seed 1
python -m tractrix.evaluate --deciders rules:50,mobil,dqn,dqn:runs/sb3/policy.safetensors --out runs/table2

Its settings are its own but for those of the paper that it has (network, Adam's step, batch, copies of
the target) and the exploration of `tractrix.train.ddqn`. It knows no mask: in training the gate refuses
what is not safe, and the refused wish keeps the lane; in the evaluation its best allowed action counts,
as for every policy. It has no double estimate and no steps of more than one decision.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import DQN
from stable_baselines3.common.vec_env import VecEnv
from tractrix import VectorEnv
from tractrix.evaluate.drive import TABLE2
from tractrix.train.export import export
from tractrix.train.network import HIDDEN, QNetwork

ENVS = 48
UPDATES_PER_STEP = 4


class Environments(VecEnv):  # type: ignore[misc]
    """Our environments as Stable-Baselines3 wants them."""

    def __init__(self, seed: int) -> None:
        self.env = VectorEnv(ENVS, TABLE2, seed, episode_s=300.0)
        space = self.env.single_observation_space
        super().__init__(ENVS, space, self.env.single_action_space)
        self.actions: Any = None

    def reset(self) -> Any:
        """Begins everywhere."""
        return self.env.reset()[0]

    def step_async(self, actions: Any) -> None:
        """Takes the actions of the next step."""
        self.actions = actions

    def step_wait(self) -> Any:
        """Drives them."""
        obs, reward, terminated, truncated, found = self.env.step(self.actions)
        infos: list[dict[str, Any]] = [{} for _ in range(ENVS)]
        for i in np.flatnonzero(terminated | truncated):
            infos[i]["terminal_observation"] = found["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(truncated[i])
        return obs, reward, terminated | truncated, infos

    def close(self) -> None:
        """Gives them up."""
        self.env.close()

    def get_attr(self, name: str, indices: Any = None) -> list[Any]:
        """None has attributes of its own."""
        return [None] * ENVS

    def set_attr(self, name: str, value: Any, indices: Any = None) -> None:
        """Nothing can be set."""
        raise AttributeError(name)

    def env_method(self, name: str, *given: Any, **named: Any) -> list[Any]:
        """Nothing can be called."""
        raise AttributeError(name)

    def env_is_wrapped(self, wrapper: Any, indices: Any = None) -> list[bool]:
        """None is wrapped."""
        return [False] * ENVS


def network_of(layers: Sequence[Any]) -> QNetwork:
    """The trained network with our names of its tensors."""
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    network = QNetwork(linear[0].in_features)
    for ours, theirs in zip(network.layers, linear, strict=True):
        ours.load_state_dict(theirs.state_dict())
    return network


def main() -> None:
    """Trains and writes `policy.safetensors` with its sidecar."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of its files")
    parser.add_argument("--seed", type=int, default=1, help=" ")
    parser.add_argument("--steps", type=int, default=5000, help="of all environments")
    given = parser.parse_args()
    torch.set_num_threads(1)
    before_s = time.process_time()
    settings: dict[str, Any] = {
        "learning_rate": 5e-4,
        "buffer_size": 50_000,
        "learning_starts": 5_000,
        "batch_size": 64,
        "gamma": 0.99,
        "train_freq": 1,
        "gradient_steps": UPDATES_PER_STEP,
        "target_update_interval": 500 // UPDATES_PER_STEP * ENVS,
        "exploration_fraction": 1.0 / 3.0,
        "exploration_final_eps": 0.03,
        "policy_kwargs": {"net_arch": list(HIDDEN)},
    }
    environments = Environments(given.seed)
    model = DQN("MlpPolicy", environments, seed=given.seed, device="cpu", **settings)
    model.learn(given.steps * ENVS)
    cpu_s = time.process_time() - before_s
    export(
        network_of(list(model.q_net.q_net)),
        given.out / "policy.safetensors",
        spec="ours",
        seeds=[given.seed],
        training={"trainer": "stable-baselines3 DQN", "settings": settings},
        evaluation={},
    )
    print(f"{model._n_updates} updates, {cpu_s:.0f} CPU s")


if __name__ == "__main__":
    main()
