"""The frames of the bus that a truck is driven over, as another make of node hears them."""

import subprocess
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from can_msgs.msg import Frame
from peers import DISCOVERY_S, RELIABLE, Peer, joined, ns, running

# EEC1 of the engine; TSC1 to it of the stack, which has address 0x27
EEC1, TSC1_PGN, STACK = 0x0CF00400, 0x0000, 0x27
TICK_NS = 10_000_000


@pytest.fixture
def run(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    with running("flat", "--vehicle", "bus", "--out", str(tmp_path / "out")) as run:
        yield run


@pytest.fixture
def peer(run: subprocess.Popen[str]) -> Iterator[Peer]:
    with joined() as peer:
        yield peer


def pgn_and_source(identifier: int) -> tuple[int, int]:
    """Of a group that goes to one address its destination is left out."""
    pgn = identifier >> 8 & 0x3FFFF
    return (pgn if pgn >> 8 & 0xFF >= 0xF0 else pgn & 0x3FF00), identifier & 0xFF


def test_frames_say_what_the_truck_does_and_what_the_stack_asks_for(peer: Peer) -> None:
    frames: list[Any] = []
    peer.node.create_subscription(Frame, "/can/bus/frames", frames.append, RELIABLE)
    peer.until(lambda: bool(frames), "the first frame", DISCOVERY_S)
    peer.until(lambda: bool(peer.heard["/truck/state"]), "the truck", DISCOVERY_S)
    # The three seconds before are driven at once, and thinned out, on a loaded machine for a while:
    # one frame was missing there, the first.
    peer.wait(1.0)
    first = ns(peer.heard["/truck/state"][-1].header.stamp)
    peer.wait(8.0)
    assert dict(peer.node.get_topic_names_and_types())["/can/bus/frames"] == [
        "can_msgs/msg/Frame"
    ]
    assert all(f.is_extended and not f.is_rtr and not f.is_error for f in frames)
    frames = [f for f in frames if ns(f.header.stamp) > first]
    engine = [f for f in frames if f.id == EEC1 and f.header.frame_id == "received"]
    stamps = [ns(f.header.stamp) for f in engine]
    # A frame comes every 10 ms and takes its time on the wire: none is missing or there twice
    steps = [b - a for a, b in pairwise(stamps)]
    assert len(engine) > 500
    assert max(steps) < 2 * TICK_NS
    assert min(steps) > 0
    # SPN 190, 1/8 rpm, against the topic of the truck at that time; the truck is a tick or two on
    states = {
        ns(s.header.stamp) // TICK_NS: s.engine_speed_rpm
        for s in peer.heard["/truck/state"]
    }
    compared = 0
    for frame in engine:
        at = ns(frame.header.stamp) // TICK_NS
        around = [states[k] for k in range(at - 3, at + 4) if k in states]
        if len(around) < 7:
            continue
        said = int.from_bytes(bytes(frame.data[3:5]), "little") / 8.0
        assert min(around) - 1.0 <= said <= max(around) + 1.0, (at, said, around)
        compared += 1
    assert compared > 400
    sent = [f for f in frames if f.header.frame_id == "sent"]
    assert (TSC1_PGN, STACK) in {pgn_and_source(f.id) for f in sent}
