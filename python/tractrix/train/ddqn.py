"""Double DQN for lane changes (van Hasselt et al. 2016), with the paper's network and settings.

    python -m tractrix.train.ddqn --out runs/ddqn --seed 1

`ours` decides once a second under the gate's mask. A transition leads from one choice to a later one:
seconds in which the gate leaves nothing but to keep are no decisions, their reward counts where the
choice was made, discounted by its time (a semi-Markov decision process). `paper` decides at 10 Hz
without mask by Eq. 17.

Training goes in rounds of one episode per environment. Rounds begin with seeds of their own, so a
training that goes on from the checkpoint of a round ends with the same bits as one that was never
stopped. The same seed gives the same weights, whatever the number of environment threads.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from tractrix import VectorEnv
from tractrix.evaluate.drive import TABLE2, drive
from tractrix.train._command import command
from tractrix.train.device import device_of
from tractrix.train.export import export
from tractrix.train.network import QNetwork

Array = npt.NDArray[Any]
VALIDATION_SEED = 1_000_000
"""First seed of the validation; those of the training are 64 random bits."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """What a training depends on."""

    spec: str = "ours"
    """`ours` or `paper`: observation, reward and rate of decisions."""
    scenarios: tuple[str, ...] = TABLE2
    """Scenarios, taken by the environments in turn."""
    seed: int = 1
    """Seed of weights, exploration, replay and traffic."""
    rounds: int = 40
    """Rounds of one episode per environment."""
    envs: int = 48
    """Environments."""
    episode_s: float = 300.0
    """Length of an episode, s."""
    updates_per_step: int = 4
    """Updates after each step of all environments."""
    batch: int = 64
    """Transitions in an update."""
    learning_rate: float = 5e-4
    """Adam's step at the beginning; it falls to a twentieth on a cosine."""
    discount_frac_s: float = 0.99
    """What is left of a reward's worth after a second."""
    n_step: int = 3
    """Choices between the two ends of a transition."""
    target_every: int = 500
    """Updates between two copies of the network to its target."""
    replay: int = 50_000
    """Transitions that are remembered."""
    warm_up: int = 5_000
    """Transitions before the first update."""
    explore_last_frac: float = 0.03
    """Share of random actions after the first third of the rounds; it begins with 1."""
    validate_every: int = 5
    """Rounds between two validations."""
    validation_seeds: int = 4
    """Episodes of each scenario in a validation."""
    device: str = "cpu"
    """PyTorch's device that the network is fitted on. Another device rounds otherwise."""


class Replay:
    """A ring of transitions."""

    def __init__(self, capacity: int, size: int) -> None:
        self.rows: dict[str, Array] = {
            "obs": np.zeros((capacity, size), np.float32),
            "action": np.zeros(capacity, np.int64),
            "reward": np.zeros(capacity, np.float32),
            "discount": np.zeros(capacity, np.float32),
            "next_obs": np.zeros((capacity, size), np.float32),
            "next_mask": np.zeros((capacity, 3), np.bool_),
        }
        self.capacity, self.written = capacity, 0

    def __len__(self) -> int:
        return min(self.written, self.capacity)

    def add(self, *values: Any) -> None:
        """One transition, in the order of the rows."""
        at = self.written % self.capacity
        for rows, value in zip(self.rows.values(), values, strict=True):
            rows[at] = value
        self.written += 1

    def sample(self, rng: np.random.Generator, count: int) -> dict[str, torch.Tensor]:
        """Transitions at random."""
        at = rng.integers(len(self), size=count)
        return {name: torch.from_numpy(rows[at]) for name, rows in self.rows.items()}


class Choices:
    """Makes transitions of `n` choices out of steps."""

    def __init__(self, envs: int, n: int, discount: float, replay: Replay) -> None:
        self.n, self.discount, self.replay = n, discount, replay
        self.open: list[deque[list[Any]]] = [deque() for _ in range(envs)]

    def made(self, obs: Array, actions: Array, free: Array) -> None:
        """Actions chosen where something else was possible."""
        for i in np.flatnonzero(free):
            self.open[i].append([obs[i], actions[i], 0.0, 1.0])

    def earned(
        self,
        reward: Array,
        terminated: Array,
        truncated: Array,
        obs: Array,
        mask: Array,
        free: Array,
    ) -> None:
        """What the step brought. After a collision nothing comes; what time cut short is forgotten."""
        for i, open_ in enumerate(self.open):
            for choice in open_:
                choice[2] += choice[3] * reward[i]
                choice[3] *= self.discount
            if terminated[i]:
                for seen, action, earned, _ in open_:
                    self.replay.add(seen, action, earned, 0.0, obs[i], mask[i])
            if terminated[i] or truncated[i]:
                open_.clear()
            elif free[i] and len(open_) >= self.n:
                self.replay.add(*open_.popleft(), obs[i], mask[i])


class Learner:
    """Network, target and optimiser."""

    def __init__(self, size: int, settings: Settings) -> None:
        self.device = device_of(settings.device)
        torch.manual_seed(settings.seed)
        self.online = QNetwork(size).to(self.device)
        self.target = QNetwork(size).to(self.device)
        self.target.load_state_dict(self.online.state_dict())
        self.optimiser = torch.optim.Adam(
            self.online.parameters(), settings.learning_rate
        )
        self.settings, self.updates = settings, 0

    def begin_at(self, value: float) -> None:
        """Lets every value begin near what is earned, not at zero far from it."""
        for network in (self.online, self.target):
            *_, bias = network.parameters()
            torch.nn.init.constant_(bias, value)

    def act(self, obs: Array, mask: Array) -> Array:
        """The best allowed actions."""
        with torch.no_grad():
            values = self.online(torch.from_numpy(obs).to(self.device)).cpu().numpy()
        best: Array = np.where(mask, values, -np.inf).argmax(axis=1)
        return best

    def update(self, rows: dict[str, torch.Tensor], progress_frac: float) -> float:
        """One step of Adam; returns the loss."""
        lowest = 0.05
        share = lowest + (1 - lowest) * 0.5 * (1 + np.cos(np.pi * progress_frac))
        for group in self.optimiser.param_groups:
            group["lr"] = self.settings.learning_rate * float(share)
        rows = {name: values.to(self.device) for name, values in rows.items()}
        with torch.no_grad():
            # Double: the network chooses, its target says what the choice is worth.
            ahead = self.online(rows["next_obs"])
            best = ahead.masked_fill(~rows["next_mask"], -torch.inf).argmax(1, True)
            worth = self.target(rows["next_obs"]).gather(1, best)[:, 0]
            wanted = rows["reward"] + rows["discount"] * worth
        is_ = self.online(rows["obs"]).gather(1, rows["action"][:, None])[:, 0]
        loss = torch.nn.functional.smooth_l1_loss(is_, wanted)
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.online.parameters(), 10.0)
        self.optimiser.step()
        self.updates += 1
        if self.updates % self.settings.target_every == 0:
            self.target.load_state_dict(self.online.state_dict())
        return float(loss.detach())


class Training:
    """A training and its files in `out`.

    Args:
        settings: What it depends on.
        out: Folder of `checkpoint.pt`, `curve.json` and the best `policy.safetensors`.
        threads: Threads of the environments.
        resume: Go on from the checkpoint in `out`.
        tensorboard: Also write events for TensorBoard.
    """

    def __init__(
        self,
        settings: Settings,
        out: Path,
        *,
        threads: int = 1,
        resume: bool = False,
        tensorboard: bool = False,
    ) -> None:
        self.settings, self.out, self.threads = settings, out, threads
        self.env = VectorEnv(
            settings.envs,
            settings.scenarios,
            spec=settings.spec,
            episode_s=settings.episode_s,
            threads=threads,
        )
        size = int(np.prod(self.env.single_observation_space.shape or ()))
        self.learner = Learner(size, settings)
        self.replay = Replay(settings.replay, size)
        self.rng = np.random.default_rng(settings.seed)
        self.round, self.best, self.cpu_s = 0, -np.inf, 0.0
        self.curve: list[dict[str, float]] = []
        self.steps = round(settings.episode_s / (1.0 if self.masked else 0.1))
        self.events: Any = None
        out.mkdir(parents=True, exist_ok=True)
        if resume:
            self._load()
        if tensorboard:
            from torch.utils.tensorboard import SummaryWriter

            self.events = SummaryWriter(out)

    @property
    def masked(self) -> bool:
        """Whether the gate's mask is obeyed."""
        return self.settings.spec == "ours"

    def run(self, until: int | None = None) -> None:
        """Trains to the last round, or to `until`."""
        last = self.settings.rounds if until is None else until
        while self.round < last:
            started_s = time.process_time() - self.cpu_s
            row = self._one_round()
            self.round += 1
            due = self.round % self.settings.validate_every == 0
            if due or self.round == self.settings.rounds:
                row |= self._validate()
            self.cpu_s = time.process_time() - started_s
            self._tell({"round": self.round, **row, "cpu_s": self.cpu_s})
            if due or self.round == last:
                self._save()

    def _mask(self, mask: Array) -> Array:
        return mask.astype(np.bool_) if self.masked else np.ones(mask.shape, np.bool_)

    def _one_round(self) -> dict[str, float]:
        settings, rng, learner = self.settings, self.rng, self.learner
        discount = settings.discount_frac_s ** (settings.episode_s / self.steps)
        choices = Choices(settings.envs, settings.n_step, discount, self.replay)
        seeds = rng.integers(2**63, size=settings.envs).tolist()
        obs, infos = self.env.reset(seed=seeds)
        mask = self._mask(infos["action_mask"])
        losses: list[float] = []
        earned, changes = 0.0, 0
        for step in range(self.steps):
            progress = (self.round + step / self.steps) / settings.rounds
            explore = max(settings.explore_last_frac, 1.0 - 3.0 * progress)
            free = mask.sum(axis=1) > 1
            noise = np.where(mask, rng.random(mask.shape), -1.0).argmax(axis=1)
            random = rng.random(settings.envs) < explore
            actions = np.where(random, noise, learner.act(obs, mask))
            choices.made(obs, actions, free)
            obs, reward, terminated, truncated, infos = self.env.step(actions)
            mask = self._mask(infos["action_mask"])
            free = mask.sum(axis=1) > 1
            choices.earned(reward, terminated, truncated, obs, mask, free)
            earned, changes = earned + reward.sum(), changes + int((actions != 1).sum())
            if len(self.replay) < settings.warm_up:
                continue
            if learner.updates == 0:
                rows = {k: v[: len(self.replay)] for k, v in self.replay.rows.items()}
                learner.begin_at(
                    float((rows["reward"] / (1 - rows["discount"])).mean())
                )
            for _ in range(settings.updates_per_step):
                sample = self.replay.sample(rng, settings.batch)
                losses.append(learner.update(sample, progress))
        return {
            "updates": float(learner.updates),
            "explore_frac": float(explore),
            "loss": float(np.mean(losses)) if losses else float("nan"),
            "reward_frac": float(earned / (settings.envs * settings.episode_s)),
            "changes": changes / settings.envs,
        }

    def _validate(self) -> dict[str, float]:
        """Drives without exploration; the best so far is exported."""
        settings = self.settings
        seeds = range(VALIDATION_SEED, VALIDATION_SEED + settings.validation_seeds)
        figures = drive(
            lambda _, obs, mask: self.learner.act(obs, self._mask(mask)),
            settings.scenarios,
            seeds,
            spec=settings.spec,
            episode_s=settings.episode_s,
            threads=self.threads,
        )
        found = {
            f"valid_{name}": float(figures[name].mean())
            for name in ("reward_s", "delta_speed_frac", "lane_changes", "collided")
        }
        if found["valid_reward_s"] > self.best:
            self.best = found["valid_reward_s"]
            export(
                self.learner.online,
                self.out / "policy.safetensors",
                spec=settings.spec,
                seeds=[settings.seed],
                training={
                    "trainer": "ddqn",
                    "settings": dataclasses.asdict(settings),
                    "round": self.round,
                    "updates": self.learner.updates,
                },
                evaluation={"seeds": list(seeds), **found},
            )
        return found

    def _tell(self, row: dict[str, float]) -> None:
        if not self.curve:
            print(" ".join(f"{name:>13.13}" for name in row), file=sys.stderr)
        self.curve.append(row)
        print(" ".join(f"{value:13.4g}" for value in row.values()), file=sys.stderr)
        (self.out / "curve.json").write_text(json.dumps(self.curve, indent=1) + "\n")
        if self.events is not None:
            for name, value in row.items():
                self.events.add_scalar(name, value, self.round)

    def _save(self) -> None:
        """Everything that the next round depends on; the old file stays until the new one is whole."""
        used = len(self.replay)
        state = {
            "settings": dataclasses.asdict(self.settings),
            "online": self.learner.online.state_dict(),
            "target": self.learner.target.state_dict(),
            "optimiser": self.learner.optimiser.state_dict(),
            "updates": self.learner.updates,
            "replay": {
                k: torch.from_numpy(v[:used]) for k, v in self.replay.rows.items()
            },
            "written": self.replay.written,
            "rng": self.rng.bit_generator.state,
            "round": self.round,
            "best": float(self.best),
            "curve": self.curve,
            "cpu_s": self.cpu_s,
        }
        torch.save(state, self.out / "checkpoint.new")
        (self.out / "checkpoint.new").replace(self.out / "checkpoint.pt")

    def _load(self) -> None:
        state = torch.load(
            self.out / "checkpoint.pt", map_location="cpu", weights_only=True
        )
        if state["settings"] != dataclasses.asdict(self.settings):
            raise ValueError(f"{self.out}: the checkpoint was trained otherwise")
        self.learner.online.load_state_dict(state["online"])
        self.learner.target.load_state_dict(state["target"])
        self.learner.optimiser.load_state_dict(state["optimiser"])
        self.learner.updates = state["updates"]
        for name, rows in state["replay"].items():
            self.replay.rows[name][: len(rows)] = rows.numpy()
        self.replay.written = state["written"]
        self.rng.bit_generator.state = state["rng"]
        self.round, self.best = state["round"], state["best"]
        self.curve, self.cpu_s = state["curve"], state["cpu_s"]


def main() -> None:
    """The command line."""
    command("ddqn", "Trains a lane-change policy by double DQN.", Settings, Training)


if __name__ == "__main__":
    main()
