"""Worlds: every mode, the same bits as the command line, snapshots, other threads."""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import threading
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tractrix
from program import sim_server

# What a wall clock measured differs from run to run, the revision from build to build.
OTHER = {"git_revision", "missed_deadlines", "pace", "realtime_factor"}
OTHER |= {"tick_time_us", "wall_time_s"}


def figures(summary: dict[str, Any]) -> dict[str, Any]:
    """A summary without what differs from run to run and build to build."""
    return {key: value for key, value in summary.items() if key not in OTHER}


def sumo() -> str:
    """The SUMO program; tests are skipped without."""
    program = os.environ.get("SUMO_BINARY") or shutil.which("sumo")
    if not program:
        pytest.skip("no sumo (set SUMO_BINARY)")
    return program


def record(world: tractrix.World, file: Path) -> int:
    """Drives a world to its end and writes its vehicles ten times a second; the number of rows."""
    columns = ["id", "x_m", "y_m", "yaw_rad", "speed_m_s", "width_m", "class"]
    every = round(0.1 / world.tick_s)
    count = 0
    with file.open("w", newline="") as target:
        table = csv.writer(target)
        table.writerow(["time_s", "length_m", *columns])
        while world.status == "running":
            world.step()
            time_s = world.ego.time_s
            for row in world.scene():
                length_m = row["front_s_m"] - row["rear_s_m"]
                table.writerow([time_s, length_m, *(row[c] for c in columns)])
                count += 1
            world.step(every - 1)
    return count


def test_a_run_has_the_bits_of_the_command_line(tmp_path: Path) -> None:
    words = ["--seed", "7", "--duration", "20", "--decider", "mobil"]
    words += ["--speed-planner", "predictive", "--headless", "--pace", "max"]
    sim_server("run", "medium-15", *words, "--out", tmp_path)
    expected = json.loads((tmp_path / "summary.json").read_text())
    world = tractrix.World(
        "medium-15", seed=7, duration_s=20, decider="mobil", speed_planner="predictive"
    )
    summary = world.run()
    assert list(summary) == list(expected)
    assert list(summary["tick_time_us"]) == list(expected["tick_time_us"])
    assert figures(summary) == figures(expected)
    assert world.manifest() == (tmp_path / "traffic.manifest.toml").read_text()


def test_the_same_seed_gives_the_same_bits_and_another_seed_others() -> None:
    def run(seed: int) -> dict[str, Any]:
        return figures(tractrix.World("dense-15", seed=seed, duration_s=10).run())

    assert run(3) == run(3)
    assert run(3)["state_hash"] != run(4)["state_hash"]


def test_steps_of_any_size_are_the_same_run() -> None:
    whole, parts = (tractrix.World("dense-15", duration_s=5) for _ in range(2))
    whole.run()
    while parts.step(7) == "running":
        assert parts.decision is not None
    assert figures(parts.summary()) == figures(whole.summary())
    assert (parts.status, parts.step(10), parts.time_s) == (
        "time_over",
        "time_over",
        whole.time_s,
    )


def test_traffic_sees_the_truck_in_mode_inter_and_drives_through_it_in_mode_pure() -> (
    None
):
    slow = tractrix.scenario("flat")
    slow["ego"] |= {"s_m": 400.0, "speed_m_s": 8.0}
    slow["stack"] |= {"set_speed_m_s": 8.0, "decider": "keep_lane"}
    slow["traffic"]["native"] |= {"spawn_probability": 0.05, "max_speed_m_s": 24.0}

    def collisions(mode: str) -> int:
        world = tractrix.World(slow, traffic="native", mode=mode, duration_s=60)
        count: int = world.run()["collisions"]
        return count

    assert collisions("pure") > 0
    assert collisions("inter") == 0


def test_a_run_is_repeated_from_its_manifest_and_a_difference_has_its_tick(
    tmp_path: Path,
) -> None:
    first = tractrix.World("dense-12.5", seed=5, duration_s=8)
    expected = first.run()
    file = tmp_path / "traffic.manifest.toml"
    file.write_text(first.manifest())
    again = tractrix.World("dense-12.5", mode="re", manifest=file, duration_s=8)
    assert again.seed == 5
    assert figures(again.run()) == figures(expected)

    with pytest.raises(ValueError, match="seed was `5`, is `6`"):
        tractrix.World("dense-12.5", seed=6, mode="re", manifest=file)
    text = file.read_text()
    file.write_text(text.replace(tomllib.loads(text)["hashes"][2], "0" * 16))
    other = tractrix.World("dense-12.5", manifest=file, duration_s=8)
    with pytest.raises(
        RuntimeError, match="differs from the manifest between ticks 200 and 300"
    ):
        other.run()
    assert (other.status, other.summary()["end_reason"]) == ("failed", "failed")
    with pytest.raises(RuntimeError, match="differs from the manifest"):
        other.step()


def test_recorded_traffic_is_driven_in_mode_rep(tmp_path: Path) -> None:
    file = tmp_path / "trajectories.csv"
    assert record(tractrix.World("dense-15", mode="pure", duration_s=15), file) > 1000
    world = tractrix.World("dense-15", traffic=f"replay:{file}", duration_s=12)
    world.step(1001)
    assert world.ego.time_s == pytest.approx(10.0)
    assert world.summary()["traffic"]["mode"] == "rep"
    with file.open() as source:
        rows = [
            row
            for row in csv.DictReader(source)
            if abs(float(row["time_s"]) - 10.0) < 1e-6
        ]
    recorded = np.array([(float(row["x_m"]), float(row["y_m"])) for row in rows])
    scene = world.scene()
    assert len(scene) > 5
    for vehicle in scene:
        away_m = np.hypot(
            recorded[:, 0] - vehicle["x_m"], recorded[:, 1] - vehicle["y_m"]
        )
        assert away_m.min() < 0.05


def test_sumo_drives_all_modes(tmp_path: Path) -> None:
    sumo()

    def world(**words: Any) -> tractrix.World:
        return tractrix.World("dense-15", traffic="sumo", duration_s=6, **words)

    with world(mode="inter", seed=2) as first:
        expected = first.run()
        assert expected["vehicles_met"] > 5
        assert "SUMO" in expected["traffic"]["engine"]
        file = tmp_path / "manifest.toml"
        file.write_text(first.manifest())
        with pytest.raises(RuntimeError, match="one SUMO"):
            first.snapshot()
    with world(manifest=file) as again:
        assert figures(again.run()) == figures(expected)
    trajectories = tmp_path / "trajectories.csv"
    with world(mode="pure") as pure:
        assert record(pure, trajectories) > 100
    rep = tractrix.World("dense-15", traffic=f"replay:{trajectories}", duration_s=5)
    assert rep.run()["vehicles_met"] > 5


def test_a_sumo_that_is_not_there_is_a_runtime_error_that_says_how_to_get_it() -> None:
    scenario = tractrix.scenario("dense-15")
    scenario["traffic"]["sumo"]["binary"] = "/nowhere/sumo"
    with pytest.raises(RuntimeError, match="pip install eclipse-sumo"):
        tractrix.World(scenario, traffic="sumo")


def test_an_empty_road_is_empty() -> None:
    world = tractrix.World("dense-15", traffic="none", duration_s=3)
    assert world.run()["vehicles_met"] == 0
    assert len(world.scene()) == 0


def test_vehicles_that_another_simulator_moves_are_driven_among() -> None:
    scenario = tractrix.scenario("table2-medium-12.5")
    ours = tractrix.World(scenario, seed=3, decider="keep")
    scenario["traffic"]["family"] = None
    theirs = tractrix.World(scenario, seed=3, decider="keep", traffic="none")
    for _ in range(2000):
        ours.step()
        theirs.show(ours.scene())
        theirs.step()
    assert theirs.ego == ours.ego and len(theirs.scene()) > 2
    assert theirs.decision is not None and theirs.decision.following is not None
    state = theirs.summary()["state_hash"]
    assert state == ours.summary()["state_hash"]
    fork = theirs.snapshot()
    shown = theirs.scene()
    theirs.show(shown[:0])
    theirs.step()
    assert len(theirs.scene()) == 0
    theirs.restore(fork)
    assert theirs.scene().tolist() == shown.tolist()
    off_lane = shown.copy()
    off_lane["d_m"] += 100.0
    theirs.show(off_lane)
    theirs.step()
    assert len(theirs.scene()) == 0, "who is on no lane is left out"

    for field, value, named in (
        ("speed_m_s", math.nan, "finite"),
        ("rear_s_m", 1e9, "front_s_m beyond rear_s_m"),
        ("class", "tram", "'tram'|\"tram\""),
    ):
        wrong = shown.copy()
        wrong[field] = value
        with pytest.raises(ValueError, match=named):
            theirs.show(wrong)
    with pytest.raises(ValueError, match="SCENE_DTYPE"):
        theirs.show(np.zeros(3))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="without traffic"):
        ours.show(shown)


def test_ego_decision_and_scene_tell_one_tick() -> None:
    world = tractrix.World("dense-15", seed=3)
    start = world.ego
    assert (start.time_s, world.time_s, world.decision, len(world.scene())) == (
        0.0,
        0.0,
        None,
        0,
    )
    world.step(3000)
    ego, decision, scene = world.ego, world.decision, world.scene()
    assert decision is not None
    assert ego.time_s == decision.time_s == pytest.approx(world.time_s - world.tick_s)
    assert ego.s_m > start.s_m
    assert 5.0 < ego.speed_m_s < 25.0
    assert 0.0 <= decision.accelerator_pedal_frac <= 1.0
    assert decision.maneuver in (
        "keep_lane",
        "change_left",
        "change_right",
        "abort_change",
    )
    assert scene.dtype == tractrix.SCENE_DTYPE
    assert len(set(scene["id"])) == len(scene) > 5
    assert set(scene["class"]) <= {"car", "van", "truck"}
    assert (np.diff(scene["front_s_m"]) >= 0).all()
    length_m = scene["front_s_m"] - scene["rear_s_m"]
    assert (length_m > 2.5).all() and (length_m < 25.0).all()
    assert (scene["speed_m_s"] >= 0.0).all() and (scene["speed_m_s"] < 40.0).all()
    assert set(scene["lane"]) <= set(range(8))
    assert (scene["target_lane"] >= -1).all()
    middle_m = 0.5 * (scene["front_s_m"] + scene["rear_s_m"]) - ego.s_m
    near = abs(middle_m) < 200.0
    away_m = np.hypot(scene["x_m"] - ego.x_m, scene["y_m"] - ego.y_m)
    assert near.any() and np.allclose(away_m[near], abs(middle_m[near]), atol=15.0)
    if decision.following is not None:
        assert decision.following in scene["id"]
    summary = world.summary()
    assert summary["end_reason"] is None
    assert summary["distance_m"] == ego.s_m - start.s_m
    assert summary["fuel_g"] == ego.fuel_used_g


def test_a_lane_change_says_why_it_is_wished_and_why_it_is_not_driven() -> None:
    world = tractrix.World("flat", decider="external", traffic="none")
    world.step(100)
    assert world.decision is not None
    assert (world.decision.reason, world.decision.refusal) == (None, None)
    world.request_lane_change("right")
    # Wishes are looked at ten times a second.
    seen = set()
    for _ in range(10):
        world.step()
        seen.add((world.decision.reason, world.decision.refusal))
    assert ("requested", "no_target_lane") in seen
    world.request_lane_change("left")
    world.step(200)
    decision = world.decision
    assert (decision.maneuver, decision.reason) == ("change_left", "requested")
    assert decision.refusal is None


def test_sensors_hide_from_the_stack_what_truth_shows() -> None:
    scenario = tractrix.scenario("dense-15")
    scenario["traffic"]["perception"] |= {"enabled": True, "dropout_frac": 1.0}
    world = tractrix.World(scenario, mode="pure")
    world.step(500)
    assert len(world.scene()) == 0
    assert len(world.scene(truth=True)) > 5


def test_a_snapshot_goes_on_bit_for_bit_as_often_as_asked_and_in_another_world() -> (
    None
):
    world = tractrix.World("dense-15", seed=3, duration_s=12)
    world.step(600)
    snapshot = world.snapshot()
    ego, scene = world.ego, world.scene()
    expected = figures(world.run())
    world.restore(snapshot)
    assert (world.ego, world.status) == (ego, "running")
    assert (world.scene() == scene).all()
    assert figures(world.run()) == expected
    other = tractrix.World("flat")
    other.restore(snapshot)
    assert figures(other.run()) == expected


def test_a_scenario_comes_back_as_it_went_in_and_drives_the_same() -> None:
    assert "highway" in tractrix.scenarios()
    for name, description in tractrix.scenarios().items():
        scenario = tractrix.scenario(name)
        assert (scenario["name"], scenario["description"]) == (name, description)
        by_name, by_keys = (tractrix.World(s, duration_s=1) for s in (name, scenario))
        assert by_keys.scenario() == by_name.scenario()
        assert figures(by_keys.run()) == figures(by_name.run())


def test_a_scenario_file_is_driven(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        'schema = 1\nname = "mine"\nroad = "builtin:flat"\n'
        '[truck]\nfile = "sinotruk"\npayload_kg = 20000.0\n[run]\nduration_s = 2.0\n'
    )
    assert tractrix.World(file).run()["scenario"] == "mine"
    world = tractrix.World(
        str(file), payload_kg=0, road="builtin:test-site", truck="reference"
    )
    changed = world.scenario()
    assert changed["truck"] == {"file": "reference", "payload_kg": 0.0}
    assert changed["road"] == "builtin:test-site"


def test_lane_changes_are_wished_from_outside() -> None:
    world = tractrix.World("highway-empty", decider="external")
    world.step(500)
    before_d_m = world.ego.d_m
    world.request_lane_change("left")
    world.step(1500)
    assert world.ego.d_m > before_d_m + 2.0
    assert world.summary()["lane_changes"] == 1


def test_another_thread_goes_on_while_a_world_drives() -> None:
    world = tractrix.World("dense-15")
    ticks, going = 0, True

    def drive() -> None:
        nonlocal going
        world.step(20_000)
        going = False

    thread = threading.Thread(target=drive)
    thread.start()
    while going:
        ticks += 1
        time.sleep(0.001)
    thread.join()
    assert world.time_s == pytest.approx(200.0)
    assert ticks > 10


def test_two_threads_may_step_one_world() -> None:
    world, alone = (tractrix.World("dense-15", duration_s=600) for _ in range(2))
    threads = [threading.Thread(target=world.step, args=(500,)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone.step(1000)
    assert figures(world.summary()) == figures(alone.summary())


def test_the_words_of_a_world_name_it() -> None:
    world = tractrix.World("flat", seed=9)
    assert repr(world) == "<tractrix.World flat, seed 9, 0.00 s, running>"
    assert world.road_length_m > 1000.0
    assert math.isclose(world.tick_s, 0.01)
    assert world.summary()["version"] == tractrix.__version__
