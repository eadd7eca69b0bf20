"""Deciders in recorded traffic: the full truck drives in the place of one recorded vehicle at a time.

python tools/in_recordings.py RECORDING... --lanes 2 --deciders rules:50 mobil dqn

The vehicle is taken out of the recording, and the truck starts with its front where the vehicle's was,
in its lane and at its speed. The others drive as they were recorded: nobody makes way for the truck,
brakes behind it, or takes the room that it leaves. So what a change gains the truck is told, not what it
costs others, and who comes from behind may drive into the truck; such contacts are counted.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
import numpy.typing as npt
import tractrix
from transfer_table import FIGURES, tell

TICKS = 10
"""Of 0.01 s between two scenes."""
LONGEST_S = 30.0
WAY_M = 400.0
"""Road that has to lie ahead of a start."""
FRONT_M, LENGTH_M = 5.3, 17.0
"""The truck's front ahead of its reference point, and its length with a little room."""
SLOWEST_M_S = 3.0
"""Who hardly moves is no place to start."""


def scenario(file: str, lanes: int, source: str, **ego: float) -> dict[str, Any]:
    """The truck on the road under a recording."""
    changed = tractrix.scenario("table2-medium-12.5")
    changed["road"] = f"recording:{lanes}"
    changed["traffic"] |= {"family": None, "source": source}
    changed["traffic"] |= {"mode": "rep" if source == "replay" else "inter"}
    changed["traffic"]["replay"] |= {"file": file, "scene_radius_m": 1e5}
    changed["ego"] |= ego
    changed["run"]["duration_s"] = LONGEST_S
    return changed


def recorded(file: str, lanes: int) -> tuple[list[npt.NDArray[np.void]], float]:
    """All scenes of a recording, 0.1 s apart, and the length of its road, m."""
    scenes = []
    given = scenario(file, lanes, "replay", s_m=30.0, speed_m_s=1.0)
    with tractrix.World(given, decider="keep") as world:
        length_m = world.road_length_m
        while world.status == "running":
            world.step(TICKS)
            scenes.append(world.scene())
    return scenes, length_m


def starts(
    scene: npt.NDArray[np.void], length_m: float, most: int
) -> list[npt.NDArray[np.void]]:
    """Vehicles in whose place there is room for the truck."""
    found = []
    for one in scene:
        behind = scene[(scene["lane"] == one["lane"]) & (scene["id"] != one["id"])]
        behind = behind[behind["rear_s_m"] < one["front_s_m"]]
        rear_m = one["front_s_m"] - LENGTH_M
        has_room = rear_m > 0.0 and not (behind["front_s_m"] > rear_m).any()
        has_way = one["front_s_m"] + WAY_M < length_m
        if has_room and has_way and one["speed_m_s"] > SLOWEST_M_S:
            found.append(one)
    return found[:: max(1, len(found) // most)][:most]


def drive(
    file: str,
    lanes: int,
    scenes: list[npt.NDArray[np.void]],
    start: npt.NDArray[np.void],
    decider: str,
) -> dict[str, float]:
    """Drives to the end of the recording or of its road; the figures."""
    ego = {
        "s_m": float(start["front_s_m"]) - FRONT_M,
        "speed_m_s": float(start["speed_m_s"]),
        "lane": int(start["lane"]),
    }
    given = scenario(file, lanes, "none", **ego)
    with tractrix.World(given, decider=decider) as world:
        for scene in scenes:
            if world.status != "running":
                break
            world.show(scene[scene["id"] != start["id"]])
            world.step(TICKS)
        summary = world.summary()
    return {name: float(summary[name]) for name in FIGURES}


def main() -> None:
    """Drives every decider from every start."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--lanes", type=int, default=2, help=" ")
    parser.add_argument("--deciders", nargs="+", default=["rules:50", "mobil", "dqn"])
    parser.add_argument("--most", type=int, default=8, help="starts in a recording")
    given = parser.parse_args()
    rows: dict[str, list[dict[str, float]]] = {word: [] for word in given.deciders}
    for file in given.recordings:
        scenes, length_m = recorded(file, given.lanes)
        for start in starts(scenes[0], length_m, given.most):
            for word, found in rows.items():
                found.append(drive(file, given.lanes, scenes, start, word))
    tell(rows)


if __name__ == "__main__":
    main()
