"""The truck's dynamics on their own."""

from __future__ import annotations

import os
from typing import Self

from tractrix import _native
from tractrix._state import Ego


class TruckModel:
    """A truck that drives what the pedals, the steering wheel and the road make of it.

    The model is that of `tractrix.World`, without a road, a stack and traffic: the same inputs give
    the same bits.

        truck = tractrix.TruckModel("reference", payload_kg=20_000, speed_m_s=20)
        for _ in range(100):
            truck.step(0.1, accelerator_pedal_frac=0.6, grade_rad=0.02)
        print(truck.state.speed_m_s, truck.state.fuel_used_g)

    Args:
        truck: A truck file (`.toml`), or a built-in name.
        payload_kg: Payload on the trailer by the load sheet, kg.
        speed_m_s: Speed at the start, m/s, 0 to 60; in a gear that fits it.
        x_m: Map x of the reference point at the start, m.
        y_m: Map y, m.
        yaw_rad: Heading, rad, counter-clockwise from map x.

    Raises:
        ValueError: A name, key or value that cannot be used; the text names it.
        FileNotFoundError: A file that is not there.
    """

    def __init__(
        self,
        truck: str | os.PathLike[str] = "reference",
        *,
        payload_kg: float = 0.0,
        speed_m_s: float = 0.0,
        x_m: float = 0.0,
        y_m: float = 0.0,
        yaw_rad: float = 0.0,
    ) -> None:
        self._native = _native.TruckModel(os.fspath(truck), payload_kg=payload_kg)
        self.reset(speed_m_s=speed_m_s, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)

    def reset(
        self,
        *,
        speed_m_s: float = 0.0,
        x_m: float = 0.0,
        y_m: float = 0.0,
        yaw_rad: float = 0.0,
    ) -> None:
        """Begins anew at time 0: straight, rolling at `speed_m_s`, tyres and brakes cold."""
        self._native.reset(x_m, y_m, yaw_rad, speed_m_s)

    def step(
        self,
        duration_s: float,
        *,
        accelerator_pedal_frac: float = 0.0,
        xbr_decel_m_s2: float = 0.0,
        steering_wheel_rad: float = 0.0,
        retarder_frac: float = 0.0,
        gear: int | None = None,
        grade_rad: float = 0.0,
        bank_rad: float = 0.0,
        wind_x_m_s: float = 0.0,
        wind_y_m_s: float = 0.0,
        air_temperature_k: float = 288.15,
        air_pressure_pa: float = 101_325.0,
        altitude_m: float = 0.0,
        adhesion_coeff: float = 0.8,
    ) -> Ego:
        """Holds the inputs for a time, and returns the state after it.

        Args:
            duration_s: A multiple of 0.005 s, the step of the model, up to 60 s.
            accelerator_pedal_frac: Accelerator pedal, 0 to 1.
            xbr_decel_m_s2: Requested deceleration, m/s2, positive slows, 0 to 12.5.
            steering_wheel_rad: Requested hand-wheel angle, rad, positive left.
            retarder_frac: Engine brake and retarder demand, 0 to 1 of the available torque.
            gear: Forward gear asked for, 0 opens the driveline, None leaves it to the gearbox.
            grade_rad: Grade of the road, rad, positive uphill.
            bank_rad: Bank, rad, left side up.
            wind_x_m_s: Wind towards map x, m/s.
            wind_y_m_s: Wind towards map y, m/s.
            air_temperature_k: Air temperature, K.
            air_pressure_pa: Air pressure, Pa.
            altitude_m: Altitude, m; engines lose torque with it.
            adhesion_coeff: Friction coefficient between tyre and road.

        Raises:
            ValueError: A value outside its range; the text names it. The truck has not moved.
            RuntimeError: The state stopped being finite; the truck has not moved.

        Other Python threads go on meanwhile.
        """
        self._native.step(
            duration_s,
            accelerator_pedal_frac=accelerator_pedal_frac,
            xbr_decel_m_s2=xbr_decel_m_s2,
            steering_wheel_rad=steering_wheel_rad,
            retarder_frac=retarder_frac,
            gear=gear,
            grade_rad=grade_rad,
            bank_rad=bank_rad,
            wind_x_m_s=wind_x_m_s,
            wind_y_m_s=wind_y_m_s,
            air_temperature_k=air_temperature_k,
            air_pressure_pa=air_pressure_pa,
            altitude_m=altitude_m,
            adhesion_coeff=adhesion_coeff,
        )
        return self.state

    @property
    def state(self) -> Ego:
        """The true state. There is no road: `s_m` is the distance driven, `d_m` and `z_m` are 0."""
        return Ego(**self._native.state())

    @property
    def name(self) -> str:
        """Name that the truck file gives."""
        return self._native.about()[0]

    @property
    def mass_kg(self) -> float:
        """Total mass, kg."""
        return self._native.about()[1]

    def copy(self) -> Self:
        """Another truck that goes on from this state, bit for bit."""
        twin = type(self).__new__(type(self))
        twin._native = self._native.copy()
        return twin
