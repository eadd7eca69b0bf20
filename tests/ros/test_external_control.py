"""Another controller drives the truck over ROS 2, falls silent, and gives the truck back."""

import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from autoware_control_msgs.msg import Control
from peers import DISCOVERY_S, Peer, joined, running
from std_msgs.msg import Bool


@pytest.fixture
def run(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    with running("flat", "--out", str(tmp_path / "out")) as run:
        yield run


@pytest.fixture
def peer(run: subprocess.Popen[str]) -> Iterator[Peer]:
    with joined() as peer:
        yield peer


def test_a_controller_drives_and_a_silent_one_stops_the_truck(peer: Peer) -> None:
    control = peer.node.create_publisher(Control, "/control/command/control_cmd", 1)
    engaged = peer.node.create_publisher(Bool, "/command/external_control", 1)
    peer.until(
        lambda: control.get_subscription_count() > 0 < engaged.get_subscription_count(),
        "its ears",
        DISCOVERY_S,
    )
    peer.until(lambda: bool(peer.heard["/truck/state"]), "the truck")

    def speed() -> float:
        return float(peer.heard["/truck/state"][-1].speed_m_s)

    def maneuver() -> str:
        return str(peer.heard["/truck/plan"][-1].maneuver)

    without = Control()
    without.longitudinal.velocity = 20.0
    control.publish(without)
    peer.until(
        lambda: any(
            "a speed alone is not driven" in m.msg for m in peer.heard["/rosout"]
        ),
        "a complaint",
    )
    before, end = speed(), time.monotonic() + 3.0
    driven: set[str] = set()
    while time.monotonic() < end:
        command = Control()
        command.longitudinal.acceleration = -1.0
        command.longitudinal.is_defined_acceleration = True
        control.publish(command)
        peer.executor.spin_once(timeout_sec=0.02)
        driven.add(maneuver())
    assert driven == {"keep_lane"}
    assert 2.0 < before - speed() < 4.0
    peer.until(lambda: maneuver() == "minimal_risk", "the minimal-risk manoeuvre", 5.0)
    engaged.publish(Bool(data=False))
    peer.until(lambda: maneuver() == "keep_lane", "the stack at the wheel", 5.0)
