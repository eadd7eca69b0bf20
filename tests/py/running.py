"""Runs with a dashboard."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class Run:
    """A run under way and the address of its dashboard."""

    def __init__(self, process: subprocess.Popen[str], url: str) -> None:
        self.process = process
        self.url = url

    def get(self, path: str) -> Any:
        """A JSON answer of the API."""
        with urllib.request.urlopen(self.url + path, timeout=10) as answer:
            return json.load(answer)

    def finish(self) -> int:
        """Stops the run as Ctrl-C does and waits for it."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout=60)


@contextmanager
def running(
    server: Path, folder: Path, *options: str, port: str = "0"
) -> Iterator[Run]:
    """Starts a run with a dashboard, on a free port if none is named."""
    with started(server, "run", "--port", port, "--out", folder, *options) as run:
        yield run


@contextmanager
def serving(server: Path, runs: Path, *options: str) -> Iterator[Run]:
    """Starts a server without a run, on a free port."""
    with started(server, "serve", "--port", "0", "--runs", runs, *options) as run:
        yield run


@contextmanager
def started(*command: str | Path) -> Iterator[Run]:
    """Starts the program, and reads its address."""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            said = ""
            address = None
            while address is None and (line := process.stderr.readline()):
                said += line
                address = re.search(r"http://127\.0\.0\.1:\d+", line)
            assert address is not None, said
            yield Run(process, address.group())
        finally:
            process.kill()


def settled_time_s(run: Run) -> float:
    """Time of a paused run, s: telemetry trails the run by a frame, so ask until it stays."""
    last = -1.0
    for _ in range(100):
        now = float(run.get("/api/v1/state")["time_s"])
        if now == last:
            return now
        last = now
        time.sleep(0.2)
    raise AssertionError(f"the run does not stay paused: {last} s")
