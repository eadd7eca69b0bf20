"""Grades of the built-in highway from a recorded drive cycle.

    python3 tools/highway_hills.py drivecycle.csv > crates/road/data/highway_hills.csv

The input has the columns `t_s, v_kmh, grade_pct` (the sheet of `data/drivecycle.xlsx` in
mcsc-impact-climate/Green_Trucking_Analysis). Speed over time gives distance and grade over distance
gives elevation (both by the trapezoidal rule); the slope at each station is that of the chord
through the heights 50 m before and behind it, so that heights are kept.
"""

import csv
import sys
from itertools import pairwise

FIRST_M, LENGTH_M, STEP_M = 176_000.0, 15_000.0, 50.0
HEAD = """\
# Grades (rise/run) of a hilly stretch of a recorded long-haul drive, every 50 m.
# Origin: mcsc-impact-climate/Green_Trucking_Analysis, data/drivecycle.xlsx at daf42e7b, km 176 to 191
# (speed over time integrated to distance, grade over distance to elevation: tools/highway_hills.py).
# Copyright (c) 2024 Danika MacDonell and the MIT Climate & Sustainability Consortium. MIT License:
# highway_hills.LICENSE.txt.
s_m,grade_frac"""


def elevation(path: str) -> list[tuple[float, float]]:
    """Distance and height, m, at every second of the drive."""
    with open(path, newline="") as file:
        rows = [
            (float(r["t_s"]), float(r["v_kmh"]) / 3.6, float(r["grade_pct"]) / 100)
            for r in csv.DictReader(file)
        ]
    s, z = 0.0, 0.0
    out = [(s, z)]
    for (t0, v0, g0), (t1, v1, g1) in pairwise(rows):
        ds = 0.5 * (v0 + v1) * (t1 - t0)
        s, z = s + ds, z + 0.5 * (g0 + g1) * ds
        out.append((s, z))
    return out


def height_at(drive: list[tuple[float, float]], s_m: float) -> float:
    """Height between two seconds, m."""
    for (s0, z0), (s1, z1) in pairwise(drive):
        if s0 <= s_m < s1:
            return z0 + (z1 - z0) * (s_m - s0) / (s1 - s0)
    raise SystemExit(f"the drive does not reach {s_m} m")


def main() -> None:
    """Prints the table."""
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    drive = elevation(sys.argv[1])
    near = [p for p in drive if abs(p[0] - FIRST_M - 0.5 * LENGTH_M) < LENGTH_M]
    print(HEAD)
    for i in range(round(LENGTH_M / STEP_M) + 1):
        s = FIRST_M + i * STEP_M
        slope = (height_at(near, s + STEP_M) - height_at(near, s - STEP_M)) / (
            2 * STEP_M
        )
        print(f"{i * STEP_M:.0f},{slope:.5f}")


if __name__ == "__main__":
    main()
