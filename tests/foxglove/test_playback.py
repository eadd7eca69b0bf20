"""`play`: a finished recording, seen by a viewer: its bytes, its times, play, pause, seek, speed."""

from __future__ import annotations

import math
import subprocess
import time
from pathlib import Path

import pytest
from shown import SERVER, played, recorded
from viewer import Said, connected
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

S = 1_000_000_000
LATCHED = ("/tf_static", "/road/lanes")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of a short run, and what is beside it."""
    folder = tmp_path_factory.mktemp("played") / "out"
    options = ("--headless", "--duration", "12", "--seed", "7", "--out", folder)
    subprocess.run([SERVER, "run", *options], check=True, timeout=60)
    return folder / "run.mcap"


def expected_at(messages: list[Said], at_ns: int) -> dict[str, list[Said]]:
    """What is to be seen at a time: the last message of each topic, of latched ones all."""
    seen: dict[str, list[Said]] = {}
    for said in messages:
        if said.time_ns <= at_ns:
            before = seen.get(said.topic, []) if said.topic in LATCHED else []
            seen[said.topic] = [*before, said]
    # What has had no message for two seconds is not shown, unless it stays good
    return {
        topic: all
        for topic, all in seen.items()
        if topic in LATCHED or all[-1].time_ns >= at_ns - 2 * S
    }


def by_topic(messages: list[Said]) -> dict[str, list[Said]]:
    """Messages by topic, in their order."""
    found: dict[str, list[Said]] = {}
    for said in messages:
        found.setdefault(said.topic, []).append(said)
    return found


def test_a_recording_is_played_paused_sought_and_ends(recording: Path) -> None:
    topics, messages = recorded(recording)
    last_ns = messages[-1].time_ns
    with played(recording) as run:
        with connected(run.url, has_services=False) as viewer:
            info = viewer.info[0]
            assert "playbackControl" in info["capabilities"]
            assert info["dataStartTime"]["sec"] == 0, info
            assert set(viewer.channels) == set(topics)
            for topic, channel in viewer.channels.items():
                name, encoding, definition = topics[topic]
                assert (channel["encoding"], channel["schemaName"]) == ("cdr", name)
                assert channel["schemaEncoding"] == encoding
                assert channel["schema"].encode() == definition, topic
            # It stands at its start
            viewer.until(lambda: bool(viewer.states))
            assert (viewer.states[0].status, viewer.states[0].time_ns) == ("paused", 0)
            viewer.subscribe_all()
            viewer.drain()
            assert by_topic(viewer.messages) == expected_at(messages, 0)
            # A seek in a pause shows what is there
            viewer.messages.clear()
            at_ns = 3 * S + 5_000_000
            state = viewer.control("pause", seek_ns=at_ns)
            assert (state.status, state.time_ns, state.did_seek) == (
                "paused",
                at_ns,
                True,
            )
            viewer.drain()
            assert by_topic(viewer.messages) == expected_at(messages, at_ns)
            # Played from there at twice its speed, nothing is missing or comes twice
            viewer.messages.clear()
            viewer.times_ns.clear()
            began = time.monotonic()
            assert viewer.control("play", speed=2.0).status == "playing"
            viewer.until(lambda: viewer.states[-1].status == "ended")
            took_s = time.monotonic() - began
            viewer.drain()
            assert (
                viewer.states[-1].time_ns == last_ns and viewer.states[-1].speed == 2.0
            )
            wanted = [said for said in messages if said.time_ns > at_ns]
            assert by_topic(viewer.messages) == by_topic(wanted)
            assert took_s > (last_ns - at_ns) / S / 2.0 - 0.1
            assert viewer.times_ns == sorted(viewer.times_ns)
            assert at_ns <= viewer.times_ns[0] and viewer.times_ns[-1] == last_ns
            # Behind its end it plays again from its start, and can be paused
            again = viewer.control("play", speed=1.0)
            assert (again.status, again.time_ns, again.did_seek) == ("playing", 0, True)
            time.sleep(0.3)
            paused = viewer.control("pause", speed=1.0)
            assert paused.status == "paused" and 0.2 * S < paused.time_ns < 8 * S
            viewer.drain()
            viewer.messages.clear()
            viewer.drain()
            assert not viewer.messages
            # Who comes late sees what is to be seen now
            with connected(run.url, has_services=False) as late:
                late.until(lambda: bool(late.states))
                assert late.states[0].time_ns == paused.time_ns
                late.subscribe_all()
                late.drain()
                assert by_topic(late.messages) == expected_at(messages, paused.time_ns)
        run.end()


def test_what_cannot_be_asked_of_a_recording_is_said(recording: Path) -> None:
    with played(recording) as run:
        with connected(run.url, has_services=False) as viewer:
            for speed in (math.nan, 0.0, -1.0, 1e9):
                state = viewer.control("pause", speed=speed)
                assert (state.status, state.speed) == ("paused", 1.0), speed
            viewer.until(lambda: len(viewer.statuses) == 4)
            assert all("playback_speed = " in said for said in viewer.statuses)
            far = viewer.control("pause", seek_ns=2**64 - 1)
            _, messages = recorded(recording)
            assert far.time_ns == messages[-1].time_ns
            viewer.until(lambda: viewer.states[-1].status == "ended")
        with pytest.raises(InvalidStatus) as refused:
            new = [Subprotocol("foxglove.sdk.v1")]
            connect(run.url, subprotocols=new, origin=Origin("http://evil.example"))
        assert refused.value.response.status_code == 403
        run.end()


def test_what_is_no_finished_recording_is_named(
    recording: Path, tmp_path: Path
) -> None:
    def refusal(file: Path, *options: str) -> str:
        command: list[str | Path] = [SERVER, "play", file, "--foxglove", "0", *options]
        ended = subprocess.run(
            command, check=False, capture_output=True, text=True, timeout=30
        )
        assert ended.returncode == 2 and len(ended.stderr.splitlines()) == 1, ended
        return ended.stderr

    whole = recording.read_bytes()
    torn, foreign = tmp_path / "torn.mcap", tmp_path / "notes.txt"
    torn.write_bytes(whole[: len(whole) * 2 // 3])
    foreign.write_bytes(b"notes" * 100)
    assert "sim-server recover" in refusal(torn) and "torn.mcap" in refusal(torn)
    assert "notes.txt" in refusal(foreign)
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    assert "empty.mcap" in refusal(empty)
    assert "nowhere.mcap" in refusal(tmp_path / "nowhere.mcap")
    assert "--foxglove-origin" in refusal(recording, "--foxglove-origin", "null")
    with played(recording) as run:
        port = run.url.rsplit(":", 1)[1]
        taken = subprocess.run(
            [SERVER, "play", recording, "--foxglove", port],
            check=False,
            capture_output=True,
            text=True,
            timeout=30,
        )
        assert taken.returncode == 2 and f"port {port}" in taken.stderr
        run.end()


def test_a_recording_that_goes_bad_ends_with_a_line(
    recording: Path, tmp_path: Path
) -> None:
    damaged = tmp_path / "run.mcap"
    whole = bytearray(recording.read_bytes())
    middle = len(whole) // 2
    whole[middle : middle + 20_000] = bytes(20_000)
    damaged.write_bytes(whole)
    with played(damaged) as run, connected(run.url, has_services=False) as viewer:
        viewer.subscribe_all()
        viewer.control("play", speed=100.0)
        _, said = run.process.communicate(timeout=30)
    assert run.process.returncode == 1
    assert len(said.splitlines()) == 1 and "run.mcap" in said, said
