"""Cost of TraCI from Rust against SUMO's own step, Python libsumo and the native engine, in one run.

Usage: python tools/sumo_bench.py TRACI_COST_BINARY [ROUNDS] [--one-core] [--realtime]
The binary is the example `traci_cost` of the crate traffic-client. Needs `eclipse-sumo` and `libsumo`
in this Python. In each round every case is driven once, in random order; the table shows the least
wall time per step of each case (the machine may be shared), ratios, and the least processor time.
--one-core keeps every case (SUMO, client, libsumo) on one core, so that no message has to wake
another core; --realtime (root) lets the cases run before other programs.
"""

import argparse
import itertools
import json
import math
import multiprocessing as mp
import os
import random
import subprocess
import tempfile
import time
import xml.etree.ElementTree as xml
from multiprocessing.queues import Queue

WARM_UP, STEPS = 100, 300
VARIABLES = [0x42, 0x40, 0x43, 0x72, 0x32]

Pose = tuple[float, float, float]


def libsumo_round(
    folder: str, full: bool, shape: list[Pose], queue: "Queue[dict[str, float]]"
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
            started, before = time.perf_counter(), time.process_time()
        if full:
            libsumo.vehicle.moveToXY("ego", "", -1, *shape[k], 2, 100)
        libsumo.simulationStep()
        if full:
            around = libsumo.vehicle.getContextSubscriptionResults("ego")
            # The values are read, as the Rust client reads them.
            seen = [[values[v] for v in VARIABLES] for values in around.values()]
            if not seen:
                raise ValueError("the ego sees not even itself")
    wall, cpu = time.perf_counter() - started, time.process_time() - before
    queue.put({"wall": wall * 1e6 / STEPS, "sumo_cpu": cpu * 1e6 / STEPS})
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


def rust_round(binary: str, folder: str, vehicles: int, case: str) -> dict[str, float]:
    out = subprocess.run(
        [binary, folder, str(vehicles), case],
        check=True,
        capture_output=True,
        text=True,
    )
    result: dict[str, float] = json.loads(out.stdout or "{}")
    return result


def drive(
    binary: str, folder: str, vehicles: int, case: str, path: list[Pose]
) -> dict[str, float]:
    if not case.startswith("libsumo"):
        return rust_round(binary, folder, vehicles, case)
    queue: Queue[dict[str, float]] = mp.Queue()
    arguments = (folder, case == "libsumo full", path, queue)
    worker = mp.Process(target=libsumo_round, args=arguments)
    worker.start()
    result = queue.get(timeout=120)
    worker.join()
    return result


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("binary")
    parser.add_argument("rounds", type=int, nargs="?", default=5)
    parser.add_argument("--one-core", action="store_true")
    parser.add_argument("--realtime", action="store_true")
    parser.add_argument("--vehicles", type=int, nargs="*", default=[50, 200, 1000])
    given = parser.parse_args()
    if given.one_core:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    if given.realtime:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    import sumo

    os.environ["SUMO_HOME"] = sumo.SUMO_HOME
    os.environ["SUMO_BINARY"] = os.path.join(sumo.SUMO_HOME, "bin", "sumo")
    print(
        "| vehicles | SUMO alone | step | + context | + moved ego | ratio "
        "| libsumo step | libsumo full | Rust / libsumo | native | SUMO / native "
        "| processor: alone | full: SUMO | full: client | libsumo full |"
    )
    print("|---" * 15 + "|")
    cases = [
        "floor",
        "step",
        "context",
        "full",
        "native",
        "libsumo step",
        "libsumo full",
    ]
    for vehicles in given.vehicles:
        best: dict[tuple[str, str], float] = {}
        with tempfile.TemporaryDirectory() as folder:
            rust_round(given.binary, folder, vehicles, "prepare")
            path = ego_path(folder)
            for _ in range(given.rounds):
                for case in random.sample(cases, len(cases)):
                    result = drive(given.binary, folder, vehicles, case, path)
                    for name, value in result.items():
                        key = (case, name)
                        best[key] = min(best.get(key, value), value)
        wall = {case: best[case, "wall"] for case in cases}
        native = wall["native"] * vehicles / max(best["native", "vehicles"], 1)
        print(
            f"| {vehicles} | {wall['floor']:.0f} | {wall['step']:.0f} "
            f"| {wall['context']:.0f} | {wall['full']:.0f} "
            f"| {wall['full'] / wall['floor']:.2f} "
            f"| {wall['libsumo step']:.0f} | {wall['libsumo full']:.0f} "
            f"| {wall['full'] / wall['libsumo full']:.2f} | {native:.1f} "
            f"| {wall['floor'] / native:.0f} | {best['floor', 'sumo_cpu']:.0f} "
            f"| {best['full', 'sumo_cpu']:.0f} | {best['full', 'client_cpu']:.0f} "
            f"| {best['libsumo full', 'sumo_cpu']:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
