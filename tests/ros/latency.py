"""Round trips and losses between rclpy and the node of `sim-server --ros2`, in one run with rclpy's own.

    . VENV/peer.env
    SIM_SERVER=target/release/sim-server VENV/bin/python tests/ros/latency.py

Prints a table (Markdown). For the figures in docs/results, not a test: the times are the machine's.
"""

import itertools
import multiprocessing
import os
import random
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from simulation_interfaces.srv import GetSimulationState

CALLS = 2_000
TICKS = 10_000
WAIT_S = 60.0
RELIABLE = QoSProfile(depth=TICKS, reliability=ReliabilityPolicy.RELIABLE)


def serve(domain: int, name: str, ready: Any) -> None:
    """The same service and clock from rclpy, in a process of its own."""
    rclpy.init(domain_id=domain)
    node = Node("peer_server")
    node.create_service(GetSimulationState, name, lambda _, answer: answer)
    publisher = node.create_publisher(Clock, "/peer_clock", RELIABLE)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    ready.set()
    message, sent = Clock(), 0

    def tick() -> None:
        nonlocal sent
        if publisher.get_subscription_count() > 0:
            sent += 1
            message.clock.sec, message.clock.nanosec = divmod(sent * 10_000_000, 10**9)
            publisher.publish(message)

    node.create_timer(0.001, tick)
    executor.spin()


def until(
    executor: SingleThreadedExecutor, done: Callable[[], bool], what: str
) -> None:
    end = time.monotonic() + WAIT_S
    while not done():
        if time.monotonic() > end:
            raise TimeoutError(what)
        executor.spin_once(timeout_sec=0.01)


def round_trips_us(
    node: Node, executor: SingleThreadedExecutor, name: str
) -> list[float]:
    client = node.create_client(GetSimulationState, name)
    until(executor, client.service_is_ready, name)
    # The server learns of the client a little later
    settled = time.monotonic() + 1.0
    until(executor, lambda: time.monotonic() > settled, name)
    times = []
    for _ in range(CALLS):
        start = time.perf_counter()
        future = client.call_async(GetSimulationState.Request())
        until(executor, future.done, name)
        times.append((time.perf_counter() - start) * 1e6)
    return times


def lost(node: Node, executor: SingleThreadedExecutor, name: str) -> tuple[int, float]:
    """Of `TICKS` messages the ones that did not come, and how many came in a second."""
    heard: list[int] = []
    subscription = node.create_subscription(
        Clock,
        name,
        lambda m: heard.append(m.clock.sec * 100 + m.clock.nanosec // 10_000_000),
        RELIABLE,
    )
    until(executor, lambda: len(heard) > 0, name)
    start, first = time.perf_counter(), heard[-1]
    until(executor, lambda: heard[-1] >= first + TICKS, name)
    rate_hz = (heard[-1] - first) / (time.perf_counter() - start)
    node.destroy_subscription(subscription)
    counted = [tick for tick in heard if first <= tick < first + TICKS]
    gaps = sum(b - a - 1 for a, b in itertools.pairwise(counted))
    return gaps, rate_hz


def main() -> None:
    domain = random.Random(os.getpid()).randrange(100, 200)
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    for name in ("LD_LIBRARY_PATH", "PYTHONPATH"):
        environment.pop(name, None)
    spawn = multiprocessing.get_context("spawn")
    ready = spawn.Event()
    peer = spawn.Process(target=serve, args=(domain, "/peer_state", ready), daemon=True)
    peer.start()
    ready.wait(WAIT_S)
    with tempfile.TemporaryDirectory() as folder:
        options = ["highway", "--headless", "--pace", "10", "--ros2"]
        command = [os.environ["SIM_SERVER"], "run", *options]
        program = subprocess.Popen(
            [*command, "--out", Path(folder) / "out"],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            rclpy.init(domain_id=domain)
            node = Node("measuring")
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            print(f"load {os.getloadavg()[0]:.2f} on {os.cpu_count()} cores\n")
            print(
                "| to rclpy from | lost of 10,000 | at Hz | round trip p50 us | p99 us |"
            )
            print("|---|---|---|---|---|")
            for who, service, clock in (
                ("tractrix", "/get_simulation_state", "/clock"),
                ("rclpy", "/peer_state", "/peer_clock"),
            ):
                gone, rate_hz = lost(node, executor, clock)
                times = statistics.quantiles(
                    round_trips_us(node, executor, service), n=100
                )
                print(
                    f"| {who} | {gone} | {rate_hz:.0f} | {times[49]:.0f} | {times[98]:.0f} |"
                )
        finally:
            program.kill()
            program.wait()
            peer.kill()


if __name__ == "__main__":
    main()
