"""`--foxglove`, seen by a viewer: the recording's bytes, time, services, commands, parameters, refusals.

`SIM_SERVER` names the program.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from shown import SERVER, recorded, running
from viewer import connected
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol


def test_a_viewer_gets_the_recordings_channels_schemas_and_bytes(
    tmp_path: Path,
) -> None:
    out = tmp_path / "out"
    options = ("--seed", "7", "--pace", "1")
    with running(out, *options) as run, connected(run.url) as viewer:
        assert viewer.call("/pause")["state"] == "paused"
        viewer.subscribe_all()
        assert viewer.call("/pace", pace=20)["state"] == "paused"
        before = viewer.call("/step", ticks=1)
        after = viewer.call("/step", ticks=300)
        assert after["tick"] == before["tick"] + 300
        viewer.drain()
        run.end()
        seen, channels, times_ns = viewer.messages, viewer.channels, viewer.times_ns
    topics, messages = recorded(out / "run.mcap")
    ours = {topic for topic in topics if not topic.startswith("/stack/")}
    assert set(channels) == ours and len(ours) > 10
    for topic, channel in channels.items():
        name, encoding, definition = topics[topic]
        assert (channel["encoding"], channel["schemaName"]) == ("cdr", name)
        assert channel["schemaEncoding"] == encoding == "ros2msg"
        assert channel["schema"].encode() == definition, topic
    assert len(seen) >= 1000
    stepped_ns = {said.time_ns for said in seen if said.topic == "/clock"}
    expected = [
        said
        for said in messages
        if said.topic in ours
        and (said.time_ns in stepped_ns or said.topic in ("/tf_static", "/road/lanes"))
    ]
    for topic in ours:
        got = [(said.time_ns, said.data) for said in seen if said.topic == topic]
        wanted = [(said.time_ns, said.data) for said in expected if said.topic == topic]
        assert got == wanted, topic
    assert len(stepped_ns) >= 301
    assert times_ns == sorted(times_ns) and times_ns[-1] <= max(stepped_ns)


def test_services_are_the_commands_of_the_api(tmp_path: Path) -> None:
    with running(tmp_path / "out", "--seed", "7") as run:
        with connected(run.url) as viewer:
            assert {"/play", "/pause", "/step", "/reset"} <= set(viewer.services)
            refused = viewer.call("/step", ticks=5)
            assert "pause it first" in refused["failure"]
            assert viewer.call("/pause")["state"] == "paused"
            assert "ticks = 0" in viewer.call("/step", ticks=0)["failure"]
            assert "extra" in viewer.call("/play", extra=1)["failure"]
            sessions = len(viewer.info)
            viewer.subscribe_all()
            assert viewer.call("/reset", seed=8) == {
                "schema": 1,
                "tick": 0,
                "time_s": 0.0,
                "state": "paused",
            }
            assert viewer.call("/step", ticks=10)["tick"] == 10
            # Viewers forget the run before when the session has another id
            assert len(viewer.info) == sessions + 1
            assert viewer.info[-1]["sessionId"] != viewer.info[0]["sessionId"]
            viewer.until(lambda: any(s.topic == "/clock" for s in viewer.messages))
            first = next(s for s in viewer.messages if s.topic == "/clock")
            assert first.time_ns == 0
            assert viewer.call("/play")["state"] == "playing"
            assert viewer.call("/stop")["state"] == "stopped"
        run.end()
    summary = json.loads((tmp_path / "out" / "run-2" / "summary.json").read_text())
    assert summary["seed"] == 8


def test_a_published_command_acts_and_a_wrong_one_is_refused_with_words(
    tmp_path: Path,
) -> None:
    with running(tmp_path / "out", "--seed", "7") as run:
        with connected(run.url) as viewer:
            viewer.call("/pause")
            viewer.call("/step", ticks=20)
            viewer.publish(1, "/command/set_speed", 15.0)
            viewer.publish(2, "/command/set_speed", 99)
            viewer.until(lambda: bool(viewer.statuses))
            assert "speed_m_s = 99: expected a speed" in viewer.statuses[-1]
            viewer.publish(3, "/command/fly", True)
            viewer.until(lambda: len(viewer.statuses) >= 2)
            assert "/command/fly commands nothing" in viewer.statuses[1]
            viewer.publish(4, "/command/lane_change", "left")
            viewer.until(
                lambda: "set_decider can make it external" in viewer.statuses[-1]
            )
            viewer.call("/step", ticks=20)
        run.end()
    with (tmp_path / "out" / "run.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = reader.iter_decoded_messages(topics=["/stack/input"])
        speeds = [message.decoded_message.set_speed_m_s for message in found]
    assert speeds[-1] == 15.0 and speeds[0] != 15.0


def test_a_viewer_of_the_old_protocol_is_refused_in_the_log(tmp_path: Path) -> None:
    with running(tmp_path / "out") as run:
        with pytest.raises(InvalidStatus):
            old = [Subprotocol("foxglove.websocket.v1")]
            with connect(run.url, subprotocols=old):
                pass
        said = run.end()
    assert "a viewer must offer foxglove.sdk.v1" in said


def test_pages_of_other_sites_and_foreign_names_are_refused(tmp_path: Path) -> None:
    with running(tmp_path / "out", "--foxglove-origin", "file://") as run:
        new = [Subprotocol("foxglove.sdk.v1")]
        port = run.url.rsplit(":", 1)[1]
        own = ("http://localhost:8080", "https://app.foxglove.dev", "file://")
        for origin in own:
            with connect(run.url, subprotocols=new, origin=Origin(origin)) as viewer:
                assert json.loads(viewer.recv(timeout=10))["op"] == "serverInfo", origin
        for origin in ("null", "http://evil.example", "https://localhost.evil.example"):
            with pytest.raises(InvalidStatus) as refused:
                connect(run.url, subprotocols=new, origin=Origin(origin))
            assert refused.value.response.status_code == 403, origin
            words = refused.value.response.body.decode()
            assert origin in words and ("--foxglove-origin" in words) == (
                origin != "null"
            )
        # A foreign name that leads here (DNS rebinding)
        with (
            socket.create_connection(("127.0.0.1", int(port)), timeout=10) as raw,
            pytest.raises(InvalidStatus) as refused,
        ):
            connect(f"ws://evil.example:{port}", subprotocols=new, sock=raw)
        assert refused.value.response.status_code == 403
        # No name, two names, two origins, and what is no request
        one, page = "Host: localhost\r\n", "Origin: http://localhost\r\n"
        for lines in ("", one * 2, one + page * 2, "\0: \0\r\n"):
            with socket.create_connection(("127.0.0.1", int(port)), timeout=10) as raw:
                raw.sendall(f"GET / HTTP/1.1\r\n{lines}\r\n".encode())
                assert raw.recv(1000).startswith(b"HTTP/1.1 403 "), lines
        said = run.end()
    assert "refused a viewer: origin" in said


def test_who_only_opens_connections_keeps_no_viewer_out_for_long(
    tmp_path: Path,
) -> None:
    with running(tmp_path / "out", "--pace", "1") as run:
        address = ("127.0.0.1", int(run.url.rsplit(":", 1)[1]))
        idle = [socket.create_connection(address, timeout=20) for _ in range(16)]
        with socket.create_connection(address, timeout=10) as late:
            assert late.recv(1000).startswith(b"HTTP/1.1 503 ")
        for silent in idle:
            assert silent.recv(1000).startswith(b"HTTP/1.1 408 ")
            silent.close()
        with connected(run.url) as viewer:
            assert viewer.call("/pause")["state"] == "paused"
        with socket.create_connection(address, timeout=10) as long:
            long.sendall(b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 2000)
            assert long.recv(1000).startswith(b"HTTP/1.1 431 ")
        run.end()


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    with running(tmp_path / "out") as run:
        port = run.url.rsplit(":", 1)[1]
        again = subprocess.run(
            [SERVER, "run", "--headless", "--foxglove", port, "--out", tmp_path / "b"],
            check=False,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert again.returncode == 2 and len(again.stderr.splitlines()) == 1
        assert f"port {port} on 127.0.0.1 is in use" in again.stderr
        run.end()


def test_viewers_change_no_bit_of_the_run(tmp_path: Path) -> None:
    options = ("--seed", "7", "--duration", "8")
    alone = subprocess.run(
        [SERVER, "run", "--headless", "--json", *options, "--out", tmp_path / "alone"],
        check=True,
        capture_output=True,
        timeout=60,
    )
    with (
        running(tmp_path / "seen", "--json", "--pace", "4", *options) as run,
        connected(run.url) as viewer,
    ):
        # It takes nothing of what it wants
        viewer.subscribe_all()
        out, _ = run.process.communicate(timeout=60)
    hashes = {json.loads(text)["state_hash"] for text in (alone.stdout, out)}
    assert len(hashes) == 1


def test_parameters_are_read_and_written_through_the_sessions_commands(
    tmp_path: Path,
) -> None:
    with running(tmp_path / "out", "--seed", "7", "--pace", "1") as run:
        with connected(run.url) as viewer, connected(run.url) as other:
            viewer.call("/pause")
            before = viewer.parameters()
            assert before["seed"] == "7" and before["scenario"] == "highway"
            assert before["state"] == "paused" and before["pace"] == "realtime"
            assert before["fault.perception"] is False
            assert viewer.parameters("seed", "nothing") == {"seed": "7"}
            other.subscribe_parameters("set_speed_m_s", "decider", "pace")
            other.parameters("seed")
            # Written: echoed to who asked, told to who wants to know
            assert viewer.set_parameters(set_speed_m_s=15) == {"set_speed_m_s": 15.0}
            other.until(lambda: other.told.get("set_speed_m_s") == 15.0)
            new = {"decider": "external", "pace": "max", "fault.perception": True}
            assert viewer.set_parameters(**new) == new
            viewer.publish(1, "/command/lane_change", "left")
            viewer.call("/set_speed", speed_m_s=16)
            other.until(lambda: other.told.get("set_speed_m_s") == 16.0)
            assert other.told["decider"] == "external" and other.told["pace"] == "max"
            assert "state" not in other.told and not viewer.statuses
            # Refused: in words, and what it is stays what it is
            for name, value, why in (
                ("set_speed_m_s", 99, "speed_m_s = 99: expected a speed"),
                ("decider", "luck", "luck"),
                ("pace", -1, "pace = -1: expected realtime"),
                ("fault.engine", True, "bus"),
                ("fault.luck", True, "expected localisation"),
                ("state", "quitting", "expected playing, paused or stopped"),
                ("seed", "8", "read only"),
                ("nothing", 1, "no such parameter"),
            ):
                now = viewer.parameters(name)
                assert viewer.set_parameters(**{name: value}) == now, name
                said = viewer.statuses.pop()
                assert said.startswith(f"{name}: ") and why in said, said
            assert viewer.set_parameters(state="playing") == {"state": "playing"}
            assert viewer.set_parameters(state="stopped") == {"state": "stopped"}
            after = viewer.parameters()
            assert after["decider"] == before["decider"], "another run from its start"
        run.end()


def test_a_viewer_says_no_more_than_it_may(tmp_path: Path) -> None:
    """The protocol's crate takes 64 MB in a message from each of 16 viewers."""
    with running(tmp_path / "out", "--pace", "1") as run:
        with connected(run.url) as viewer:
            assert viewer.parameters("x" * 60_000) == {}
            with pytest.raises(ConnectionClosed):
                viewer.socket.send("x" * 70_000)
                viewer.drain()
        with connected(run.url) as viewer:
            assert viewer.call("/pause")["state"] == "paused"
        said = run.end()
    assert "cut a viewer off" in said


def test_a_viewer_that_takes_nothing_is_cut_off(tmp_path: Path) -> None:
    """The protocol's crate waits for ever until its last words to a stalled viewer are taken."""
    with running(tmp_path / "out", "--pace", "20") as run:
        at = ("127.0.0.1", int(run.url.rsplit(":", 1)[1]))
        new = [Subprotocol("foxglove.sdk.v1")]
        with connected(run.url) as viewer:
            ids = [c["id"] for c in viewer.channels.values()]
        wanted = [{"id": number, "channelId": number} for number in ids]
        options: dict[str, Any] = {"max_queue": 1, "close_timeout": 1}
        # The first viewer's sockets are gone
        time.sleep(1.0)
        before = descriptors(run.process.pid)
        raw = socket.socket()
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        raw.connect(at)
        took_s = 0.0
        # It ends a connection that is gone already
        with (
            suppress(ConnectionClosed),
            connect(run.url, subprotocols=new, sock=raw, **options) as stalled,
        ):
            stalled.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            began = time.monotonic()
            # Both sockets of the door
            while descriptors(run.process.pid) > before and took_s < 90.0:
                time.sleep(0.5)
                took_s = time.monotonic() - began
        assert 20.0 < took_s < 90.0
        run.end()


def descriptors(process: int) -> int:
    """Files and sockets that a process has open."""
    return len(os.listdir(f"/proc/{process}/fd"))
