"""A node of ROS 2 Jazzy beside the program: every topic of a standard type, the clock, commands.

    python3.11 -m venv .venv-jazzy && .venv-jazzy/bin/pip install -r tests/ros/jazzy-requirements.txt
    .venv-jazzy/bin/python tests/ros/jazzy.py target/release/sim-server

By hand: Kilted is the peer of `./test`, with the types and services that no wheel brings. Prints
what was heard, and fails where something is missing.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

# Before rclpy reads it
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
DOMAIN = random.Random(os.getpid()).randrange(100, 200)

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, NavSatFix
from std_msgs.msg import Float64, String
from visualization_msgs.msg import MarkerArray

RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=64,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# Type, quality, and messages a second of simulation time (0: now and then)
TOPICS: dict[str, tuple[Any, QoSProfile, int]] = {
    "/clock": (Clock, RELIABLE, 100),
    "/odom": (Odometry, RELIABLE, 100),
    "/imu": (Imu, RELIABLE, 100),
    "/fix": (NavSatFix, RELIABLE, 10),
    "/plan/path": (PathMessage, RELIABLE, 10),
    "/markers": (MarkerArray, RELIABLE, 10),
    "/diagnostics": (DiagnosticArray, RELIABLE, 1),
    "/road/lanes": (MarkerArray, LATCHED, 0),
}
DISCOVERY_S = 30.0
LISTEN_S = 10.0
TICK_NS = 10_000_000


def ns(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"ROS_DOMAIN_ID": str(DOMAIN)}
        for name in ("LD_LIBRARY_PATH", "PYTHONPATH"):
            environment.pop(name, None)
        command = [sys.argv[1], "run", "--headless", "--pace", "realtime", "--ros2"]
        command += ["--seed", "1", "--out", str(Path(folder) / "out")]
        with subprocess.Popen(command, env=environment) as program:
            try:
                look()
            finally:
                program.terminate()
    return 0


def look() -> None:
    """Listens, commands and judges."""
    rclpy.init(domain_id=DOMAIN)
    node = Node("jazzy")
    heard: dict[str, list[Any]] = {name: [] for name in [*TOPICS, "/rosout"]}
    for name, (kind, qos, _) in TOPICS.items():
        node.create_subscription(kind, name, heard[name].append, qos)
    node.create_subscription(Log, "/rosout", heard["/rosout"].append, LATCHED)
    speed = node.create_publisher(Float64, "/command/set_speed", 1)
    lane = node.create_publisher(String, "/command/lane_change", 1)

    def until(done: Callable[[], bool], what: str, within_s: float) -> None:
        end = time.monotonic() + within_s
        while not done():
            assert time.monotonic() < end, f"{what}: not within {within_s} s"
            rclpy.spin_once(node, timeout_sec=0.05)

    until(lambda: all(heard[name] for name in TOPICS), "every topic", DISCOVERY_S)
    first = ns(heard["/clock"][-1].clock)
    end_ns = first + int(LISTEN_S * 1e9)
    began = {name: len(heard[name]) for name in TOPICS}
    until(lambda: ns(heard["/clock"][-1].clock) >= end_ns, "the clock", 10 * LISTEN_S)
    times = [ns(clock.clock) for clock in heard["/clock"]]
    missing = sum((b - a) // TICK_NS - 1 for a, b in pairwise(times))
    for name, (_, _, rate_hz) in TOPICS.items():
        count = len(heard[name]) - began[name]
        print(f"{name}: {count} in {LISTEN_S:.0f} s, {rate_hz * LISTEN_S:.0f} expected")
        assert count >= 0.9 * rate_hz * LISTEN_S, name
    print(f"{missing} of {len(times)} ticks missing")
    assert missing == 0
    kinds = dict(node.get_topic_names_and_types())
    assert all(len(kinds[name]) == 1 for name in TOPICS), kinds
    until(lambda: speed.get_subscription_count() == 1, "the command", DISCOVERY_S)
    # A publisher knows the reader before the reader knows it
    time.sleep(1.0)
    lane.publish(String(data="left"))
    refused = "set_decider can make it external"
    until(
        lambda: any(refused in line.msg for line in heard["/rosout"]),
        "the refusal of a lane change",
        DISCOVERY_S,
    )
    before = heard["/odom"][-1].twist.twist.linear.x
    speed.publish(Float64(data=max(0.0, before - 3.0)))
    until(
        lambda: heard["/odom"][-1].twist.twist.linear.x < before - 1.0,
        "a slower truck",
        120.0,
    )
    print(f"slower: {before:.1f} to {heard['/odom'][-1].twist.twist.linear.x:.1f} m/s")
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    sys.exit(main())
