"""Times of quadratic-programme solvers on the speed planner's own programmes, side by side.

Every solver gets the same matrices in the same run: the planner's structured solver and Clarabel
inside the Rust example that writes the matrices, OSQP, PIQP and HiGHS through their Python wheels.

    python3 -m venv venv && venv/bin/pip install numpy scipy osqp piqp highspy
    venv/bin/python tools/solver_bench.py

Times are processor time of the solving thread, least and median of the runs, set-up included where
a solver separates it from the solution (a replan has new matrices each time; OSQP and PIQP can
update values, which saves part of the set-up). Quality is the objective above the best one found,
relative, and the largest violation of a row.
"""

import argparse
import json
import pathlib
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeAlias, TypedDict

import highspy
import numpy as np
import numpy.typing as npt
import osqp
import piqp
import scipy.sparse as sp

ROOT = pathlib.Path(__file__).resolve().parent.parent
EXAMPLE = "cargo run --release -q -p planner --example pcc_programmes"

Vector: TypeAlias = npt.NDArray[np.float64]
Solution: TypeAlias = tuple[Vector, int]


class Entries(TypedDict):
    """A sparse matrix as the example writes it."""

    row: list[int]
    column: list[int]
    value: list[float]


class Measured(TypedDict):
    """A solver of the example: least and median time, iterations, energies."""

    ms: tuple[float, float]
    iterations: int
    e: list[float]


@dataclass(frozen=True)
class Programme:
    """`min ½xᵀPx + qᵀx, A x = b (first rows), A x <= b (rest)`."""

    name: str
    columns: int
    rows: int
    equalities: int
    p_upper: sp.csc_matrix
    p: sp.csc_matrix
    q: Vector
    a: sp.csc_matrix
    b: Vector
    structured: Measured
    clarabel: Measured


class Row(NamedTuple):
    """A line of the table; without `x`, the violation is not known."""

    name: str
    ms: tuple[float, float]
    iterations: int
    e: Vector | None
    x: Vector | None


def matrix(entries: Entries, shape: tuple[int, int]) -> sp.csc_matrix:
    index = (entries["row"], entries["column"])
    return sp.csc_matrix((entries["value"], index), shape=shape)


def programmes() -> Iterator[Programme]:
    """The example's programmes."""
    text = subprocess.run(
        EXAMPLE.split(), cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    for line in text.splitlines():
        m = json.loads(line)
        n, rows = m["columns"], m["rows"]
        upper = matrix(m["p_upper"], (n, n))
        yield Programme(
            name=m["name"],
            columns=n,
            rows=rows,
            equalities=m["equalities"],
            p_upper=upper,
            p=(upper + sp.triu(upper, 1).T).tocsc(),
            q=np.array(m["q"]),
            a=matrix(m["a"], (rows, n)),
            b=np.array(m["b"]),
            structured=m["structured"],
            clarabel=m["clarabel"],
        )


def with_osqp(m: Programme, tolerance: float) -> Solution:
    lower = np.full(m.rows, -np.inf)
    lower[: m.equalities] = m.b[: m.equalities]
    solver = osqp.OSQP()
    solver.setup(
        m.p_upper,
        m.q,
        m.a,
        lower,
        m.b,
        verbose=False,
        eps_abs=tolerance,
        eps_rel=tolerance,
        max_iter=50_000,
        polishing=False,
    )
    found = solver.solve()
    return found.x, int(found.info.iter)


def with_piqp(m: Programme) -> Solution:
    k = m.equalities
    solver = piqp.SparseSolver()
    solver.settings.verbose = False
    rows = m.a.tocsr()
    equal, below = rows[:k].tocsc(), rows[k:].tocsc()
    solver.setup(m.p, m.q, equal, m.b[:k], below, None, m.b[k:])
    solver.solve()
    return np.array(solver.result.x), int(solver.result.info.iter)


def with_highs(m: Programme) -> Solution:
    n, rows, k = m.columns, m.rows, m.equalities
    model = highspy.HighsModel()
    lp = model.lp_
    lp.num_col_, lp.num_row_ = n, rows
    lp.col_cost_ = m.q
    lp.col_lower_ = np.full(n, -highspy.kHighsInf)
    lp.col_upper_ = np.full(n, highspy.kHighsInf)
    lower = np.full(rows, -highspy.kHighsInf)
    lower[:k] = m.b[:k]
    lp.row_lower_, lp.row_upper_ = lower, m.b
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_ = m.a.indptr, m.a.indices
    lp.a_matrix_.value_ = m.a.data
    triangle = sp.tril(m.p).tocsc()
    model.hessian_.dim_ = n
    model.hessian_.format_ = highspy.HessianFormat.kTriangular
    model.hessian_.start_, model.hessian_.index_ = triangle.indptr, triangle.indices
    model.hessian_.value_ = triangle.data
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("threads", 1)
    solver.setOptionValue("time_limit", 60.0)
    solver.passModel(model)
    solver.run()
    info = solver.getInfo()
    return np.array(solver.getSolution().col_value), int(info.qp_iteration_count)


def timed(
    run: Callable[[], Solution], runs: int
) -> tuple[tuple[float, float], Solution]:
    times: list[float] = []
    found: Solution | None = None
    for _ in range(runs):
        start = time.thread_time()
        found = run()
        times.append(1e3 * (time.thread_time() - start))
        if times[0] > 2e3:
            break
    if found is None:
        raise ValueError("no run")
    return (min(times), float(np.median(times))), found


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument(
        "--runs", type=int, default=7, help="runs per solver and programme"
    )
    runs: int = arguments.parse_args().runs
    for m in programmes():
        n = len(m.structured["e"])
        rows = [
            Row(name, own["ms"], own["iterations"], np.array(own["e"]), None)
            for name, own in (("structured", m.structured), ("clarabel", m.clarabel))
        ]
        solvers: list[tuple[str, Callable[[], Solution]]] = [
            ("PIQP", partial(with_piqp, m)),
            ("HiGHS", partial(with_highs, m)),
            ("OSQP 1e-3", partial(with_osqp, m, 1e-3)),
            ("OSQP 1e-5", partial(with_osqp, m, 1e-5)),
        ]
        for name, run in solvers:
            ms, (x, iterations) = timed(run, runs)
            rows.append(Row(name, ms, iterations, x[:n] if x.size >= n else None, x))
        base = m.clarabel["ms"][0]
        truth = np.array(m.structured["e"])
        print(f"\n{m.name}: {m.columns} unknowns, {m.rows} rows\n")
        print(
            "| solver | ms least | ms median | of Clarabel | iterations "
            "| largest energy difference, relative | largest violation |"
        )
        print("|---|---|---|---|---|---|---|")
        for r in rows:
            gap = "-" if r.e is None else f"{np.max(np.abs(r.e - truth) / truth):.0e}"
            violation = "-"
            if r.x is not None and r.x.size == m.columns:
                k = m.equalities
                over = m.a @ r.x - m.b
                worst = max(np.max(over[k:]), np.max(np.abs(over[:k]), initial=0.0))
                violation = f"{max(worst, 0.0):.0e}"
            print(
                f"| {r.name} | {r.ms[0]:.3f} | {r.ms[1]:.3f} | {r.ms[0] / base:.3f} "
                f"| {r.iterations} | {gap} | {violation} |"
            )


if __name__ == "__main__":
    main()
