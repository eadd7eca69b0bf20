"""Ticks per second of a world from Python against the same world in Rust, in one run.

cargo build --release -p sim --example drive && pip install ./python
python tools/python_bench.py [SCENARIO] [ROUNDS]
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import tractrix

WORKSPACE = Path(__file__).resolve().parents[1]
SEED = 1


def rust(scenario: str) -> tuple[float, str]:
    """Wall time of the whole program, s, and the hash of its run."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", WORKSPACE / "target"))
    program = target / "release" / "examples" / "drive"
    start = time.perf_counter()
    run = subprocess.run(
        [program, scenario, str(SEED)], check=True, capture_output=True, text=True
    )
    wall_s = time.perf_counter() - start
    found = re.search(r'state_hash: "([0-9a-f]+)"', run.stdout)
    return wall_s, found.group(1) if found else ""


def python(scenario: str, ticks: int, look: bool) -> tuple[float, str, int]:
    """Wall time, s, hash and number of ticks; steps of `ticks`, with a look at all."""
    start = time.perf_counter()
    world = tractrix.World(scenario, seed=SEED)
    while world.step(ticks) == "running":
        if look:
            _ = (world.ego, world.decision, world.scene())
    wall_s = time.perf_counter() - start
    return wall_s, world.summary()["state_hash"], round(world.time_s / world.tick_s)


def main() -> None:
    """Prints the best of some rounds of each, interleaved."""
    scenario = sys.argv[1] if len(sys.argv) > 1 else "highway"
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    ways = {"run to the end": (2**32, False), "step()": (1, False)}
    ways |= {"step() and a look at all": (1, True), "step(10) and a look": (10, True)}
    best: dict[str, float] = {}
    hashes = set()
    ticks = 0
    for _ in range(rounds):
        wall_s, state = rust(scenario)
        best["Rust, example drive"] = min(wall_s, best.get("Rust, example drive", 1e9))
        hashes.add(state)
        for name, (size, look) in ways.items():
            wall_s, state, ticks = python(scenario, size, look)
            best[name] = min(wall_s, best.get(name, 1e9))
            hashes.add(state)
    print(f"{scenario}: {ticks} ticks, {len(hashes)} different hash(es)")
    for name, wall_s in best.items():
        ratio = best["Rust, example drive"] / wall_s
        print(f"{name:28} {ticks / wall_s:9.0f} ticks/s {ratio:6.2f} x Rust")


if __name__ == "__main__":
    main()
