"""The recording is read by an independent reader: Python `mcap` with its ROS 2 decoder."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import time
import tomllib
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

TICKS = 2000


def messages(path: Path, *topics: str) -> list[tuple[str, int, Any]]:
    """Topic, time in nanoseconds and decoded message, in order of time."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = reader.iter_decoded_messages(topics=list(topics) or None)
        return [
            (channel.topic, raw.log_time, decoded) for _, channel, raw, decoded in found
        ]


def test_every_tick_of_the_run_is_in_the_recording_once(short_run: Path) -> None:
    counts = Counter(topic for topic, _, _ in messages(short_run / "run.mcap"))
    for topic in ("/clock", "/tf", "/odom", "/truck/state", "/truck/plan"):
        assert counts[topic] == TICKS, (topic, counts)
    for topic in ("/plan/path", "/scene", "/markers"):
        assert counts[topic] == TICKS / 10, (topic, counts)


def test_the_file_says_what_it_is_and_what_made_it(short_run: Path) -> None:
    with (short_run / "run.mcap").open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {a.name: a.data for a in reader.iter_attachments()}
        summary = reader.get_summary()
    assert records["run"]["seed"] == "7"
    assert records["run"]["version"] and records["run"]["git_revision"]
    scenario = tomllib.loads(attachments["scenario.toml"].decode())
    assert scenario["name"] == "highway" and scenario["run"]["duration_s"] == 20.0
    assert json.loads(attachments["summary.json"]) == json.loads(
        (short_run / "summary.json").read_text()
    )
    assert summary is not None and summary.statistics is not None
    kinds = {(s.name, s.encoding) for s in summary.schemas.values()}
    assert ("nav_msgs/msg/Odometry", "ros2msg") in kinds
    assert ("truck_msgs/msg/TruckState", "ros2msg") in kinds
    assert {c.message_encoding for c in summary.channels.values()} == {"cdr"}


def test_topics_agree_with_each_other_and_with_the_summary(short_run: Path) -> None:
    path = short_run / "run.mcap"
    truck = [m for _, _, m in messages(path, "/truck/state")]
    odometry = [m for _, _, m in messages(path, "/odom")]
    transforms = [m for _, _, m in messages(path, "/tf")]
    summary = json.loads((short_run / "summary.json").read_text())
    for t, o, f in zip(truck, odometry, transforms, strict=True):
        assert o.twist.twist.linear.x == t.speed_m_s
        base, trailer = f.transforms
        assert (base.child_frame_id, trailer.child_frame_id) == ("base_link", "trailer")
        assert base.transform.translation.x == o.pose.pose.position.x
        turned = trailer.transform.rotation
        assert 2.0 * math.atan2(turned.z, turned.w) == pytest.approx(
            t.articulation_rad, abs=1e-9
        )
    assert truck[-1].s_m - truck[0].s_m == pytest.approx(
        summary["distance_m"], abs=1e-6
    )
    assert truck[-1].fuel_used_g - truck[0].fuel_used_g == pytest.approx(
        summary["fuel_g"]
    )
    assert (
        odometry[-1].header.stamp.sec == 19
        and odometry[-1].header.stamp.nanosec == 990_000_000
    )


def test_speed_is_the_derivative_of_position(short_run: Path) -> None:
    """Closes the loop between two fields that the program computes apart."""
    odometry = [m for _, _, m in messages(short_run / "run.mcap", "/odom")]
    for a, b in zip(odometry[100::50], odometry[101::50], strict=False):
        p, q = a.pose.pose.position, b.pose.pose.position
        moved = math.dist((p.x, p.y), (q.x, q.y))
        assert moved == pytest.approx(0.01 * a.twist.twist.linear.x, rel=0.01, abs=1e-3)


def test_markers_hold_tractor_trailer_and_every_vehicle_of_the_scene(
    short_run: Path,
) -> None:
    path = short_run / "run.mcap"
    scenes = [m for _, _, m in messages(path, "/scene")]
    arrays = [m for _, _, m in messages(path, "/markers")]
    assert any(len(scene.vehicles) > 3 for scene in scenes)
    for scene, array in zip(scenes, arrays, strict=True):
        by_name = Counter(marker.ns for marker in array.markers)
        assert by_name["ego"] == 2 and by_name["traffic"] == len(scene.vehicles)
        for marker in array.markers:
            q = marker.pose.orientation
            assert q.x**2 + q.y**2 + q.z**2 + q.w**2 == pytest.approx(1.0)


def test_a_killed_run_is_recovered_with_schemas_attachments_and_metadata(
    server: Path, tmp_path: Path
) -> None:
    command: list[str | Path] = [
        server,
        "run",
        "--headless",
        "--pace",
        "20",
        "--out",
        tmp_path,
    ]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        recording = tmp_path / "run.mcap"
        deadline = time.monotonic() + 60.0
        while not recording.exists() or recording.stat().st_size < 200_000:
            assert time.monotonic() < deadline, "nothing was recorded"
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(Exception), recording.open("rb") as file:  # noqa: B017
        make_reader(file).get_summary()
    answer = subprocess.run(
        [server, "recover", recording, "--json"],
        check=True,
        capture_output=True,
        timeout=60,
    )
    report = json.loads(answer.stdout)
    recovered = tmp_path / "run.recovered.mcap"
    assert (
        report["was_torn"]
        and report["attachments"] == 1
        and report["metadata_records"] == 1
    )
    found = messages(recovered)
    assert len(found) == report["messages"] > 1000
    states = [(at, m) for topic, at, m in found if topic == "/truck/state"]
    steps = {b[0] - a[0] for a, b in pairwise(states)}
    assert steps == {10_000_000}, "no tick is missing before the tear"
    with recovered.open("rb") as file:
        reader = make_reader(file)
        assert [a.name for a in reader.iter_attachments()] == ["scenario.toml"]
        assert [m.name for m in reader.iter_metadata()] == ["run"]
