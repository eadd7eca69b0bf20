"""A run in real time with viewers that keep up, that are slow and that take nothing, for a while.

    python tools/server_soak.py [--server BINARY] [--seconds 60] [--viewers 5] [--ros2]

Reads memory and descriptors of the server every second. Fails where ticks are missing, where the
run is not the run that nobody looked at (`state_hash`), where descriptors are not given back or
where memory grows. Prints missed deadlines with the machine's load beside them: these are the
machine's. Needs `websockets`. The road is made here: hills, long enough for the time asked for.
"""

import argparse
import asyncio
import json
import math
import os
import re
import socket
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

TICK_S = 0.01
# The truck's set speed is 22.22 m/s.
ROAD_M_PER_S = 25.0
# Between two frames that the slow viewer takes.
SLOW_S = 0.5
# Memory after a quarter of the time, when every buffer is full, to the end.
MAX_GROWTH_KB = 16_384
MAX_GROWTH_FRAC = 0.1


@dataclass
class Sample:
    """The server's process at one time."""

    rss_kb: int
    descriptors: int
    threads: int


@dataclass
class Seen:
    """What one viewer got."""

    name: str
    frames: int = 0
    lost: int = 0
    connections: int = 0


@dataclass
class Soak:
    """What was measured."""

    samples: list[Sample] = field(default_factory=list)
    viewers: list[Seen] = field(default_factory=list)


def road(file: Path, length_m: float) -> None:
    """Hills of 1.5 km, up to 2 %."""
    rows = (
        f"{s},{100.0 + 5.0 * math.sin(2.0 * math.pi * s / 1500.0):.3f}"
        for s in range(0, int(length_m), 25)
    )
    file.write_text("\n".join(["s_m,z_m", *rows, ""]))


def sample(pid: int) -> Sample:
    """Reads /proc."""
    status = Path(f"/proc/{pid}/status").read_text()
    values = dict(re.findall(r"^(\w+):\s+(\d+)", status, re.MULTILINE))
    descriptors = len(os.listdir(f"/proc/{pid}/fd"))
    return Sample(int(values["VmRSS"]), descriptors, int(values["Threads"]))


def small_socket(url: str) -> socket.socket:
    """Connected, with little room for what was not read yet."""
    at = urlsplit(url)
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
    made.connect((at.hostname, at.port))
    made.setblocking(False)
    return made


async def look(url: str, seen: Seen, pause_s: float) -> None:
    """A viewer of the page; it comes back when it is cut off."""
    while True:
        try:
            async with connect(
                url,
                sock=small_socket(url),
                max_queue=1,
                max_size=None,
                compression=None,
                ping_interval=None,
                # One that was slow has its end of the connection still to read
                close_timeout=0.5,
            ) as viewer:
                seen.connections += 1
                async for text in viewer:
                    message: dict[str, Any] = json.loads(text)
                    seen.frames += message["kind"] == "frame"
                    seen.lost += message.get("frames", 0) * (message["kind"] == "lost")
                    await asyncio.sleep(pause_s)
        except (OSError, WebSocketException):
            await asyncio.sleep(0.2)


async def stall(url: str, seen: Seen) -> None:
    """Asks for frames and takes nothing, until it is cut off; then again."""
    at = urlsplit(url)
    key = "dGhlIHNhbXBsZSBub25jZQ=="
    ask = (
        f"GET {at.path} HTTP/1.1\r\nHost: {at.netloc}\r\nUpgrade: websocket\r\n"
        f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n"
    )
    while True:
        try:
            reader, writer = await asyncio.open_connection(
                at.hostname, at.port, limit=1
            )
            writer.write(ask.encode())
            await writer.drain()
            seen.connections += 1
            # The stream's own buffer is full at once, so that nothing is read
            while not reader.at_eof() and not writer.is_closing():
                await asyncio.sleep(1.0)
                writer.write(b"\x8a\x80\x00\x00\x00\x00")
                await writer.drain()
        except OSError:
            await asyncio.sleep(0.2)


def metrics(url: str) -> dict[str, float]:
    """The counters of the server."""
    with urllib.request.urlopen(f"{url}/api/v1/metrics", timeout=10) as answer:
        text = answer.read().decode()
    found = re.findall(
        r'^tractrix_(\w+)\{session="default"\} (\S+)$', text, re.MULTILINE
    )
    return {name: float(value) for name, value in found}


async def watch(process: subprocess.Popen[str], url: str, soak: Soak) -> int:
    """Reads the process until the run ends; returns its descriptors once the viewers are gone."""
    sockets = url.replace("http", "ws") + "/ws"
    before = sample(process.pid)
    *quick, slow, stalled = soak.viewers
    looks = [look(sockets, seen, 0.0) for seen in quick]
    looks += [look(sockets, slow, SLOW_S), stall(sockets, stalled)]
    tasks = [asyncio.create_task(one) for one in looks]
    while (await asyncio.to_thread(metrics, url))["viewers"] < len(tasks) - 1:
        await asyncio.sleep(0.1)
    while not await asyncio.to_thread(has_ended, url):
        soak.samples.append(sample(process.pid))
        await asyncio.sleep(1.0)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    # A connection that was cut without a word is found out by a ping
    for _ in range(60):
        if sample(process.pid).descriptors <= before.descriptors:
            break
        await asyncio.sleep(1.0)
    return sample(process.pid).descriptors - before.descriptors


def has_ended(url: str) -> bool:
    """Whether the last tick is driven."""
    try:
        with urllib.request.urlopen(f"{url}/api/v1/state", timeout=10) as answer:
            state: dict[str, Any] = json.load(answer)
    except urllib.error.HTTPError:
        # There is no tick yet
        return False
    return bool(state["run"]["state"] == "finished")


def reference(server: Path, options: list[str], out: Path) -> dict[str, Any]:
    """The same run with nobody looking, as fast as it goes."""
    command: list[str | Path] = [server, "run", *options, "--headless", "--json"]
    run = subprocess.run(
        [*command, "--out", out], check=True, capture_output=True, text=True
    )
    summary: dict[str, Any] = json.loads(run.stdout)
    return summary


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--server", type=Path, default=Path("target/release/sim-server")
    )
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--viewers", type=int, default=5, help="3 to 16")
    parser.add_argument("--ros2", action="store_true")
    arguments = parser.parse_args()
    if arguments.seconds < 20 or not 3 <= arguments.viewers <= 16:
        parser.error("at least 20 seconds and 3 to 16 viewers")
    with tempfile.TemporaryDirectory() as folder:
        return soak_in(Path(folder), arguments)


def soak_in(folder: Path, arguments: argparse.Namespace) -> int:
    """Runs and judges; the exit code."""
    road(folder / "road.csv", 1000.0 + ROAD_M_PER_S * arguments.seconds)
    options = ["highway", "--road", str(folder / "road.csv")]
    options += ["--duration", str(arguments.seconds), "--seed", "1"]
    alone = reference(arguments.server, options, folder / "alone")
    options += ["--pace", "realtime", "--port", "0", "--keep-open"]
    options += ["--ros2"] if arguments.ros2 else []
    command = [
        str(arguments.server),
        "run",
        *options,
        "--json",
        "--out",
        str(folder / "seen"),
    ]
    names = [f"quick {n + 1}" for n in range(arguments.viewers - 2)]
    soak = Soak(viewers=[Seen(name) for name in [*names, "slow", "stalled"]])
    load_before = os.getloadavg()[0]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stderr is not None
            line = ""
            while "dashboard: " not in line:
                line = process.stderr.readline()
                assert line, "the server said no address"
            url = line.split("dashboard: ")[1].split()[0]
            left = asyncio.run(
                asyncio.wait_for(watch(process, url, soak), 3 * arguments.seconds + 180)
            )
            process.terminate()
            out, said = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 0, said
    return judge(soak, alone, json.loads(out), left, load_before)


def judge(
    soak: Soak,
    alone: dict[str, Any],
    summary: dict[str, Any],
    left: int,
    load_before: float,
) -> int:
    """Prints what was seen; 1 where it may not be so."""
    ticks = round(summary["duration_s"] / TICK_S)
    rss = [one.rss_kb for one in soak.samples]
    settled, end = rss[len(rss) // 4], max(rss[-max(1, len(rss) // 8) :])
    missed = summary["missed_deadlines"]
    print(f"{ticks} ticks in {summary['wall_time_s']:.1f} s, {missed} deadlines missed")
    print(f"({100.0 * missed / ticks:.3f} %), tick {summary['tick_time_us']}")
    print(f"load {load_before:.1f} before, {os.getloadavg()[0]:.1f} at the end")
    print(f"memory {rss[0]} kB at first, {settled} after a quarter, {end} at the end,")
    print(
        f"{max(rss)} at most; threads {max(one.threads for one in soak.samples)} at most"
    )
    print(
        f"descriptors {max(one.descriptors for one in soak.samples)} at most, {left} left over"
    )
    for seen in soak.viewers:
        print(
            f"{seen.name}: {seen.frames} frames, {seen.lost} lost, {seen.connections} connections"
        )
    wrong = {
        "ticks are missing": summary["duration_s"] != alone["duration_s"],
        "the viewers changed the run": summary["state_hash"] != alone["state_hash"],
        "memory grows": end - settled > max(MAX_GROWTH_KB, MAX_GROWTH_FRAC * settled),
        "descriptors are not given back": left > 0,
        "a viewer got nothing": not all(seen.frames for seen in soak.viewers[:-1]),
    }
    for what in (what for what, is_so in wrong.items() if is_so):
        print(f"FAILED: {what}")
    return int(any(wrong.values()))


if __name__ == "__main__":
    sys.exit(main())
