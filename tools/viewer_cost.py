"""What viewers cost a tick: the same run with none, a slow, a stalled, a dead one and with all.

    python tools/viewer_cost.py [--server BINARY ...] [--seconds 40] [--rounds 5]

Runs all of them at the same time, in real time, so that the machine's other work is the same for
each, and compares the 99th percentiles of their ticks in pairs; as often as asked for. Beside them
stands the processor time of the world's thread, which waiting for a core does not change: what
viewers cost that thread itself. Fails where viewers change the run (`state_hash`) or more than 10 %
of its 99th percentile, in the median of the rounds. Several binaries (two revisions) run side by side too. Needs `websockets`.
"""

import argparse
import asyncio
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from server_soak import ROAD_M_PER_S, SLOW_S, Seen, look, road, stall

# More than this of the 99th percentile is too much.
MOST_FRAC = 0.1


async def dead(url: str, seen: Seen) -> None:
    """Asks for frames and is never heard of again: it takes nothing and answers no ping."""
    at = urlsplit(url)
    ask = (
        f"GET {at.path} HTTP/1.1\r\nHost: {at.netloc}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n"
    )
    reader, writer = await asyncio.open_connection(at.hostname, at.port, limit=1)
    writer.write(ask.encode())
    seen.connections += 1
    try:
        await asyncio.Event().wait()
    finally:
        writer.close()
        del reader


def viewers(kind: str, url: str) -> list[Coroutine[Any, Any, None]]:
    """Those of one kind of run."""
    one: dict[str, Callable[[], Coroutine[Any, Any, None]]] = {
        "slow": lambda: look(url, Seen("slow"), SLOW_S),
        "stalled": lambda: stall(url, Seen("stalled")),
        "dead": lambda: dead(url, Seen("dead")),
    }
    if kind == "all":
        quick = [look(url, Seen("quick"), 0.0) for _ in range(3)]
        return [*quick, *(make() for make in one.values())]
    return [one[kind]()] if kind in one else []


KINDS = ("none", "slow", "stalled", "dead", "all")


async def world_cpu_s(process: int, seen: list[float]) -> None:
    """Keeps what the busiest thread has had of a core so far, s: the world's."""
    while True:
        threads = Path(f"/proc/{process}/task")
        # The process may be gone
        with suppress(OSError, ValueError):
            used = [
                int((thread / "schedstat").read_text().split()[0])
                for thread in threads.iterdir()
            ]
            seen[0] = max([seen[0], *(1e-9 * ns for ns in used)])
        await asyncio.sleep(0.2)


@dataclass(frozen=True)
class Ran:
    """What a run says of itself."""

    p50_us: float
    p99_us: float
    missed: int
    cpu_s: float
    state_hash: str


async def run(server: Path, kind: str, options: list[str], out: Path) -> Ran:
    """Drives once, looked at or not."""
    process = await asyncio.create_subprocess_exec(
        server,
        *("run", *options, "--pace", "realtime", "--port", "0", "--json"),
        *("--out", out),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    cpu_s = [0.0]
    tasks = [asyncio.create_task(world_cpu_s(process.pid, cpu_s))]
    try:
        assert process.stderr is not None
        line = ""
        while "dashboard: " not in line:
            line = (await process.stderr.readline()).decode()
            assert line, "the server said no address"
        url = line.split("dashboard: ")[1].split()[0].replace("http", "ws") + "/ws"
        tasks += [asyncio.create_task(one) for one in viewers(kind, url)]
        said, _ = await process.communicate()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if process.returncode is None:
            process.kill()
    summary: dict[str, Any] = json.loads(said)
    times = summary["tick_time_us"]
    missed = summary["missed_deadlines"]
    return Ran(times["p50"], times["p99"], missed, cpu_s[0], summary["state_hash"])


async def measure(
    servers: list[Path], options: list[str], folder: Path
) -> dict[tuple[Path, str], Ran]:
    """All at the same time."""
    cases = list(itertools.product(servers, KINDS))
    runs = [
        run(server, kind, options, folder / str(number))
        for number, (server, kind) in enumerate(cases)
    ]
    return dict(zip(cases, await asyncio.gather(*runs), strict=True))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = [Path("target/release/sim-server")]
    parser.add_argument("--server", type=Path, nargs="+", default=default)
    parser.add_argument("--seconds", type=int, default=40)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    seconds, rounds = arguments.seconds, arguments.rounds
    if seconds < 10 or rounds < 1:
        parser.error("at least 10 seconds and a round")
    found: list[dict[tuple[Path, str], Ran]] = []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            road(folder / "road.csv", 1000.0 + ROAD_M_PER_S * seconds)
            options = ["highway", "--road", str(folder / "road.csv"), "--seed", "1"]
            options += ["--duration", str(seconds)]
            limit_s = 3 * seconds + 120
            measured = measure(arguments.server, options, folder)
            found.append(asyncio.run(asyncio.wait_for(measured, limit_s)))
    print(f"{rounds} rounds of {seconds} s, load {os.getloadavg()[0]:.1f} at the end")
    # Each prints what it found
    are_good = [judge(server, found) for server in arguments.server]
    return int(not all(are_good))


def judge(server: Path, rounds: list[dict[tuple[Path, str], Ran]]) -> bool:
    """Prints what one binary's viewers cost; whether that is little."""
    print(
        f"{server}: 50 and 99 % of ticks below, us; over that of none; the world's thread, CPU s"
    )
    is_good = True
    for kind in KINDS:
        ran = [each[server, kind] for each in rounds]
        alone = [each[server, "none"] for each in rounds]
        ratios = sorted(a.p99_us / b.p99_us for a, b in zip(ran, alone, strict=True))
        p50, p99 = (
            statistics.median(values)
            for values in ([one.p50_us for one in ran], [one.p99_us for one in ran])
        )
        ratio = statistics.median(ratios)
        missed = sum(one.missed for one in ran)
        cpu_s = statistics.median(one.cpu_s for one in ran)
        cpus = [a.cpu_s / b.cpu_s for a, b in zip(ran, alone, strict=True)]
        print(
            f"  {kind:8} {p50:6.0f} {p99:6.0f}   {ratio - 1.0:+.1%}"
            f" ({ratios[0] - 1.0:+.1%} to {ratios[-1] - 1.0:+.1%}), {missed} missed;"
            f" {cpu_s:.2f} CPU s, {statistics.median(cpus) - 1.0:+.1%}"
        )
        same = {one.state_hash for one in ran + alone}
        if len(same) > 1:
            print(f"FAILED: {kind}: the viewers changed the run")
        if ratio > 1.0 + MOST_FRAC:
            print(f"FAILED: {kind}: more than {MOST_FRAC:.0%}")
        is_good &= len(same) == 1 and ratio <= 1.0 + MOST_FRAC
    return is_good


if __name__ == "__main__":
    sys.exit(main())
