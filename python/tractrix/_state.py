"""What a world shows: the ego, the stack's decision, the other vehicles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Ego(NamedTuple):
    """The ego truck's true state at `time_s`, the time of the last tick.

    Positions and velocities are those of the reference point: the centre of the drive-axle group, on
    the ground.
    """

    time_s: float
    """Time of the state, s."""
    s_m: float
    """Station along the route, m."""
    d_m: float
    """Offset from the route's reference line, m, positive left."""
    speed_m_s: float
    """Longitudinal speed, m/s, body x."""
    lateral_speed_m_s: float
    """Lateral speed, m/s, body y."""
    accel_x_m_s2: float
    """Time derivative of `speed_m_s`, m/s2 (no gravity)."""
    accel_y_m_s2: float
    """Lateral acceleration, m/s2, body y (no gravity)."""
    yaw_rate_rad_s: float
    """Tractor yaw rate, rad/s."""
    x_m: float
    """Map x, m."""
    y_m: float
    """Map y, m."""
    z_m: float
    """Map z, m."""
    yaw_rad: float
    """Tractor heading, rad, counter-clockwise from map x, not wrapped."""
    articulation_rad: float
    """Trailer heading minus tractor heading, rad."""
    trailer_yaw_rate_rad_s: float
    """Trailer yaw rate, rad/s."""
    steering_wheel_rad: float
    """Hand-wheel angle, rad, positive left."""
    road_wheel_rad: float
    """Road-wheel angle, rad, positive left."""
    load_transfer_ratio: float
    """Lateral load transfer, -1 to 1; 1: all load on the right wheels."""
    gear: int
    """Engaged forward gear; 0: neutral."""
    shift_in_progress: bool
    """A shift is in progress."""
    engine_speed_rpm: float
    """Engine speed, 1/min."""
    engine_torque_nm: float
    """Indicated engine torque, Nm, before friction."""
    engine_power_w: float
    """Mechanical power at the crank, W."""
    drive_force_n: float
    """Traction force of the driveline at the wheels, N; negative under engine braking."""
    brake_force_n: float
    """Service brake force, N, positive slows."""
    brake_pressure_pa: float
    """Service brake pressure, Pa, mean over the axles."""
    retarder_force_n: float
    """Engine-brake and retarder force at the wheels, N, positive slows."""
    fuel_rate_g_s: float
    """Fuel mass flow, g/s."""
    fuel_used_g: float
    """Fuel used since the start, g."""


class Decision(NamedTuple):
    """What the planning stack decided in the last tick, and its command."""

    time_s: float
    """Time of the tick, s."""
    maneuver: str
    """`keep_lane`, `change_left`, `change_right`, `abort_change` or `minimal_risk`."""
    reason: str | None
    """Why a lane change is wished, driven or refused: `lane_ends`, `slower_ahead`, `keep_right`,
    `policy` or `requested`."""
    refusal: str | None
    """Why a lane change that was wished is not driven: `no_target_lane`, `unsafe_front`, ..."""
    speed_status: str
    """Speed planner: `cruise`, `solved`, `almost_solved`, `last_profile` or `fallback`."""
    reference_speed_m_s: float
    """Reference speed at the ego, m/s, before traffic."""
    target_speed_m_s: float
    """Speed that the controller follows, m/s, with traffic."""
    target_accel_m_s2: float
    """Acceleration that the controller follows, m/s2."""
    target_d_m: float
    """Offset from the reference line that the controller follows, m, positive left."""
    lateral_error_m: float
    """Offset of the reference point from the planned path, m, positive left."""
    lane: int
    """Lane track that the ego is in or leaves."""
    following: int | None
    """`id` of the vehicle that is followed."""
    guard: list[str]
    """What the guard changed in the command: `range`, `rate`, `headway`, ...; mostly nothing."""
    accelerator_pedal_frac: float
    """Accelerator pedal, 0 to 1."""
    xbr_decel_m_s2: float
    """Requested deceleration, m/s2, positive slows."""
    steering_wheel_rad: float
    """Requested hand-wheel angle, rad, positive left."""
    retarder_frac: float
    """Engine-brake and retarder demand, 0 to 1 of the available torque."""


SCENE_DTYPE = np.dtype(
    [
        ("id", "<u8"),
        ("class", "<U9"),
        ("front_s_m", "<f8"),
        ("rear_s_m", "<f8"),
        ("d_m", "<f8"),
        ("width_m", "<f8"),
        ("speed_m_s", "<f8"),
        ("lateral_speed_m_s", "<f8"),
        ("accel_m_s2", "<f8"),
        ("lane", "<i4"),
        ("target_lane", "<i4"),
        ("x_m", "<f8"),
        ("y_m", "<f8"),
        ("yaw_rad", "<f8"),
    ]
)
"""Columns of `World.scene()`.

`id` is stable within a run; `class` is `car`, `van`, `truck`, `emergency` or `barrier`; `front_s_m` and `rear_s_m` are the
stations of the bumpers, so that a gap is a subtraction; `d_m` is the offset of the centre line from
the reference line, positive left; speeds and acceleration are along the road, `lateral_speed_m_s` to
the left; `target_lane` is -1 without a lane change; `x_m`, `y_m`, `yaw_rad` are the centre of the body
in the map frame.
"""
