"""The fuel-optimal speed profile of a whole trip."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from tractrix import _native


def plan(
    truck: str | os.PathLike[str],
    road: str | os.PathLike[str],
    *,
    mass_kg: float,
    set_speed_m_s: float,
    speed_min_m_s: float,
    speed_max_m_s: float,
    trip_time_s: float | None = None,
    eco_roll: bool = False,
) -> dict[str, Any]:
    """Plans a trip against both cruise-control baselines, as `sim-server plan`.

    Args:
        truck: A truck file, or a built-in name.
        road: An `.xodr` or `.csv` file, or a built-in road.
        mass_kg: Total mass.
        set_speed_m_s: Set speed: at both ends, and of the cruise controls.
        speed_min_m_s: Lowest speed.
        speed_max_m_s: Highest speed.
        trip_time_s: Longest duration. Default: that of the set-speed cruise control.
        eco_roll: Lets coasting phases open the driveline.

    Returns:
        The contents of `plan.json`, and `profile`: the columns of `plan.csv` as arrays, one number per
        node of the road (`s_m`, `v_m_s`, `time_s`, `gear`, `drive_force_n`, `brake_force_n`, `fuel_g`,
        `grade_rad`); forces, gear and grade are those of the interval that begins there.

    Raises:
        ValueError: A word or value that cannot be used, or a trip that the truck cannot drive; the
            text says why.
        FileNotFoundError: A file that is not there.

    Other Python threads go on meanwhile.
    """
    text, rows = _native.plan_json(
        os.fspath(truck),
        os.fspath(road),
        mass_kg=mass_kg,
        set_speed_m_s=set_speed_m_s,
        speed_min_m_s=speed_min_m_s,
        speed_max_m_s=speed_max_m_s,
        trip_time_s=trip_time_s,
        eco_roll=bool(eco_roll),
    )
    planned: dict[str, Any] = json.loads(text)
    columns = _native.plan_columns()
    table = np.frombuffer(rows, np.float64).reshape(-1, len(columns))
    planned["profile"] = {
        name: table[:, i].astype(np.int64 if name == "gear" else np.float64)
        for i, name in enumerate(columns)
    }
    return planned
