"""The same over ROS 2 and over HTTP: begin, 1000 steps, a lane change, on, an end; the same bits.

That HTTP has the bits of a world in Python: `python/tests/test_client.py`.
"""

import json
import re
import urllib.request
from pathlib import Path
from typing import Any

from peers import DOMAIN, joined, program, running
from simulation_interfaces.msg import Result, SimulationState
from simulation_interfaces.srv import ResetSimulation
from std_msgs.msg import String

DRIVE = ("medium-15", "--decider", "external", "--seed", "7", "--out")


def over_ros(out: Path) -> str:
    """The hash of the second run of a program that is commanded over ROS 2."""
    with running(*DRIVE, str(out), domain=DOMAIN), joined() as peer:
        lane = peer.node.create_publisher(String, "/command/lane_change", 1)
        assert peer.set_state(SimulationState.STATE_PAUSED).result == Result.RESULT_OK
        reset = peer.call(ResetSimulation, "/reset_simulation")
        assert reset.result.result == Result.RESULT_OK
        assert peer.step(1000).result == Result.RESULT_OK
        peer.until(lambda: lane.get_subscription_count() == 1, "the command")
        # The reader knows the writer a little later
        peer.wait(1.0)
        lane.publish(String(data="left"))
        peer.wait(1.0)
        assert peer.step(1000).result == Result.RESULT_OK
        assert peer.set_state(SimulationState.STATE_STOPPED).result == Result.RESULT_OK
        assert "refused" not in " ".join(line.msg for line in peer.heard["/rosout"])
    return hash_of(out)


def over_http(out: Path) -> str:
    """The same over HTTP."""
    process = program(*DRIVE, str(out), "--port", "0")
    try:
        assert process.stderr is not None
        address = None
        while address is None:
            address = re.search(r"http://[0-9.:]+", process.stderr.readline())
        url = f"{address.group()}/api/v1/control"

        def command(**keys: Any) -> None:
            head = {"Content-Type": "application/json"}
            body = json.dumps(keys).encode()
            request = urllib.request.Request(url, body, head)
            urllib.request.urlopen(request, timeout=60).close()

        command(action="pause")
        command(action="reset")
        command(action="step", ticks=1000, wait=True)
        command(action="lane_change", to="left")
        command(action="step", ticks=1000, wait=True)
        command(action="stop")
    finally:
        process.kill()
        process.wait()
    return hash_of(out)


def hash_of(out: Path) -> str:
    """That of the run behind the first reset."""
    summary: dict[str, Any] = json.loads((out / "run-2" / "summary.json").read_text())
    assert summary["duration_s"] > 19.9
    return str(summary["state_hash"])


def test_the_same_commands_give_the_same_bits(tmp_path: Path) -> None:
    assert over_ros(tmp_path / "ros") == over_http(tmp_path / "http")
