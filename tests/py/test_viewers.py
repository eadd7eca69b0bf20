"""Viewers that take nothing, or say nothing: what they may hold up, and when they are cut off."""

from __future__ import annotations

import json
import socket
import threading
import time
import urllib.request
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

from running import Run, running

# A viewer that is silent is gone after 30 s, one that does not take a message after 5 s, who does
# not take an answer after 20 s; on a busy machine a little later.
LATE_S = 40.0


def connection(run: Run) -> socket.socket:
    """A connection with little room for what is not read."""
    at = urlsplit(run.url)
    assert at.hostname is not None and at.port is not None
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    made.settimeout(60.0)
    made.connect((at.hostname, at.port))
    return made


def asked(run: Run, path: str, *headers: str) -> socket.socket:
    """A connection on which something has been asked for and nothing was read."""
    made = connection(run)
    lines = [f"GET {path} HTTP/1.1", f"Host: {urlsplit(run.url).netloc}", *headers]
    made.sendall("\r\n".join([*lines, "", ""]).encode())
    return made


def viewer(run: Run) -> socket.socket:
    """A viewer of frames."""
    return asked(
        run,
        "/ws",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13",
    )


def take_all(of: socket.socket) -> tuple[int, float]:
    """Bytes until the other end is gone, and how long that took, s."""
    began, taken = time.monotonic(), 0
    try:
        while got := of.recv(65_536):
            taken += len(got)
    except ConnectionResetError:
        pass
    return taken, time.monotonic() - began


def test_viewers_do_not_hold_up_the_end_of_a_run(server: Path, tmp_path: Path) -> None:
    """It looked as if six viewers made the end take seconds: it was one of them, not the program."""
    with running(server, tmp_path, "--pace", "realtime", "--seed", "1") as run:
        stalled = [viewer(run) for _ in range(3)]
        quick = [viewer(run) for _ in range(3)]
        readers = [threading.Thread(target=take_all, args=[one]) for one in quick]
        for reader in readers:
            reader.start()
        time.sleep(2.0)
        began = time.monotonic()
        assert run.finish() == 0
        took_s = time.monotonic() - began
        for reader in readers:
            reader.join()
        for one in [*stalled, *quick]:
            one.close()
    assert took_s < 8.0
    assert json.loads((tmp_path / "summary.json").read_text())["distance_m"] > 1.0


def test_who_says_nothing_or_takes_nothing_is_cut_off(
    server: Path, tmp_path: Path
) -> None:
    with running(server, tmp_path, "--pace", "realtime", "--seed", "1") as run:
        silent, stalled = viewer(run), viewer(run)
        unread = asked(run, "/assets/plotly.js")
        found: dict[str, tuple[int, float]] = {}

        def listen() -> None:
            # It takes what comes, and answers no ping
            found["silent"] = take_all(silent)

        listening = threading.Thread(target=listen)
        listening.start()
        began = time.monotonic()
        # What the system keeps for the stalled one has to be full first
        while viewers(run) > 0 and time.monotonic() - began < 120.0:
            # It says something, and takes nothing
            with suppress(OSError):
                stalled.sendall(b"\x8a\x80\x00\x00\x00\x00")
            time.sleep(0.5)
        listening.join()
        assert 25.0 < found["silent"][1] < 30.0 + LATE_S
        assert viewers(run) == 0
        # Longer ago than it may take nothing
        taken, _ = take_all(unread)
        with asked(run, "/assets/plotly.js", "Connection: close") as whole:
            assert taken < take_all(whole)[0]
        stalled.close()
        assert run.finish() == 0


def viewers(run: Run) -> int:
    """Viewers as the metrics count them."""
    with urllib.request.urlopen(f"{run.url}/api/v1/metrics", timeout=10) as answer:
        text = answer.read().decode()
    line = next(x for x in text.splitlines() if x.startswith("tractrix_viewers{"))
    return int(float(line.rsplit(" ", 1)[1]))
