"""Driving and asking what lane changes are worth, here or on actors of a Ray cluster.

A round of a training is a pure function of its seeds, its draws and the network that decides: an
`Asker` has some of the environments, and what it finds does not hang on how many there are in it.
So the states of a round are the same bits from one asker in this process and from any number of
actors, and an actor that dies is begun again without a loss.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tractrix._cluster import ATTEMPTS, ray_module
from tractrix._policy import SHIPPED, Policy
from tractrix._vector_env import VectorEnv

Array = npt.NDArray[Any]
Files = tuple[bytes, str]
"""Weights and sidecar of a policy."""
States = tuple[Array, Array, Array]
"""Observations, what left, keep and right are worth there (NaN: the gate does not pass it), and the
numbers of the scenarios."""


@dataclasses.dataclass(frozen=True)
class Asking:
    """What is driven and asked."""

    scenarios: tuple[str, ...]
    """Scenarios, taken by the environments in turn."""
    episode_s: float
    """Length of an episode, s."""
    first_base: str
    """Who decides where there is no network yet."""
    ask_every: int
    """Decisions between two questions."""
    explore_frac: float
    """Share of the decisions that are drawn among those that the gate passes."""
    horizon_s: float
    """Length of a rollout, s."""
    discount_frac_s: float
    """What is left of a reward's worth after a second."""
    change_cost_s: float
    """What a change costs in the reward, s."""


@dataclasses.dataclass(frozen=True)
class Draws:
    """What a round's chance is, for each environment."""

    seeds: tuple[int, ...]
    """Seeds of the traffic."""
    action: Array
    """`[decisions, environments, 3]`: of a random action the allowed one with the largest is taken."""
    explores: Array
    """`[decisions, environments]`: below the share of exploration the action is random."""

    @classmethod
    def of(cls, rng: np.random.Generator, decisions: int, envs: int) -> Draws:
        """Those of a round."""
        seeds = tuple(rng.integers(2**63, size=envs).tolist())
        action, explores = np.empty((decisions, envs, 3)), np.empty((decisions, envs))
        for decision in range(decisions):
            action[decision] = rng.random((envs, 3))
            explores[decision] = rng.random(envs)
        return cls(seeds, action, explores)

    def part(self, which: slice) -> Draws:
        """Those of some environments."""
        return Draws(
            self.seeds[which], self.action[:, which].copy(), self.explores[:, which]
        )


class Asker:
    """Some of the environments of a training, one after the other from `first` on."""

    def __init__(self, asking: Asking, first: int, count: int, threads: int) -> None:
        self.asking = asking
        kinds = len(asking.scenarios)
        self.scenario = np.arange(first, first + count) % kinds
        self.env = VectorEnv(
            count,
            [asking.scenarios[kind] for kind in self.scenario],
            episode_s=asking.episode_s,
            change_cost_s=asking.change_cost_s,
            threads=threads,
        )

    def ask(self, draws: Draws, former: Files | None) -> list[States]:
        """Drives a round; the states of each question.

        Args:
            draws: Its chance.
            former: The network that decides, in the rollouts and on the road. Default: the first base.
        """
        with tempfile.TemporaryDirectory() as folder:
            if former is None:
                base = self.asking.first_base
                word, _, named = base.partition(":")
                policy = Policy(named or SHIPPED) if word == "dqn" else None
                return self._drive(draws, base, policy)
            file = Path(folder) / "former.safetensors"
            file.write_bytes(former[0])
            file.with_suffix(".json").write_text(former[1])
            return self._drive(draws, f"dqn:{file}", Policy(file))

    def _drive(self, draws: Draws, base: str, policy: Policy | None) -> list[States]:
        asking, env = self.asking, self.env
        seen: list[States] = []
        obs, infos = env.reset(seed=draws.seeds)
        chance = zip(draws.action, draws.explores, strict=True)
        for decision, (action, explores) in enumerate(chance, 1):
            mask = infos["action_mask"].astype(np.bool_)
            if decision % asking.ask_every == 0:
                worth = env.advantages(
                    base,
                    horizon_s=asking.horizon_s,
                    discount_frac_s=asking.discount_frac_s,
                )
                known = (~np.isnan(worth)).sum(axis=1) > 1
                seen.append((obs[known], worth[known], self.scenario[known]))
            if policy is None:
                actions = env.wishes(base).astype(np.int64)
            else:
                actions = policy.choose(obs, mask)
            noise = np.where(mask, action, -1.0).argmax(axis=1)
            random = explores < asking.explore_frac
            obs, _, _, _, infos = env.step(np.where(random, noise, actions))
        return seen

    def process(self) -> int:
        """Identifier of the process that it is in."""
        return os.getpid()


class Team:
    """All environments of a training: in this process, or on actors of a Ray cluster.

    Args:
        asking: What is driven and asked.
        envs: Environments.
        actors: Actors that share them out; 0: none, all are here.
        threads: Threads of the environments, in each actor.

    Raises:
        ValueError: More actors than environments.
        ImportError: Ray is not installed.
    """

    def __init__(self, asking: Asking, envs: int, actors: int, threads: int) -> None:
        if not 0 <= actors <= envs:
            raise ValueError(f"actors = {actors}: 0 to {envs}, an environment each")
        shares = max(actors, 1)
        edges = [envs * i // shares for i in range(shares + 1)]
        self.parts = [slice(*ends) for ends in itertools.pairwise(edges)]
        self.here: Asker | None = None
        self.actors: list[Any] = []
        if actors == 0:
            self.here = Asker(asking, 0, envs, threads)
            return
        # A call is a pure function, so one whose actor dies is made again, in a new process.
        remote = ray_module().remote(
            max_restarts=-1, max_task_retries=ATTEMPTS - 1, num_cpus=threads
        )(Asker)
        for part in self.parts:
            count = part.stop - part.start
            self.actors.append(remote.remote(asking, part.start, count, threads))

    def ask(self, draws: Draws, former: Files | None) -> States:
        """The states of a round, by question and then by environment."""
        if self.here is not None:
            found = [self.here.ask(draws, former)]
        else:
            ray = ray_module()
            shared = ray.put(former)
            calls = [
                actor.ask.remote(draws.part(part), shared)
                for actor, part in zip(self.actors, self.parts, strict=True)
            ]
            found = ray.get(calls)
        questions = [state for parts in zip(*found, strict=True) for state in parts]
        return _joined(questions)


def _joined(states: Sequence[States]) -> States:
    obs, worth, scenario = zip(*states, strict=True)
    return np.concatenate(obs), np.concatenate(worth), np.concatenate(scenario)
