"""Cost of TraCI from Rust against SUMO's own step, Python libsumo and the native engine, in one run.

Usage: python tools/sumo_bench.py TRACI_COST_BINARY [ROUNDS]
The binary is the example `traci_cost` of the crate traffic-client. Needs `eclipse-sumo` and `libsumo`
in this Python. Rust and libsumo rounds alternate; the table shows the least time per step of each
case (the machine may be shared) and ratios to SUMO's own step.
"""

import itertools
import json
import math
import multiprocessing as mp
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as xml
from multiprocessing.queues import Queue

WARM_UP, STEPS = 100, 300
VARIABLES = [0x42, 0x40, 0x43, 0x72, 0x32]

Pose = tuple[float, float, float]


def libsumo_round(
    folder: str, full: bool, shape: list[Pose], queue: "Queue[float]"
) -> None:
    import libsumo

    options = ["sumo", "-n", f"{folder}/road.net.xml", "-r", f"{folder}/bench.rou.xml"]
    options += ["--step-length", "0.1", "--seed", "1", "--thread-rngs", "64"]
    options += ["--no-step-log", "--duration-log.disable", "--no-warnings"]
    options += ["--xml-validation", "never", "--time-to-teleport", "-1"]
    options += ["--collision.action", "none"]
    options += ["--lanechange.duration", "3"]
    libsumo.start(options)
    if full:
        libsumo.vehicle.add("ego", "through", typeID="ego")
        libsumo.vehicle.moveToXY("ego", "", -1, *shape[0], 2, 100)
        libsumo.simulationStep()
        libsumo.vehicle.subscribeContext("ego", 0xA4, 200, VARIABLES)
    for k in range(1, WARM_UP + STEPS + 1):
        if k == WARM_UP + 1:
            started = time.perf_counter()
        if full:
            libsumo.vehicle.moveToXY("ego", "", -1, *shape[k], 2, 100)
        libsumo.simulationStep()
        if full:
            libsumo.vehicle.getContextSubscriptionResults("ego")
    queue.put((time.perf_counter() - started) * 1e6 / STEPS)
    libsumo.close()


def child(element: xml.Element, name: str) -> xml.Element:
    found = element.find(name)
    if found is None:
        raise ValueError(f"no {name} in {element.tag}")
    return found


def ego_path(folder: str) -> list[Pose]:
    """The right lane from 3 km on at 20 m/s, as (x, y, angle), from SUMO's own lane shapes."""
    net = xml.parse(f"{folder}/road.net.xml").getroot()
    edges = {e.get("id"): e for e in net.iter("edge")}
    routes = xml.parse(f"{folder}/bench.rou.xml").getroot()
    route = child(routes, "route").attrib["edges"].split()
    points: list[tuple[float, float]] = []
    for edge in route:
        lanes = edges[edge].findall("lane")
        right = next(x for x in lanes if child(x, "param").get("value") == "0")
        for point in right.attrib["shape"].split():
            x, y = point.split(",")[:2]
            points.append((float(x), float(y)))
    path: list[Pose] = []
    at, wanted = 0.0, 3000.0
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        length = math.hypot(x1 - x0, y1 - y0)
        while length > 0 and at + length >= wanted and len(path) <= WARM_UP + STEPS:
            f = (wanted - at) / length
            angle = 90 - math.degrees(math.atan2(y1 - y0, x1 - x0))
            path.append((x0 + f * (x1 - x0), y0 + f * (y1 - y0), angle))
            wanted += 2.0
        at += length
    return path


def main() -> None:
    binary = sys.argv[1]
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    import sumo

    sumo_binary = os.path.join(sumo.SUMO_HOME, "bin", "sumo")
    environment = dict(os.environ, SUMO_BINARY=sumo_binary)
    os.environ["SUMO_HOME"] = sumo.SUMO_HOME
    print(
        "| vehicles | SUMO alone | step | + context | + moved ego | ratio "
        "| libsumo step | libsumo full | Rust / libsumo | native | SUMO / native |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for vehicles in (50, 200, 1000):
        best: dict[str, float] = {}
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(rounds):
                out = subprocess.run(
                    [binary, folder, str(vehicles)],
                    env=environment,
                    check=True,
                    capture_output=True,
                    text=True,
                )
                result: dict[str, float] = json.loads(out.stdout)
                path = ego_path(folder)
                for name, full in (
                    ("libsumo_step_us", False),
                    ("libsumo_full_us", True),
                ):
                    queue: Queue[float] = mp.Queue()
                    worker = mp.Process(
                        target=libsumo_round, args=(folder, full, path, queue)
                    )
                    worker.start()
                    result[name] = queue.get(timeout=120)
                    worker.join()
                for name, value in result.items():
                    best[name] = min(best.get(name, value), value)
        moved = best["ego_and_context_us"]
        native = best["native_us"] * vehicles / max(best["native_vehicles"], 1)
        print(
            f"| {vehicles} | {best['floor_us']:.0f} | {best['step_us']:.0f} "
            f"| {best['context_us']:.0f} | {moved:.0f} | {moved / best['floor_us']:.2f} "
            f"| {best['libsumo_step_us']:.0f} | {best['libsumo_full_us']:.0f} "
            f"| {moved / best['libsumo_full_us']:.2f} | {native:.1f} "
            f"| {best['floor_us'] / native:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
