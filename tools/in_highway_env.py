"""Deciders in the traffic of highway-env, seed by seed: our truck is one of its vehicles.

pip install "./python[gym]" highway-env
python tools/in_highway_env.py --seeds 10 --deciders rules:50 mobil dqn

The full truck and stack drive on our flat road of two lanes; every 0.1 s highway-env's vehicles are
shown to them (`World.show`), and the truck's place to highway-env, whose drivers (`IDMVehicle`: its IDM
and MOBIL, as they come) react to it. So the observation is made by the truck itself, of what highway-env
has: places, speeds and accelerations. It has no classes (all are cars of 5 m), announces no lane
changes, and knows one rectangle per vehicle (the truck's trailer does not turn there).
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path
from typing import Any

import gymnasium
import highway_env  # noqa: F401  (registers highway-v0)
import numpy as np
import numpy.typing as npt
import tractrix
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle
from transfer_table import FIGURES, tell

TRUCK = Path(__file__).parents[1] / "crates" / "dynamics" / "trucks" / "longhaul.toml"
STEP_S = 0.1
TICKS = 10
"""Of 0.01 s in a step."""
THEIR_LANE_M, OUR_LANE_M = 4.0, 3.75
CARS_BEHIND, CARS_AHEAD = 5, 15
WISHES_M_S = (9.5, 12.5)
"""Of the cars; the truck wishes 16.67 m/s."""
SPACING = 2.0
"""Of highway-env's `create_random`: 20 cars on about 0.7 km."""


def body_m() -> tuple[float, float]:
    """The bumpers, ahead of and behind the truck's reference point."""
    truck = tomllib.loads(TRUCK.read_text())
    body, tractor = truck["body"], truck["lateral"]["tractor"]
    behind_cg_m = tractor["drive_group_behind_cg_m"]
    front_m = tractor["steer_axle_ahead_of_cg_m"] + behind_cg_m
    hitch_ahead_m = behind_cg_m - tractor["hitch_behind_cg_m"]
    return (
        front_m + body["front_overhang_m"],
        body["trailer_rear_m"] - hitch_ahead_m,
    )


class Truck(Vehicle):  # type: ignore[misc]
    """Our truck as highway-env sees it: moved from outside."""

    WIDTH = 2.55

    def act(self, action: Any = None) -> None:
        """Decides nothing here."""

    def step(self, dt: float) -> None:
        """Is moved by `place`."""

    def place(self, x_m: float, y_m: float, speed_m_s: float) -> None:
        """Where it is now."""
        self.position = np.array([x_m, y_m])
        self.speed = speed_m_s
        self.on_state_update()


class Coupled:
    """One episode: highway-env's road with our truck on it."""

    def __init__(self, decider: str, seed: int, duration_s: float) -> None:
        scenario = tractrix.scenario("table2-medium-12.5")
        scenario["traffic"]["family"] = None
        self.world = tractrix.World(
            scenario,
            seed=seed,
            traffic="none",
            decider=decider,
            duration_s=duration_s,
        )
        self.front_m, self.rear_m = body_m()
        Truck.LENGTH = self.front_m + self.rear_m
        env = gymnasium.make("highway-v0", config={"lanes_count": 2})
        env.reset(seed=seed)
        self.road = env.unwrapped.road  # type: ignore[attr-defined]
        self._populate(seed)
        ego = self.world.ego
        lane = round(self.truck.position[1] / THEIR_LANE_M)
        # Our truck starts in the right lane; lanes are counted from the left there.
        self.left_d_m = ego.d_m + OUR_LANE_M * lane
        self.from_x_m = self.truck.position[0] - self._centre_s_m()
        self.before: dict[int, float] = {}

    def _populate(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.road.vehicles = []
        for number in range(CARS_BEHIND + 1 + CARS_AHEAD):
            if number == CARS_BEHIND:
                first = self.road.vehicles[-1].position[0] + 2 * Truck.LENGTH
                at = (first, THEIR_LANE_M)
                self.truck = Truck(self.road, at, 0.0, self.world.ego.speed_m_s)
                self.road.vehicles.append(self.truck)
                continue
            car = IDMVehicle.create_random(
                self.road, speed=rng.uniform(*WISHES_M_S), spacing=SPACING
            )
            car.randomize_behavior()
            self.road.vehicles.append(car)

    def _centre_s_m(self) -> float:
        return self.world.ego.s_m + 0.5 * (self.front_m - self.rear_m)

    def shown(self) -> npt.NDArray[np.void]:
        """The cars as our truck is shown them."""
        cars = [(i, v) for i, v in enumerate(self.road.vehicles) if v is not self.truck]
        rows = np.zeros(len(cars), tractrix.SCENE_DTYPE)
        for row, (number, car) in zip(rows, cars, strict=True):
            along_m_s = car.speed * np.cos(car.heading)
            s_m = car.position[0] - self.from_x_m
            row["id"], row["class"], row["width_m"] = number, "car", car.WIDTH
            row["front_s_m"] = s_m + 0.5 * car.LENGTH
            row["rear_s_m"] = s_m - 0.5 * car.LENGTH
            row["d_m"] = self.left_d_m - car.position[1] * OUR_LANE_M / THEIR_LANE_M
            row["speed_m_s"] = along_m_s
            row["lateral_speed_m_s"] = -car.speed * np.sin(car.heading)
            last = self.before.get(number, along_m_s)
            row["accel_m_s2"] = (along_m_s - last) / STEP_S
            self.before[number] = along_m_s
        return rows

    def drive(self) -> dict[str, float]:
        """Drives the episode; its figures."""
        while self.world.status == "running":
            self.world.show(self.shown())
            self.world.step(TICKS)
            ego = self.world.ego
            right_m = (self.left_d_m - ego.d_m) * THEIR_LANE_M / OUR_LANE_M
            x_m = self.from_x_m + self._centre_s_m()
            self.truck.place(x_m, right_m, ego.speed_m_s)
            self.road.act()
            self.road.step(STEP_S)
        summary = self.world.summary()
        self.world.close()
        return {name: float(summary[name]) for name in FIGURES}


def main() -> None:
    """Drives every decider through the same seeds."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--deciders", nargs="+", default=["rules:50", "mobil", "dqn"])
    parser.add_argument("--seeds", type=int, default=10, help=" ")
    parser.add_argument("--first-seed", type=int, default=1, help=" ")
    parser.add_argument("--duration-s", type=float, default=200.0, help=" ")
    given = parser.parse_args()
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    tell(
        {
            word: [Coupled(word, seed, given.duration_s).drive() for seed in seeds]
            for word in given.deciders
        }
    )


if __name__ == "__main__":
    main()
