"""Cost of TraCI from Rust against SUMO's own step, Python libsumo and the native engine, in one run.

Usage: python tools/sumo_bench.py TRACI_COST_BINARY [ROUNDS]
The binary is the example `traci_cost` of the crate traffic-client. Needs `eclipse-sumo` and `libsumo`
in this Python. Rust and libsumo rounds alternate; the table shows the least time per step of each
case (the machine may be shared) and ratios to SUMO's own step.
"""
import json
import multiprocessing as mp
import os
import subprocess
import sys
import tempfile
import time

WARM_UP, STEPS = 100, 300
VARIABLES = [0x42, 0x40, 0x43, 0x72, 0x32]


def libsumo_round(folder, full, shape, queue):
    import libsumo

    options = ["sumo", "-n", f"{folder}/road.net.xml", "-r", f"{folder}/bench.rou.xml"]
    options += "--step-length 0.1 --seed 1 --thread-rngs 64 --no-step-log --duration-log.disable".split()
    options += "--no-warnings --xml-validation never --time-to-teleport -1 --collision.action none".split()
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


def ego_path(folder):
    """The right lane from 3 km on at 20 m/s, as (x, y, angle), from SUMO's own lane shapes."""
    import math
    import xml.etree.ElementTree as xml

    edges = {e.get("id"): e for e in xml.parse(f"{folder}/road.net.xml").getroot().iter("edge")}
    route = xml.parse(f"{folder}/bench.rou.xml").getroot().find("route").get("edges").split()
    points = []
    for edge in route:
        lanes = edges[edge].findall("lane")
        lane = next(l for l in lanes if l.find("param").get("value") == "0")
        points += [tuple(map(float, p.split(",")[:2])) for p in lane.get("shape").split()]
    path, at, wanted = [], 0.0, 3000.0
    for (x0, y0), (x1, y1) in zip(points, points[1:]):
        length = math.hypot(x1 - x0, y1 - y0)
        while length > 0 and at + length >= wanted and len(path) <= WARM_UP + STEPS:
            f = (wanted - at) / length
            angle = 90 - math.degrees(math.atan2(y1 - y0, x1 - x0))
            path.append((x0 + f * (x1 - x0), y0 + f * (y1 - y0), angle))
            wanted += 2.0
        at += length
    return path


def main():
    binary = sys.argv[1]
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    import sumo

    environment = dict(os.environ, SUMO_BINARY=os.path.join(sumo.SUMO_HOME, "bin", "sumo"))
    os.environ["SUMO_HOME"] = sumo.SUMO_HOME
    print("| vehicles | SUMO alone | step | + context | + moved ego | ratio | libsumo step | libsumo full | Rust / libsumo | native | SUMO / native |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for vehicles in (50, 200, 1000):
        best = {}
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(rounds):
                out = subprocess.run([binary, folder, str(vehicles)], env=environment, check=True, capture_output=True, text=True)
                result = json.loads(out.stdout)
                path = ego_path(folder)
                for name, full in (("libsumo_step_us", False), ("libsumo_full_us", True)):
                    queue = mp.Queue()
                    worker = mp.Process(target=libsumo_round, args=(folder, full, path, queue))
                    worker.start()
                    result[name] = queue.get(timeout=120)
                    worker.join()
                for name, value in result.items():
                    best[name] = min(best.get(name, value), value)
        full = best["ego_and_context_us"]
        native = best["native_us"] * vehicles / max(best["native_vehicles"], 1)
        print(
            f"| {vehicles} | {best['floor_us']:.0f} | {best['step_us']:.0f} | {best['context_us']:.0f} | {full:.0f} "
            f"| {full / best['floor_us']:.2f} | {best['libsumo_step_us']:.0f} | {best['libsumo_full_us']:.0f} "
            f"| {full / best['libsumo_full_us']:.2f} | {native:.1f} | {best['floor_us'] / native:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
