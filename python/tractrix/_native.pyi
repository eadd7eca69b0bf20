"""The native half of the package; see `python/src`. Not for users."""

from typing import Any, Self

import numpy as np
import numpy.typing as npt

VERSION: str
GIT_REVISION: str

def scenario_list() -> list[tuple[str, str]]: ...
def scenario_json(name: str) -> str: ...
def diagnose_json(
    truck: str,
    drives: str,
    *,
    baseline: str | None,
    hold_out: list[str],
    table_effect: bool,
    seed: int,
    out: str | None,
) -> str: ...
def drives_from_logs(
    logs: list[str],
    named: list[str],
    masses_kg: list[float | None],
    *,
    truck: str,
    out: str,
    map: str | None,
    start_s_m: float | None,
    dbc: str | None,
    signals: list[str],
    standstill_s: float,
    min_drive_s: float,
    overwrite: bool,
) -> str: ...
def plan_json(
    truck: str,
    road: str,
    *,
    mass_kg: float,
    set_speed_m_s: float,
    speed_min_m_s: float,
    speed_max_m_s: float,
    trip_time_s: float | None,
    eco_roll: bool,
) -> tuple[str, bytes]: ...
def plan_columns() -> list[str]: ...
def observation_hash(spec: str) -> str: ...
def observation_size(spec: str) -> int: ...

class Policy:
    def __new__(cls, file: str) -> Self: ...
    def sidecar(self) -> str: ...
    def spec(self) -> str: ...
    def observation_size(self) -> int: ...
    def values(
        self, observations: npt.NDArray[np.float32], out: npt.NDArray[np.float32]
    ) -> None: ...

class Snapshot: ...

class TruckModel:
    def __new__(cls, truck: str, *, payload_kg: float) -> Self: ...
    def about(self) -> tuple[str, float]: ...
    def reset(
        self, x_m: float, y_m: float, yaw_rad: float, speed_m_s: float
    ) -> None: ...
    def step(
        self,
        duration_s: float,
        *,
        accelerator_pedal_frac: float,
        xbr_decel_m_s2: float,
        steering_wheel_rad: float,
        retarder_frac: float,
        gear: int | None,
        grade_rad: float,
        bank_rad: float,
        wind_x_m_s: float,
        wind_y_m_s: float,
        air_temperature_k: float,
        air_pressure_pa: float,
        altitude_m: float,
        adhesion_coeff: float,
    ) -> None: ...
    def state(self) -> dict[str, Any]: ...
    def copy(self) -> TruckModel: ...

class Batch:
    def __new__(
        cls,
        count: int,
        scenarios: list[tuple[str, str | None]],
        *,
        road: str | None,
        seed: int,
        fidelity: str,
        spec: str,
        episode_s: float,
        start_spread_m: float,
        window_m: tuple[float, float] | None,
        awake_m: float | None,
        change_cost_s: float | None,
        threads: int,
    ) -> Self: ...
    def observation_size(self) -> int: ...
    def reset(self, seeds: list[int | None], which: list[bool]) -> None: ...
    def step(self, actions: npt.NDArray[np.uint8]) -> None: ...
    def read(
        self,
        obs: npt.NDArray[np.float32],
        mask: npt.NDArray[np.uint8],
        reward: npt.NDArray[np.float32],
        terminated: npt.NDArray[np.uint8],
        truncated: npt.NDArray[np.uint8],
        final_obs: npt.NDArray[np.float32],
    ) -> None: ...
    def advantages(
        self,
        out: npt.NDArray[np.float32],
        *,
        base: str,
        horizon_s: float,
        rollouts: int,
        discount_frac_s: float,
        drivers: str,
    ) -> None: ...
    def wishes(self, decider: str, out: npt.NDArray[np.uint8]) -> None: ...
    def episodes(self) -> list[tuple[int, list[float]]]: ...
    @staticmethod
    def figures() -> list[str]: ...
    def close(self) -> None: ...

class World:
    def __new__(
        cls,
        name: str,
        json: str | None,
        *,
        seed: int | None,
        road: str | None,
        truck: str | None,
        payload_kg: float | None,
        traffic: str | None,
        mode: str | None,
        manifest: str | None,
        on_traffic_failure: str | None,
        decider: str | None,
        speed_planner: str | None,
        duration_s: float | None,
    ) -> Self: ...
    def step(self, ticks: int) -> str: ...
    def status(self) -> str: ...
    def time_s(self) -> float: ...
    def tick_s(self) -> float: ...
    def seed(self) -> int: ...
    def road_length_m(self) -> float: ...
    def ego(self) -> dict[str, float]: ...
    def decision(self) -> dict[str, object] | None: ...
    def scene(self, truth: bool) -> bytes: ...
    def show(self, rows: bytes) -> None: ...
    def summary(self) -> str: ...
    def manifest(self) -> str: ...
    def scenario(self) -> str: ...
    def request_lane_change(self, to: str) -> None: ...
    def snapshot(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...
    def close(self) -> None: ...
    def closed(self) -> bool: ...
