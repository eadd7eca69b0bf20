"""Many environments at once, as Gymnasium's vector API has them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from tractrix import _native
from tractrix._arguments import path, whole

Scenario = str | os.PathLike[str] | Mapping[str, Any]
Observations = npt.NDArray[np.float32]


def _named(scenario: Scenario) -> tuple[str, str | None]:
    if isinstance(scenario, Mapping):
        return "", json.dumps(dict(scenario))
    return os.fspath(scenario), None


class VectorEnv(
    gymnasium.vector.VectorEnv[Observations, npt.NDArray[Any], npt.NDArray[Any]]
):
    """Trucks that ask for lane changes in traffic; car following and safety are the stack's.

    An action is 0 (to the left), 1 (keep) or 2 (to the right). The safety gate refuses what is not
    safe; `infos["action_mask"]` says before which actions it passes. An episode ends with a collision
    (`terminated`) or with its time or road (`truncated`), and the next begins in the same step:
    `infos["final_obs"]` has the last observation, `infos["final_info"]` the figures of the episode
    where `infos["_final_info"]` is true.

    Args:
        num_envs: Number of environments.
        scenario: Name, file or keys of a scenario with native traffic; of several, the environments
            take one after the other.
        seed: Seed of the episodes that are not given one by `reset`.
        fidelity: `kinematic` (a point on the planned path, 0.1 s) or `truck` (the full truck and
            stack, 0.01 s).
        spec: `ours` (237 numbers, decisions of 1 s, a reward in seconds at the reference speed) or
            `paper` (216 numbers, 10 Hz, Eq. 17 divided by 10).
        threads: Threads that share out the environments; results do not depend on it.
        road: Another road than the scenario's.
        episode_s: Length of an episode, s.
        start_spread_m: The truck starts up to so far beyond the scenario's start, m.
        window_m: Behind and ahead of the truck, m, within which vehicles act in every tick, those
            beyond every 0.5 s; infinity twice: all do always. Default: 300 and 400 where the truck is
            kinematic, else all.
        awake_m: Farther than this from the truck, either way, vehicles drive on at the speed that
            they have: on a road that is the same all along (`builtin:flat`), in free traffic. With
            1,500 m traffic around the truck is that of the whole road. Default: they act everywhere.
        change_cost_s: What a lane change that begins costs in the reward and in `advantages`, s at
            the reference speed. Default: 0.25 for `ours`, 0 for `paper`.
        copy: Whether `reset` and `step` return copies of the observations, masks and rewards, or the
            arrays that the next call writes again.

    Raises:
        ValueError: A word, key or value that cannot be used; the text names it.
        FileNotFoundError: A file that is not there.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "autoreset_mode": AutoresetMode.SAME_STEP,
        "render_modes": [],
    }

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Scenario | Sequence[Scenario] = "table2-dense-12.5",
        seed: int = 1,
        *,
        fidelity: str = "kinematic",
        spec: str = "ours",
        threads: int = 1,
        road: str | os.PathLike[str] | None = None,
        episode_s: float = 600.0,
        start_spread_m: float = 1000.0,
        window_m: tuple[float, float] | None = None,
        awake_m: float | None = None,
        change_cost_s: float | None = None,
        copy: bool = True,
    ) -> None:
        several = isinstance(scenario, Sequence) and not isinstance(scenario, str)
        names = (
            list(scenario) if isinstance(scenario, Sequence) and several else [scenario]
        )
        self.num_envs = whole("num_envs", num_envs)
        self._native = _native.Batch(
            self.num_envs,
            [_named(one) for one in names],  # type: ignore[arg-type]
            road=path(road),
            seed=whole("seed", seed),
            fidelity=fidelity,
            spec=spec,
            episode_s=float(episode_s),
            start_spread_m=float(start_spread_m),
            window_m=window_m,
            awake_m=None if awake_m is None else float(awake_m),
            change_cost_s=None if change_cost_s is None else float(change_cost_s),
            threads=whole("threads", threads),
        )
        size = self._native.observation_size()
        self.single_observation_space = gymnasium.spaces.Box(
            -1.0, 1.0, (size,), np.float32
        )
        self.single_action_space = gymnasium.spaces.Discrete(3)
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._copy = copy
        self._obs = np.zeros((self.num_envs, size), np.float32)
        self._final_obs = np.zeros_like(self._obs)
        self._mask = np.zeros((self.num_envs, 3), np.uint8)
        self._reward = np.zeros(self.num_envs, np.float32)
        self._ends = np.zeros((2, self.num_envs), np.uint8)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begins an episode in every environment, or in those of `options["reset_mask"]`.

        `seed` is one number (environment i gets `seed + i`) or one for each environment.
        """
        which = np.ones(self.num_envs, np.bool_)
        if options and options.get("reset_mask") is not None:
            which = np.asarray(options["reset_mask"])
            if which.shape != (self.num_envs,) or which.dtype != np.bool_:
                raise ValueError(
                    f"reset_mask: {self.num_envs} truth values, one per environment"
                )
        seeds: list[int | None]
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, Sequence):
            seeds = [None if one is None else whole("seed", one) for one in seed]
            if len(seeds) != self.num_envs:
                raise ValueError(
                    f"seed: {len(seeds)} seeds for {self.num_envs} environments"
                )
        else:
            seeds = [whole("seed", seed + i) for i in range(self.num_envs)]
        self._native.reset(seeds, which.tolist())
        self._read()
        return self._own(self._obs), {"action_mask": self._own(self._mask)}

    def step(
        self, actions: npt.NDArray[Any]
    ) -> tuple[
        Observations,
        npt.NDArray[np.float32],
        npt.NDArray[np.bool_],
        npt.NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Drives one decision everywhere."""
        given = np.asarray(actions)
        if given.shape != (self.num_envs,):
            raise ValueError(f"actions: shape {given.shape}, not ({self.num_envs},)")
        if (
            not np.issubdtype(given.dtype, np.integer)
            or not ((given >= 0) & (given < 3)).all()
        ):
            raise ValueError("actions: whole numbers 0 (left), 1 (keep), 2 (right)")
        self._native.step(np.ascontiguousarray(given, np.uint8))
        self._read()
        terminated, truncated = (ends.astype(np.bool_) for ends in self._ends)
        infos: dict[str, Any] = {"action_mask": self._own(self._mask)}
        ended = terminated | truncated
        if ended.any():
            infos["final_obs"] = self._own(self._final_obs)
            infos["_final_obs"] = ended
            infos["final_info"] = self.episodes()
            infos["_final_info"] = ended.copy()
        return (
            self._own(self._obs),
            self._own(self._reward),
            terminated,
            truncated,
            infos,
        )

    def advantages(
        self,
        base: str = "keep",
        *,
        horizon_s: float = 30.0,
        rollouts: int = 1,
        discount_frac_s: float = 0.99,
        drivers: str = "true",
    ) -> npt.NDArray[np.float32]:
        """What each action is worth over keeping the lane now, in seconds at the reference speed.

        Every action that the gate passes is driven to the end from the same state, `base` deciding
        after it; the environments stay as they are. Kinematic environments only.

        Args:
            base: `keep`, `rules:50`, `mobil`, `rollout`, `dqn` for the shipped policy,
                or `dqn:FILE` with the weights of another one.
            horizon_s: Length of a rollout, s.
            rollouts: Rollouts per action, each with other draws of the traffic to come.
            discount_frac_s: A reward is worth this part a second later.
            drivers: `true`, those who drive (privileged: for a teacher or an upper bound), or
                `forgotten`, the means of their classes who wish the speeds that they have.

        Returns:
            A row of left, keep, right per environment: 0 for keep, NaN for an action that the gate
            does not pass and where the road ends within the horizon.
        """
        out = np.empty((self.num_envs, 3), np.float32)
        self._native.advantages(
            out,
            base=base,
            horizon_s=float(horizon_s),
            rollouts=whole("rollouts", rollouts),
            discount_frac_s=float(discount_frac_s),
            drivers=drivers,
        )
        return out

    def wishes(self, decider: str) -> npt.NDArray[np.uint8]:
        """What `keep`, `rules:50`, `mobil` or `rollout` would do now, an action per environment."""
        out = np.empty(self.num_envs, np.uint8)
        self._native.wishes(decider, out)
        return out

    def episodes(self) -> dict[str, npt.NDArray[Any]]:
        """Seed and figures of every environment's episode; of one that has just ended, at its end."""
        rows = self._native.episodes()
        table = np.array([figures for _, figures in rows])
        figures = {name: table[:, i] for i, name in enumerate(_native.Batch.figures())}
        return {"seed": np.array([seed for seed, _ in rows], np.uint64), **figures}

    def close_extras(self, **kwargs: Any) -> None:
        """Gives the environments up; every later call raises `ValueError`."""
        self._native.close()

    def _read(self) -> None:
        self._native.read(
            self._obs,
            self._mask,
            self._reward,
            self._ends[0],
            self._ends[1],
            self._final_obs,
        )

    def _own(self, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return array.copy() if self._copy else array
