"""The truck model on its own: the bits of a world's truck, physics, errors."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tractrix
from program import WORKSPACE


def test_the_commands_of_a_world_give_its_truck_bit_for_bit() -> None:
    scenario = tractrix.scenario("table2-sparse-12.5")
    payload_kg = scenario["truck"]["payload_kg"]
    with tractrix.World(
        scenario, seed=2, road="builtin:flat", decider="mobil"
    ) as world:
        start = _after(world)
        truck = tractrix.TruckModel(
            scenario["truck"]["file"],
            payload_kg=payload_kg,
            speed_m_s=start.speed_m_s,
            x_m=start.x_m,
            y_m=start.y_m,
            yaw_rad=start.yaw_rad,
        )
        weather = scenario["weather"]
        for _ in range(3_000):
            decision = world.decision
            assert decision is not None
            truck.step(
                world.tick_s,
                accelerator_pedal_frac=decision.accelerator_pedal_frac,
                xbr_decel_m_s2=decision.xbr_decel_m_s2,
                steering_wheel_rad=decision.steering_wheel_rad,
                retarder_frac=decision.retarder_frac,
                wind_x_m_s=weather["wind_x_m_s"],
                wind_y_m_s=weather["wind_y_m_s"],
                air_temperature_k=weather["air_temperature_k"],
                air_pressure_pa=weather["air_pressure_pa"],
                adhesion_coeff=weather["adhesion_coeff"],
            )
            ego = _after(world)
            # a model without a road knows neither station nor height
            there = truck.state._replace(
                s_m=ego.s_m, d_m=ego.d_m, z_m=ego.z_m, time_s=ego.time_s
            )
            assert there == ego
        assert ego.gear > 1 and ego.fuel_used_g > 10.0
        assert truck.state.s_m == pytest.approx(ego.s_m - start.s_m, abs=0.5)
        assert truck.state.time_s == pytest.approx(30.0)


def _after(world: tractrix.World) -> tractrix.Ego:
    world.step()
    return world.ego


def test_a_truck_climbs_brakes_and_turns() -> None:
    truck = tractrix.TruckModel("reference", payload_kg=20_000.0, speed_m_s=20.0)
    assert truck.mass_kg > 30_000.0
    level = truck.copy()
    for _ in range(100):
        up = truck.step(0.1, accelerator_pedal_frac=1.0, grade_rad=0.03)
        flat = level.step(0.1, accelerator_pedal_frac=1.0)
    assert up.speed_m_s < flat.speed_m_s
    assert up.fuel_used_g > 0.0 and up.time_s == pytest.approx(10.0)
    before_m_s = level.state.speed_m_s
    for _ in range(20):
        level.step(0.1, xbr_decel_m_s2=2.0)
    assert 2.0 < before_m_s - level.state.speed_m_s < 5.0
    left = truck.step(2.0, steering_wheel_rad=0.3)
    assert left.yaw_rate_rad_s > 0.0 and left.y_m > 0.0
    truck.reset(speed_m_s=10.0, x_m=5.0)
    assert (truck.state.x_m, truck.state.speed_m_s, truck.state.time_s) == (
        5.0,
        10.0,
        0.0,
    )
    rolling = truck.step(5.0, gear=0)
    assert rolling.gear == 0


def test_a_file_is_read_like_its_built_in_twin(tmp_path: Path) -> None:
    source = WORKSPACE / "crates/dynamics/trucks/longhaul.toml"
    file = tmp_path / "own.toml"
    file.write_text(source.read_text())
    own, built_in = tractrix.TruckModel(file), tractrix.TruckModel("longhaul")
    assert own.name == built_in.name == tomllib.loads(source.read_text())["name"]
    step: dict[str, Any] = {"accelerator_pedal_frac": 0.7}
    assert own.step(30.0, **step) == built_in.step(30.0, **step)
    assert own.state.speed_m_s > 3.0


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"duration_s": 0.0}, "duration_s = 0"),
        ({"duration_s": 0.0123}, r"duration_s = 0\.0123: a multiple of 0\.005 s"),
        ({"duration_s": 1e9}, "duration_s = "),
        ({"duration_s": math.nan}, "duration_s = NaN"),
        ({"accelerator_pedal_frac": 1.5}, r"accelerator_pedal_frac = 1\.5: 0 to 1"),
        ({"grade_rad": math.inf}, "grade_rad = inf"),
        ({"steering_wheel_rad": math.nan}, "steering_wheel_rad = NaN"),
        ({"gear": 99}, "gear = 99: None, 0"),
        ({"gear": -1}, "gear = -1"),
    ],
)
def test_a_bad_input_is_named_and_the_truck_stays(
    changed: dict[str, Any], named: str
) -> None:
    truck = tractrix.TruckModel(speed_m_s=10.0)
    before = truck.state
    with pytest.raises(ValueError, match=named):
        truck.step(**{"duration_s": 0.1} | changed)
    assert truck.state == before


def test_a_truck_that_is_not_there_is_named() -> None:
    with pytest.raises(ValueError, match="scania"):
        tractrix.TruckModel("scania")
    with pytest.raises(FileNotFoundError, match="nowhere"):
        tractrix.TruckModel("nowhere/truck.toml")
    with pytest.raises(ValueError, match="payload"):
        tractrix.TruckModel(payload_kg=math.nan)
    with pytest.raises(ValueError, match="speed_m_s = -1"):
        tractrix.TruckModel(speed_m_s=-1.0)
