"""A node of another make (rclpy), what it hears, and the program that it watches."""

import os
import random
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, NavSatFix
from simulation_interfaces.msg import SimulationState
from simulation_interfaces.srv import (
    GetSimulationState,
    SetSimulationState,
    StepSimulation,
)
from tf2_msgs.msg import TFMessage
from truck_msgs.msg import PlanState, Scene, TruckState
from visualization_msgs.msg import MarkerArray

SERVER = os.environ["SIM_SERVER"]
# Two test runs on one machine must not meet
DOMAIN = random.Random(os.getpid()).randrange(1, 100)
DISCOVERY_S = 20.0
RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=64,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
TOPICS: dict[str, tuple[Any, QoSProfile]] = {
    "/clock": (Clock, RELIABLE),
    "/tf": (TFMessage, RELIABLE),
    "/tf_static": (TFMessage, LATCHED),
    "/odom": (Odometry, RELIABLE),
    "/imu": (Imu, RELIABLE),
    "/fix": (NavSatFix, RELIABLE),
    "/diagnostics": (DiagnosticArray, RELIABLE),
    "/truck/state": (TruckState, RELIABLE),
    "/truck/plan": (PlanState, RELIABLE),
    "/plan/path": (PathMessage, RELIABLE),
    "/scene": (Scene, RELIABLE),
    "/markers": (MarkerArray, RELIABLE),
    "/road/lanes": (MarkerArray, LATCHED),
}


def ns(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


class Peer:
    """A node with an executor of its own, and what it heard."""

    def __init__(self) -> None:
        rclpy.init(domain_id=DOMAIN)
        self.node = Node("peer")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {name: [] for name in [*TOPICS, "/rosout"]}
        for name, (kind, qos) in TOPICS.items():
            self.node.create_subscription(kind, name, self.heard[name].append, qos)
        self.node.create_subscription(
            Log, "/rosout", self.heard["/rosout"].append, LATCHED
        )
        self.services: dict[str, Any] = {}

    def until(
        self, done: Callable[[], bool], what: str, within_s: float = 60.0
    ) -> None:
        end = time.monotonic() + within_s
        while not done():
            assert time.monotonic() < end, f"{what}: not within {within_s} s"
            self.executor.spin_once(timeout_sec=0.05)

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.05)

    def call(self, kind: Any, name: str, **fields: Any) -> Any:
        if name not in self.services:
            self.services[name] = self.node.create_client(kind, name)
            self.until(self.services[name].service_is_ready, name, DISCOVERY_S)
            # A client knows the server before the server knows it: an answer would be lost
            self.wait(1.0)
        client = self.services[name]
        future = client.call_async(kind.Request(**fields))
        self.until(future.done, name)
        return future.result()

    def state(self) -> int:
        return int(self.call(GetSimulationState, "/get_simulation_state").state.state)

    def set_state(self, state: int) -> Any:
        wish = SimulationState(state=state)
        return self.call(SetSimulationState, "/set_simulation_state", state=wish).result

    def clock_ns(self) -> int:
        return ns(self.heard["/clock"][-1].clock)

    def settled_clock_ns(self) -> int:
        """The clock, once nothing more comes."""
        while True:
            before = len(self.heard["/clock"])
            self.wait(0.5)
            if len(self.heard["/clock"]) == before:
                return self.clock_ns()

    def step(self, steps: int) -> Any:
        return self.call(StepSimulation, "/step_simulation", steps=steps).result


@contextmanager
def running(*options: str, domain: int = DOMAIN) -> Iterator[subprocess.Popen[str]]:
    """A run in real time with its node, killed at the end."""
    ours = ("--headless", "--pace", "realtime", "--ros2")
    process = program(*options, *ours, domain=domain)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def joined() -> Iterator[Peer]:
    """A peer that hears the clock of the run."""
    peer = Peer()
    try:
        peer.until(lambda: bool(peer.heard["/clock"]), "the clock", DISCOVERY_S)
        yield peer
    finally:
        peer.node.destroy_node()
        rclpy.shutdown()


def program(*options: str, domain: int = DOMAIN) -> subprocess.Popen[str]:
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    for name in ("LD_LIBRARY_PATH", "PYTHONPATH"):
        environment.pop(name, None)
    return subprocess.Popen(
        [SERVER, "run", *options],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
