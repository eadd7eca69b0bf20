"""Our environment by its name in RLlib (`pip install "ray[rllib]" "tractrix[gym]"`).

    import tractrix.train.rllib
    from ray.rllib.algorithms.dqn import DQNConfig

    tractrix.train.rllib.register()
    config = DQNConfig().environment("tractrix/Highway-v0", env_config={"scenario": "table2-sparse-15"})

`env_config` has the arguments of `tractrix.VectorEnv`. RLlib knows no mask: what the gate refuses
keeps the lane.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tractrix._gym import HighwayEnv

NAME = "tractrix/Highway-v0"


def _environment(config: Mapping[str, Any]) -> HighwayEnv:
    return HighwayEnv(**config)


def register() -> None:
    """Registers the environment with Ray, for the processes of the cluster too.

    Raises:
        ImportError: Ray or what its `tune` needs is not installed.
    """
    from ray.tune.registry import register_env

    register_env(NAME, _environment)
