"""One environment, as `gymnasium.make("tractrix/Highway-v0")` makes it."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from tractrix._vector_env import VectorEnv


class HighwayEnv(gymnasium.Env[npt.NDArray[np.float32], np.int64]):
    """One truck; arguments are those of `tractrix.VectorEnv`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, **arguments: Any) -> None:
        self._env = VectorEnv(1, **arguments)
        self.observation_space = self._env.single_observation_space
        self.action_space = self._env.single_action_space
        self._closed = False
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Begins an episode; without a seed the next one after the last seed given."""
        super().reset(seed=seed)
        if seed is not None:
            self._seeded = True
        elif self._seeded:
            seed = int(self.np_random.integers(2**63))
        obs, infos = self._env.reset(seed=seed)
        return obs[0], {"action_mask": infos["action_mask"][0]}

    def step(
        self, action: np.int64
    ) -> tuple[npt.NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Drives one decision."""
        obs, reward, terminated, truncated, infos = self._env.step(np.array([action]))
        info: dict[str, Any] = {"action_mask": infos["action_mask"][0]}
        if "final_obs" in infos:
            obs = infos["final_obs"]
            info["episode"] = {
                name: all_[0] for name, all_ in infos["final_info"].items()
            }
        return obs[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), info

    def close(self) -> None:
        """Gives the environment up."""
        if not self._closed:
            self._closed = True
            self._env.close()
