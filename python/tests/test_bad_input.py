"""Bad input is an exception that names it; nothing panics, and a world stays usable."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import tractrix


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ({"traffic": "trains"}, "traffic trains: expected native, sumo"),
        ({"traffic": "replay"}, "replay:FILE"),
        ({"mode": "all"}, "mode all: expected pure, inter, re or rep"),
        ({"mode": "re"}, "manifest"),
        ({"mode": "rep"}, "replay:FILE"),
        ({"decider": "psychic"}, "decider psychic"),
        ({"decider": "rules:nan"}, "rules:nan"),
        ({"speed_planner": "fast"}, "speed_planner fast"),
        ({"on_traffic_failure": "pray"}, "on_traffic_failure pray"),
        ({"duration_s": math.nan}, "run.duration_s = NaN"),
        ({"duration_s": -1.0}, "run.duration_s = -1"),
        ({"payload_kg": math.inf}, "truck.payload_kg = inf"),
        ({"truck": "scania"}, "scania"),
        ({"road": "builtin:motorway"}, "builtin:motorway"),
        ({"seed": -1}, "seed = -1"),
        ({"seed": 2**64}, "seed = 18446744073709551616"),
        ({"scenario": "nowhere"}, 'no built-in scenario "nowhere"; the nearest are'),
        ({"scenario": ""}, "no built-in scenario"),
        ({"scenario": {}}, "missing field"),
        ({"scenario": {"schema": "one"}}, "schema|invalid type"),
    ],
)
def test_what_cannot_be_used_is_a_value_error_that_names_it(
    words: dict[str, Any], named: str
) -> None:
    with pytest.raises(ValueError, match=named):
        tractrix.World(**words)


@pytest.mark.parametrize(
    "words",
    [
        {"scenario": "nowhere/scenario.toml"},
        {"scenario": Path("nowhere.toml")},
        {"road": "nowhere/road.csv"},
        {"road": Path("nowhere.xodr")},
        {"truck": "nowhere/truck.toml"},
        {"traffic": "replay:nowhere.csv"},
        {"manifest": "nowhere.toml"},
        {"decider": "dqn:nowhere.safetensors"},
    ],
)
def test_a_file_that_is_not_there_is_named(words: dict[str, Any]) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        tractrix.World(**words)


@pytest.mark.parametrize(
    "words",
    [
        {"scenario": 3},
        {"scenario": None},
        {"seed": 1.5},
        {"seed": "1"},
        {"traffic": 7},
        {"duration_s": "long"},
        {"payload_kg": [1]},
        {"manifest": 1},
        {"speed": 1},
    ],
)
def test_another_type_is_a_type_error(words: dict[str, Any]) -> None:
    with pytest.raises(TypeError):
        tractrix.World(**words)


def test_a_scenario_with_wrong_keys_or_values_is_refused() -> None:
    scenario = tractrix.scenario("flat")
    with pytest.raises(ValueError, match="speed_km_h"):
        tractrix.World(scenario | {"ego": {"speed_km_h": 72.0}})
    with pytest.raises(ValueError, match=r"ego\.speed_m_s = 99"):
        tractrix.World(scenario | {"ego": {"speed_m_s": 99.0}})
    with pytest.raises(ValueError, match=r"run\.tick_s = 0"):
        tractrix.World(scenario | {"run": {"tick_s": 0.0}})
    with pytest.raises(ValueError, match="nan|NaN|expected"):
        tractrix.World(scenario | {"ego": {"speed_m_s": math.nan}})
    with pytest.raises(TypeError):
        tractrix.World(scenario | {"ego": object()})


def test_a_broken_scenario_file_is_named_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text('schema = 1\nname = "x"\nroad = 3\n')
    with pytest.raises(ValueError, match=r"broken\.toml.*line 3"):
        tractrix.scenario(file)


def test_steps_are_whole_and_not_negative() -> None:
    world = tractrix.World("flat")
    for bad in (-1, 2**70):
        with pytest.raises(ValueError, match="ticks = "):
            world.step(bad)
    for wrong in (1.5, "1", None, math.nan):
        with pytest.raises(TypeError):
            world.step(wrong)  # type: ignore[arg-type]
    assert world.step(0) == "running"
    assert world.time_s == 0.0


def test_a_closed_world_says_so() -> None:
    with tractrix.World("flat") as world:
        world.step(3)
        snapshot = world.snapshot()
    world.close()
    assert repr(world) == "<tractrix.World closed>"
    calls: list[Any] = [
        world.step,
        world.run,
        world.scene,
        world.summary,
        world.manifest,
        world.scenario,
        world.snapshot,
        lambda: world.restore(snapshot),
        lambda: world.request_lane_change("left"),
        lambda: world.ego,
        lambda: world.decision,
        lambda: world.status,
        lambda: world.time_s,
    ]
    for call in calls:
        with pytest.raises(ValueError, match="closed"):
            call()


def test_lane_changes_need_a_word_and_the_decider_external() -> None:
    with pytest.raises(ValueError, match="external"):
        tractrix.World("flat").request_lane_change("left")
    with pytest.raises(ValueError, match="left, keep or right"):
        tractrix.World("flat", decider="external").request_lane_change("up")


def test_only_a_snapshot_is_restored() -> None:
    with pytest.raises(TypeError):
        tractrix.World("flat").restore(b"")  # type: ignore[arg-type]
