"""The closed loop."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from tractrix import _native
from tractrix._arguments import MAX_U64, path, whole
from tractrix._state import SCENE_DTYPE, Decision, Ego


class World:
    """A truck on a road in traffic, driven by the planning stack; tick by tick or to the end.

    The words are those of `sim-server run`, and so are the results: the same scenario, changes and
    seed give the same bits.

    Args:
        scenario: Name of a built-in scenario (`tractrix.scenarios()`), a scenario file (`.toml`), or
            what `tractrix.scenario()` returned, changed.
        seed: Seed of everything that is drawn at random. Default: the manifest's or the
            scenario's, else 1.
        road: Another road: `.xodr`, `.csv`, `builtin:highway`, `builtin:highway-sag`,
            `builtin:test-site`, `builtin:flat`.
        truck: Another truck: a truck file or a built-in name.
        payload_kg: Another payload on the trailer, kg.
        traffic: The other vehicles: `native`, `sumo`, `replay:FILE` or `none`.
        mode: `pure` (does not see the ego), `inter` (reacts to it), `re` (a run again, with
            `manifest`), `rep` (recorded).
        manifest: File with the `manifest()` of the run that mode `re` repeats.
        on_traffic_failure: When the traffic source fails: `stop`, or `native` (the native engine
            goes on).
        decider: Who decides on lane changes: `keep`, `rules:50`, `rules:100`, `rules:150`, `mobil`,
            `rollout`, `external` (`request_lane_change`), `dqn`, or `dqn:FILE`.
        speed_planner: Who sets the reference speed: `cruise` or `predictive`.
        duration_s: Ends the run after this simulated time, s.

    Raises:
        ValueError: A word, key or value that cannot be used; the text names it.
        FileNotFoundError: A file that is not there.
        RuntimeError: SUMO is absent or does not start.

    Methods may be called from several threads; `step` and `run` let other threads go on.
    """

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Mapping[str, Any] = "highway",
        *,
        seed: int | None = None,
        road: str | os.PathLike[str] | None = None,
        truck: str | os.PathLike[str] | None = None,
        payload_kg: float | None = None,
        traffic: str | None = None,
        mode: str | None = None,
        manifest: str | os.PathLike[str] | None = None,
        on_traffic_failure: str | None = None,
        decider: str | None = None,
        speed_planner: str | None = None,
        duration_s: float | None = None,
    ) -> None:
        if isinstance(scenario, Mapping):
            name, keys = "", json.dumps(dict(scenario))
        else:
            name, keys = os.fspath(scenario), None
        self._native = _native.World(
            name,
            keys,
            seed=None if seed is None else whole("seed", seed),
            road=path(road),
            truck=path(truck),
            payload_kg=payload_kg,
            traffic=traffic,
            mode=mode,
            manifest=path(manifest),
            on_traffic_failure=on_traffic_failure,
            decider=decider,
            speed_planner=speed_planner,
            duration_s=duration_s,
        )

    def step(self, ticks: int = 1) -> str:
        """Drives `ticks` ticks of `tick_s`, fewer if the run ends before; returns `status`.

        A tick at time t reads the truck and the traffic at t, plans, and gives the command that acts
        until t + `tick_s`. After the end it does nothing.

        Raises `RuntimeError` when the run cannot go on: SUMO fails, a repeated run differs from its
        manifest, the truck's state is not finite; `status` is `failed` from then on.
        """
        return self._native.step(whole("ticks", ticks))

    def run(self) -> dict[str, Any]:
        """Drives to the end; returns `summary()`. Raises as `step`."""
        self._native.step(MAX_U64)
        return self.summary()

    @property
    def status(self) -> str:
        """`running`, `road_end`, `time_over` or `failed`."""
        return self._native.status()

    @property
    def time_s(self) -> float:
        """Time of the next tick, s since the start."""
        return self._native.time_s()

    @property
    def tick_s(self) -> float:
        """Tick, s."""
        return self._native.tick_s()

    @property
    def seed(self) -> int:
        """Seed of the run."""
        return self._native.seed()

    @property
    def road_length_m(self) -> float:
        """Length of the road, m."""
        return self._native.road_length_m()

    @property
    def ego(self) -> Ego:
        """The truck's true state at the last tick; before the first one, its start."""
        return Ego(**self._native.ego())  # type: ignore[arg-type]

    @property
    def decision(self) -> Decision | None:
        """What the stack decided in the last tick; None before the first one."""
        fields = self._native.decision()
        return None if fields is None else Decision(**fields)  # type: ignore[arg-type]

    def scene(self, *, truth: bool = False) -> npt.NDArray[np.void]:
        """The other vehicles at the last tick, one row each, sorted by `front_s_m`.

        A structured array with the columns of `tractrix.SCENE_DTYPE`; empty before the first tick.
        Where the scenario puts sensors between the traffic and the stack (`traffic.perception`), it
        is what the stack saw, or with `truth` the traffic as it is.
        """
        return np.frombuffer(self._native.scene(bool(truth)), dtype=SCENE_DTYPE)

    def show(self, vehicles: npt.NDArray[np.void]) -> None:
        """Puts vehicles that another simulator moves on the road, in place of those before.

        The world has to have no traffic of its own (`traffic="none"`). They stay where they are until
        the next are shown, so show them as often as the other simulator steps. What the truck then
        does to them is the other simulator's part, from `ego`.

        Args:
            vehicles: Rows of `SCENE_DTYPE`. `lane`, `target_lane`, `x_m`, `y_m` and `yaw_rad` are not
                read: they follow from the stations on this road; who is on none of its lanes is left
                out.

        Raises:
            ValueError: Another kind of array, traffic of its own, or a vehicle without a body.
        """
        if not isinstance(vehicles, np.ndarray) or vehicles.dtype != SCENE_DTYPE:
            raise ValueError("vehicles: an array of tractrix.SCENE_DTYPE")
        self._native.show(vehicles.tobytes())

    def summary(self) -> dict[str, Any]:
        """The figures so far, with the keys of `summary.json` of `sim-server run`.

        `end_reason` is None while the run goes on. `wall_time_s` and `tick_time_us` measure the ticks
        of this world alone.
        """
        found: dict[str, Any] = json.loads(self._native.summary())
        return found

    def manifest(self) -> str:
        """What is needed to repeat the traffic of this run (TOML): write it to a file for `re`."""
        return self._native.manifest()

    def scenario(self) -> dict[str, Any]:
        """The scenario that is driven, changes included."""
        found: dict[str, Any] = json.loads(self._native.scenario())
        return found

    def request_lane_change(self, to: str) -> None:
        """Wishes a lane change `left` or `right`, or `keep`; the safety gate decides.

        Raises `ValueError` for another word, or without the decider `external`.
        """
        self._native.request_lane_change(to)

    def snapshot(self) -> _native.Snapshot:
        """The whole state of the run, to go back to with `restore`.

        Raises `RuntimeError` in SUMO traffic: there is one SUMO.
        """
        return self._native.snapshot()

    def restore(self, snapshot: _native.Snapshot) -> None:
        """Goes back to a snapshot, of this world or another; it goes on bit for bit from there."""
        self._native.restore(snapshot)

    def close(self) -> None:
        """Ends the run and frees what belongs to it (SUMO). Later calls raise `ValueError`."""
        self._native.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        if self._native.closed():
            return "<tractrix.World closed>"
        name = self.scenario()["name"]
        return f"<tractrix.World {name}, seed {self.seed}, {self.time_s:.2f} s, {self.status}>"
