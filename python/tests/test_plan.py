"""Trip plans: the figures and the table of the command line."""

from __future__ import annotations

import csv
import json
import math
import threading
from pathlib import Path
from typing import Any

import pytest
import tractrix
from program import sim_server

TRIP: dict[str, Any] = {
    "mass_kg": 55_000.0,
    "set_speed_m_s": 20.0,
    "speed_min_m_s": 16.7,
    "speed_max_m_s": 23.6,
}


def without_clock(plan: dict[str, Any]) -> dict[str, Any]:
    """A plan without what differs from run to run and build to build."""
    solver = {k: v for k, v in plan["solver"].items() if not k.endswith("_time_ms")}
    other = {"git_revision", "profile"}
    return {k: v for k, v in plan.items() if k not in other} | {"solver": solver}


def test_a_plan_has_the_numbers_of_the_command_line(tmp_path: Path) -> None:
    words = [
        word
        for key, value in TRIP.items()
        for word in (f"--{key.replace('_', '-')}", str(value))
    ]
    words += ["--truck", "sinotruk", "--road", "builtin:test-site", "--json"]
    said = json.loads(sim_server("plan", *words, "--out", tmp_path / "plan"))
    plan = tractrix.plan("sinotruk", "builtin:test-site", **TRIP)
    assert without_clock(plan) == without_clock(said)
    assert plan["saving_frac"]["vs_set_speed"] > 0.0

    with (tmp_path / "plan" / "plan.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    profile = plan["profile"]
    assert list(profile) == list(rows[0])
    for name, column in profile.items():
        assert column.tolist() == [float(row[name]) for row in rows], name
    assert profile["time_s"][-1] == pytest.approx(plan["trip_time_s"], abs=1.0)


def test_more_time_takes_less_fuel_and_other_threads_go_on() -> None:
    ended = threading.Event()
    plans: list[dict[str, Any]] = []

    def work() -> None:
        plans.append(tractrix.plan("sinotruk", "builtin:test-site", **TRIP))
        ended.set()

    thread = threading.Thread(target=work)
    thread.start()
    counted = 0
    while not ended.is_set():
        counted += 1
    thread.join()
    assert counted > 1_000
    time_s = plans[0]["trip_time_s"] * 1.05
    slower = tractrix.plan("sinotruk", "builtin:test-site", trip_time_s=time_s, **TRIP)
    assert slower["trip_time_s"] > plans[0]["trip_time_s"]
    assert slower["fuel_g"] < plans[0]["fuel_g"]


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"mass_kg": 900.0}, "mass_kg 900: sinotruk weighs"),
        ({"mass_kg": math.nan}, "mass_kg NaN: a positive number"),
        ({"set_speed_m_s": -1.0}, "set_speed_m_s -1: a positive number"),
        ({"speed_min_m_s": 30.0}, "speed"),
        ({"trip_time_s": 0.0}, "trip_time_s 0: a positive number"),
    ],
)
def test_what_cannot_be_planned_is_named(changed: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        tractrix.plan("sinotruk", "builtin:test-site", **TRIP | changed)


def test_unknown_trucks_and_roads_are_named() -> None:
    with pytest.raises(ValueError, match="scania"):
        tractrix.plan("scania", "builtin:test-site", **TRIP)
    with pytest.raises(ValueError, match="builtin:moon"):
        tractrix.plan("sinotruk", "builtin:moon", **TRIP)
    with pytest.raises(FileNotFoundError, match=r"nowhere\.csv"):
        tractrix.plan("sinotruk", "nowhere.csv", **TRIP)
