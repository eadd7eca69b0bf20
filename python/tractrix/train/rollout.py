"""The default agent: a network fitted to what rollouts of the engine say a lane change is worth.

    python -m tractrix.train.rollout --out runs/rollout --seed 1

drives the six `table2-*` scenarios, asks in states with an open gate for the advantage of each change
over keeping (`VectorEnv.advantages`) and regresses the network on it, keep being 0. The rollouts are
with the true drivers: the teacher may know what the network cannot see. From the second round on the
former network decides in the rollouts and on the road: policy iteration. The best network on the
validation seeds is exported.

A round begins with seeds of its own, so a training that goes on from the checkpoint of a round ends
with the same bits as one that was never stopped. The same seed gives the same weights, whatever the
number of environment threads, and of actors on a Ray cluster (`asking`).
"""

from __future__ import annotations

import copy
import dataclasses
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from tractrix import _native
from tractrix.evaluate.drive import TABLE2, drive
from tractrix.train._command import command
from tractrix.train.asking import Asking, Draws, Team
from tractrix.train.device import device_of
from tractrix.train.export import encoded, export
from tractrix.train.margin import with_margins
from tractrix.train.network import QNetwork

Array = npt.NDArray[Any]
VALIDATION_SEED = 1_000_000
"""First seed of the validation; those of the training are 64 random bits."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """What a training depends on."""

    scenarios: tuple[str, ...] = TABLE2
    """Scenarios; each weighs the same, however often its gate is open."""
    seed: int = 1
    """Seed of weights, exploration, order of the states and traffic."""
    rounds: int = 5
    """Rounds: drive and ask, then fit."""
    first_base: str = "mobil"
    """Who decides in the first round, in the rollouts and on the road: `mobil` and the like, or `dqn`,
    `dqn:FILE` to go on from a policy."""
    envs: int = 288
    """Environments."""
    episode_s: float = 300.0
    """Length of an episode, s."""
    decisions: int = 400
    """Decisions that each environment drives in a round."""
    ask_every: int = 4
    """Decisions between two questions: states side by side are alike."""
    explore_frac: float = 0.15
    """Share of the decisions that are drawn among those that the gate passes."""
    horizon_s: float = 40.0
    """Length of a rollout, s."""
    discount_frac_s: float = 0.99
    """What is left of a reward's worth after a second."""
    change_cost_s: float = 0.25
    """What a change costs in the reward, s, in the rollouts too: there every change that comes later
    pays it as well, so nothing is gained by putting one off."""
    company_s: float = 0.28
    """What a change has to gain for each vehicle beside the first that the newest frame shows, s
    (`with_margins`): of who decides in the rollouts, on the road, in validations, and of the export."""
    epochs: int = 30
    """Passes over the states in a round."""
    batch: int = 256
    """States in an update."""
    learning_rate: float = 1e-3
    """Adam's step at the beginning of a round; it falls to a twentieth on a cosine."""
    most_s: float = 3.0
    """Advantages are cut here, s: how bad the worst change is does not matter."""
    validate_every: int = 10
    """Epochs between two validations."""
    validation_seeds: int = 16
    """Episodes of each scenario in a validation."""
    average_frac: float = 0.999
    """What an update leaves of the running mean of the weights, which is what decides and goes on;
    0: the weights themselves."""
    device: str = "cpu"
    """PyTorch's device that the network is fitted on. Another device rounds otherwise."""


class Training:
    """A training and its files in `out`.

    Args:
        settings: What it depends on.
        out: Folder of `checkpoint.pt`, `curve.json` and the best `policy.safetensors`.
        threads: Threads of the environments, in each actor.
        actors: Actors of a Ray cluster that drive and ask; 0: this process does. Same bits.
        resume: Go on from the checkpoint in `out`.
        tensorboard: Also write events for TensorBoard.
    """

    def __init__(
        self,
        settings: Settings,
        out: Path,
        *,
        threads: int = 1,
        actors: int = 0,
        resume: bool = False,
        tensorboard: bool = False,
    ) -> None:
        self.device = device_of(settings.device)
        torch.manual_seed(settings.seed)
        self.settings, self.out, self.threads = settings, out, threads
        given = dataclasses.asdict(settings)
        names = [field.name for field in dataclasses.fields(Asking)]
        asking = Asking(**{name: given[name] for name in names})
        self.team = Team(asking, settings.envs, actors, threads)
        size = _native.observation_size("ours")
        self.network = QNetwork(size).to(self.device)
        self.obs = np.zeros((0, size), np.float32)
        self.worth = np.zeros((0, 3), np.float32)
        self.scenario = np.zeros(0, np.int64)
        self.round, self.best, self.cpu_s = 0, -np.inf, 0.0
        self.curve: list[dict[str, float]] = []
        self.events: Any = None
        out.mkdir(parents=True, exist_ok=True)
        if resume:
            self._load()
        if tensorboard:
            from torch.utils.tensorboard import SummaryWriter

            self.events = SummaryWriter(out)

    def run(self, until: int | None = None) -> None:
        """Trains to the last round, or to `until`."""
        last = self.settings.rounds if until is None else until
        while self.round < last:
            self._began_s = time.process_time() - self.cpu_s
            rng = np.random.default_rng([self.settings.seed, self.round])
            self._ask(rng)
            self._fit(rng)
            self.round += 1
            self._save()

    @property
    def policy(self) -> QNetwork:
        """The network with its margin, as it decides: on the CPU."""
        return with_margins(self.network, company_s=self.settings.company_s)

    def act(self, obs: Array, mask: Array) -> Array:
        """The best of what the gate passes."""
        return self._best(self.policy, obs, mask)

    @staticmethod
    def _best(policy: QNetwork, obs: Array, mask: Array) -> Array:
        with torch.no_grad():
            values = policy(torch.from_numpy(obs)).numpy()
        best: Array = np.where(mask, values, -np.inf).argmax(axis=1)
        return best

    def _ask(self, rng: np.random.Generator) -> None:
        """Drives, and adds states with what changes are worth there."""
        draws = Draws.of(rng, self.settings.decisions, self.settings.envs)
        former = encoded(self.policy, spec="ours") if self.round > 0 else None
        obs, worth, scenario = self.team.ask(draws, former)
        self.obs = np.concatenate([self.obs, obs])
        self.worth = np.concatenate([self.worth, worth])
        self.scenario = np.concatenate([self.scenario, scenario])

    def _fit(self, rng: np.random.Generator) -> None:
        """Regresses the network on all states so far."""
        settings, count = self.settings, len(self.obs)
        share = np.bincount(self.scenario, minlength=len(settings.scenarios)) / count
        weight = 1.0 / (share[self.scenario] * np.count_nonzero(share))
        worth = np.nan_to_num(self.worth).clip(-settings.most_s, settings.most_s)
        obs, wanted = self._there(self.obs), self._there(worth)
        known = self._there(~np.isnan(self.worth))
        weights = self._there(weight.astype(np.float32))[:, None] * known
        fitted = copy.deepcopy(self.network)
        adam = torch.optim.Adam(fitted.parameters(), settings.learning_rate)
        updates = settings.epochs * -(-count // settings.batch)
        done = 0
        for epoch in range(1, settings.epochs + 1):
            loss_sum = torch.zeros((), dtype=torch.float64, device=self.device)
            for at in self._there(rng.permutation(count)).split(settings.batch):
                falls = 0.05 + 0.95 * 0.5 * (1.0 + np.cos(np.pi * done / updates))
                adam.param_groups[0]["lr"] = settings.learning_rate * float(falls)
                loss = torch.nn.functional.smooth_l1_loss(
                    fitted(obs[at]), wanted[at], reduction="none"
                )
                loss = (loss * weights[at]).sum() / weights[at].sum()
                adam.zero_grad()
                loss.backward()
                adam.step()
                done += 1
                self._follow(fitted, done)
                loss_sum += loss.detach() * len(at)
            if epoch % settings.validate_every == 0 or epoch == settings.epochs:
                self._tell(epoch, float(loss_sum) / count, self._validate())

    def _there(self, values: Array) -> torch.Tensor:
        return torch.from_numpy(values).to(self.device)

    def _follow(self, fitted: QNetwork, updates: int) -> None:
        """Lets the weights that decide follow those that are fitted, the first ones closely."""
        kept = min(self.settings.average_frac, updates / (updates + 9.0))
        with torch.no_grad():
            pairs = zip(self.network.parameters(), fitted.parameters(), strict=True)
            for mean, value in pairs:
                mean.lerp_(value, 1.0 - kept)

    def _validate(self) -> dict[str, float]:
        """Drives without exploration; the best so far is exported."""
        settings, policy = self.settings, self.policy
        seeds = range(VALIDATION_SEED, VALIDATION_SEED + settings.validation_seeds)
        figures = drive(
            lambda _, obs, mask: self._best(policy, obs, mask.astype(np.bool_)),
            settings.scenarios,
            seeds,
            episode_s=settings.episode_s,
            change_cost_s=settings.change_cost_s,
            threads=self.threads,
        )
        found = {
            f"valid_{name}": float(figures[name].mean())
            for name in ("reward_s", "delta_speed_frac", "lane_changes", "collided")
        }
        if found["valid_reward_s"] > self.best:
            self.best = found["valid_reward_s"]
            export(
                policy,
                self.out / "policy.safetensors",
                spec="ours",
                seeds=[settings.seed],
                training={
                    "trainer": "rollout",
                    "settings": dataclasses.asdict(settings),
                    "round": self.round + 1,
                    "states": len(self.obs),
                },
                evaluation={"seeds": list(seeds), **found},
            )
        return found

    def _tell(self, epoch: int, loss: float, found: dict[str, float]) -> None:
        self.cpu_s = time.process_time() - self._began_s
        row = {"round": float(self.round + 1), "states": float(len(self.obs))}
        row |= {"epoch": float(epoch), "loss": loss, **found, "cpu_s": self.cpu_s}
        if not self.curve:
            print(" ".join(f"{name:>13.13}" for name in row), file=sys.stderr)
        self.curve.append(row)
        print(" ".join(f"{value:13.5g}" for value in row.values()), file=sys.stderr)
        (self.out / "curve.json").write_text(json.dumps(self.curve, indent=1) + "\n")
        if self.events is not None:
            for name, value in row.items():
                self.events.add_scalar(name, value, len(self.curve))

    def _save(self) -> None:
        """Everything that the next round depends on; the old file stays until the new one is whole."""
        state = {
            "settings": dataclasses.asdict(self.settings),
            "network": self.network.state_dict(),
            "obs": torch.from_numpy(self.obs),
            "worth": torch.from_numpy(self.worth),
            "scenario": torch.from_numpy(self.scenario),
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
        of = dataclasses.asdict(self.settings)
        if state["settings"] | {"rounds": of["rounds"]} != of:
            raise ValueError(f"{self.out}: the checkpoint was trained otherwise")
        self.network.load_state_dict(state["network"])
        self.obs, self.worth = state["obs"].numpy(), state["worth"].numpy()
        self.scenario = state["scenario"].numpy()
        self.round, self.best = state["round"], state["best"]
        self.curve, self.cpu_s = state["curve"], state["cpu_s"]


def main() -> None:
    """The command line."""
    command(
        "rollout",
        "Trains a lane-change policy on rollout advantages.",
        Settings,
        Training,
        scales=True,
    )


if __name__ == "__main__":
    main()
