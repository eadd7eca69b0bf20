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
from rosbags.highlevel import AnyReader

TICKS = 2000


def messages(path: Path, *topics: str) -> list[tuple[str, int, Any]]:
    """Topic, time in nanoseconds and decoded message, in order of time."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = reader.iter_decoded_messages(topics=list(topics) or None)
        return [
            (channel.topic, raw.log_time, decoded) for _, channel, raw, decoded in found
        ]


AHEAD = (1.0, 0.0, 0.0)


def turned_by(q: Any, v: tuple[float, float, float]) -> tuple[float, float, float]:
    """A vector turned by a quaternion, by the rotation matrix."""
    x, y, z, w = q.x, q.y, q.z, q.w
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    a, b, c = (sum(m * n for m, n in zip(row, v, strict=True)) for row in rows)
    return a, b, c


def heading(v: tuple[float, float, float]) -> float:
    """Yaw of a direction, rad."""
    return math.atan2(v[1], v[0])


def climb(q: Any) -> float:
    """Angle of a body's axis above the horizon, rad."""
    return math.asin(turned_by(q, AHEAD)[2])


def test_every_tick_of_the_run_is_in_the_recording_once(short_run: Path) -> None:
    counts = Counter(topic for topic, _, _ in messages(short_run / "run.mcap"))
    for topic in ("/clock", "/tf", "/odom", "/imu", "/truck/state", "/truck/plan"):
        assert counts[topic] == TICKS, (topic, counts)
    for topic in ("/plan/path", "/scene", "/markers"):
        assert counts[topic] == TICKS / 10, (topic, counts)
    assert counts["/diagnostics"] == TICKS / 100, counts
    assert counts["/tf_static"] == 1
    assert counts["/fix"] == TICKS / 10, counts


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
        tractor_yaw = heading(turned_by(base.transform.rotation, AHEAD))
        trailer_yaw = heading(
            turned_by(
                base.transform.rotation, turned_by(trailer.transform.rotation, AHEAD)
            )
        )
        assert math.remainder(
            trailer_yaw - tractor_yaw - t.articulation_rad, math.tau
        ) == pytest.approx(0.0, abs=1e-9)
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


def test_bodies_are_pitched_as_the_road_climbs(short_run: Path) -> None:
    """Markers lay flat on hills: yaw only."""
    path = short_run / "run.mcap"
    truck = {at: m for _, at, m in messages(path, "/truck/state")}
    grades = []
    for _, at, array in messages(path, "/markers"):
        state = truck[at]
        tractor, trailer = (m for m in array.markers if m.ns == "ego")
        assert climb(tractor.pose.orientation) == pytest.approx(
            state.grade_rad, abs=1e-3
        )
        assert climb(trailer.pose.orientation) == pytest.approx(
            state.grade_rad, abs=1e-2
        )
        grades.append(state.grade_rad)
    assert max(map(abs, grades)) > 2e-3, "the run must meet a hill"


def test_no_covariance_says_that_a_value_cannot_be_wrong(short_run: Path) -> None:
    for _, _, m in messages(short_run / "run.mcap", "/odom"):
        for covariance in (m.pose.covariance, m.twist.covariance):
            assert all(covariance[7 * i] > 0.0 for i in range(6))


def test_lane_lines_lie_beside_the_truck_and_come_in_small_messages(
    short_run: Path,
) -> None:
    path = short_run / "run.mcap"
    lanes = messages(path, "/road/lanes")
    assert lanes[0][1] == 0 and lanes[-1][1] >= 10_000_000_000, "sent again for joiners"
    with path.open("rb") as file:
        sizes = [
            len(raw.data)
            for _, _, raw in make_reader(file).iter_messages(topics=["/road/lanes"])
        ]
    assert max(sizes) < 100_000
    first = [m for _, at, array in lanes if at == 0 for m in array.markers]
    assert len({m.id for m in first}) == len(first)
    assert {m.type for m in first} == {4, 5}, (
        "strips at the edges, dashes between lanes"
    )
    points = [(p.x, p.y) for m in first for p in m.points]
    for _, _, m in messages(path, "/odom")[::200]:
        at = m.pose.pose.position
        near = min(math.dist(p, (at.x, at.y)) for p in points)
        assert 1.0 < near < 6.0, "half a lane to the next line, and no line under it"
    again = [m for _, at, array in lanes if at > 0 for m in array.markers]
    assert {m.id for m in again} <= {m.id for m in first}


def test_frames_that_do_not_change_are_sent_once(short_run: Path) -> None:
    [(_, at, message)] = messages(short_run / "run.mcap", "/tf_static")
    parents = {t.child_frame_id: t.header.frame_id for t in message.transforms}
    assert at == 0 and parents["map"] == "earth", "the built-in roads lie on it"
    assert parents["hitch"] == "base_link" and parents["trailer_axles"] == "trailer"
    [dynamic, *_] = messages(short_run / "run.mcap", "/tf")
    trailer = dynamic[2].transforms[1].transform.translation
    hitch = next(t for t in message.transforms if t.child_frame_id == "hitch")
    assert hitch.transform.translation.x == trailer.x


ROAD = """<OpenDRIVE>
<header revMajor="1" revMinor="7" name="straight"><geoReference>{}</geoReference>
<offset x="{}" y="{}" z="0" hdg="0.3"/></header>
<road name="straight" length="3000" id="1" junction="-1"><planView>
<geometry s="0" x="100" y="50" hdg="0.4" length="3000"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="300" b="0.02" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="3.75" b="0" c="0" d="0"/></lane>
<lane id="-2" type="driving"><width sOffset="0" a="3.75" b="0" c="0" d="0"/></lane>
</right></laneSection></lanes></road></OpenDRIVE>
"""


def run_on(
    server: Path, folder: Path, projection: str, x: float, y: float
) -> tuple[Path, str]:
    """A recording on a road with a geo reference, and what the program said."""
    road = folder / "straight.xodr"
    road.write_text(ROAD.format(projection, x, y))
    out = folder / "run"
    command: list[str | Path] = [server, "run", "highway-empty", "--headless"]
    command += ["--road", road, "--duration", "5", "--out", out]
    done = subprocess.run(command, check=True, capture_output=True, timeout=60)
    return out / "run.mcap", done.stderr.decode()


@pytest.mark.parametrize(
    ("projection", "x", "y"),
    [
        ("+proj=utm +zone=32 +datum=WGS84 +units=m", 690_000.0, 5_340_000.0),
        ("+proj=tmerc +lat_0=48 +lon_0=11 +k=0.9996 +ellps=GRS80", 1500.0, -700.0),
    ],
)
def test_a_road_on_the_earth_gives_a_fix_as_proj_computes_it(
    server: Path, tmp_path: Path, projection: str, x: float, y: float
) -> None:
    pyproj = pytest.importorskip("pyproj")
    path, _ = run_on(server, tmp_path, projection, x, y)
    to_earth = pyproj.Transformer.from_crs(projection, "EPSG:4326", always_xy=True)
    positions = {at: m.pose.pose.position for _, at, m in messages(path, "/odom")}
    fixes = messages(path, "/fix")
    assert len(fixes) == 50
    for _, at, fix in fixes:
        p = positions[at]
        cos, sin = math.cos(0.3), math.sin(0.3)
        east, north = x + cos * p.x - sin * p.y, y + sin * p.x + cos * p.y
        longitude, latitude = to_earth.transform(east, north)
        assert fix.latitude == pytest.approx(latitude, abs=1e-9), "0.1 mm"
        assert fix.longitude == pytest.approx(longitude, abs=1e-9)
        assert fix.altitude == pytest.approx(p.z, abs=1e-6)
        assert fix.position_covariance_type == 0, "unknown"
    [(_, _, static)] = messages(path, "/tf_static")
    [earth] = [t for t in static.transforms if t.child_frame_id == "map"]
    q, move = earth.transform.rotation, earth.transform.translation
    first = fixes[0][2]
    to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    want = to_ecef.transform(first.longitude, first.latitude, first.altitude)
    p = positions[fixes[0][1]]
    turned = turned_by(q, (p.x, p.y, p.z))
    got = (move.x + turned[0], move.y + turned[1], move.z + turned[2])
    assert math.dist(got, want) < 0.05, "the truck starts where the frame is exact"


def test_a_projection_that_is_not_known_is_said_once(
    server: Path, tmp_path: Path
) -> None:
    path, said = run_on(server, tmp_path, "+lat_0=49 +lon_0=8", 0.0, 0.0)
    assert said.count("geoReference") == 1 and "+lat_0=49 +lon_0=8" in said
    topics = {topic for topic, _, _ in messages(path)}
    assert "/fix" not in topics and "/odom" in topics


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
        while not recording.exists() or recording.stat().st_size < 500_000:
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
        and report["attachments"] == 2
        and report["metadata_records"] == 1
    )
    found = messages(recovered)
    assert len(found) == report["messages"] > 1000
    states = [(at, m) for topic, at, m in found if topic == "/truck/state"]
    steps = {b[0] - a[0] for a, b in pairwise(states)}
    assert steps == {10_000_000}, "no tick is missing before the tear"
    with recovered.open("rb") as file:
        reader = make_reader(file)
        attached = [a.name for a in reader.iter_attachments()]
        assert attached == ["scenario.toml", "stack.toml"]
        assert [m.name for m in reader.iter_metadata()] == ["run"]


def test_rosbags_reads_every_topic_too(short_run: Path) -> None:
    """A third reader, which takes the types from the file as ROS' own tools do."""
    decoded: Counter[str] = Counter()
    with AnyReader([short_run / "run.mcap"]) as reader:
        topics = {connection.topic for connection in reader.connections}
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            decoded[connection.topic] += 1
    counts = Counter(topic for topic, _, _ in messages(short_run / "run.mcap"))
    assert decoded == counts and set(counts) <= topics
