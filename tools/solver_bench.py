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

import highspy
import numpy as np
import osqp
import piqp
import scipy.sparse as sp

ROOT = pathlib.Path(__file__).resolve().parent.parent


def programmes():
    """The example's programmes: `min ½xᵀPx + qᵀx, A x = b (first rows), A x <= b (rest)`."""
    command = ["cargo", "run", "--release", "-q", "-p", "planner", "--example", "pcc_programmes"]
    text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for line in text.splitlines():
        m = json.loads(line)
        n, rows = m["columns"], m["rows"]

        def matrix(entries, shape):
            index = (entries["row"], entries["column"])
            return sp.csc_matrix((entries["value"], index), shape=shape)

        upper = matrix(m["p_upper"], (n, n))
        m["P_upper"] = upper
        m["P"] = (upper + sp.triu(upper, 1).T).tocsc()
        m["A"] = matrix(m["a"], (rows, n))
        m["q"], m["b"] = np.array(m["q"]), np.array(m["b"])
        yield m


def with_osqp(m, tolerance):
    lower = np.full(m["rows"], -np.inf)
    lower[: m["equalities"]] = m["b"][: m["equalities"]]
    solver = osqp.OSQP()
    solver.setup(m["P_upper"], m["q"], m["A"], lower, m["b"], verbose=False, eps_abs=tolerance,
                 eps_rel=tolerance, max_iter=50_000, polishing=False)
    found = solver.solve()
    return found.x, int(found.info.iter)


def with_piqp(m):
    k = m["equalities"]
    solver = piqp.SparseSolver()
    solver.settings.verbose = False
    rows = m["A"].tocsr()
    solver.setup(m["P"], m["q"], rows[:k].tocsc(), m["b"][:k], rows[k:].tocsc(), None, m["b"][k:])
    solver.solve()
    return np.array(solver.result.x), int(solver.result.info.iter)


def with_highs(m):
    n, rows, k = m["columns"], m["rows"], m["equalities"]
    model = highspy.HighsModel()
    lp = model.lp_
    lp.num_col_, lp.num_row_ = n, rows
    lp.col_cost_ = m["q"]
    lp.col_lower_, lp.col_upper_ = np.full(n, -highspy.kHighsInf), np.full(n, highspy.kHighsInf)
    lower = np.full(rows, -highspy.kHighsInf)
    lower[:k] = m["b"][:k]
    lp.row_lower_, lp.row_upper_ = lower, m["b"]
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_ = m["A"].indptr, m["A"].indices
    lp.a_matrix_.value_ = m["A"].data
    triangle = sp.tril(m["P"]).tocsc()
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


def timed(run, runs):
    times, found = [], None
    for _ in range(runs):
        start = time.thread_time()
        found = run()
        times.append(1e3 * (time.thread_time() - start))
        if times[0] > 2e3:
            break
    return (min(times), float(np.median(times))), found


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--runs", type=int, default=7, help="runs per solver and programme")
    runs = arguments.parse_args().runs
    for m in programmes():
        n = len(m["structured"]["e"])
        rows = [(name, m[name]["ms"], m[name]["iterations"], np.array(m[name]["e"]), None)
                for name in ("structured", "clarabel")]
        for name, run in [
            ("PIQP", lambda: with_piqp(m)),
            ("HiGHS", lambda: with_highs(m)),
            ("OSQP 1e-3", lambda: with_osqp(m, 1e-3)),
            ("OSQP 1e-5", lambda: with_osqp(m, 1e-5)),
        ]:
            ms, (x, iterations) = timed(run, runs)
            rows.append((name, ms, iterations, x[:n] if x.size >= n else None, x))
        base = m["clarabel"]["ms"][0]
        truth = np.array(m["structured"]["e"])
        print(f"\n{m['name']}: {m['columns']} unknowns, {m['rows']} rows\n")
        print("| solver | ms least | ms median | of Clarabel | iterations | largest energy difference, relative | largest violation |")
        print("|---|---|---|---|---|---|---|")
        for name, ms, iterations, e, x in rows:
            gap = "-" if e is None else f"{np.max(np.abs(e - truth) / truth):.0e}"
            violation = "-"
            if x is not None and x.size == m["columns"]:
                k = m["equalities"]
                over = m["A"] @ x - m["b"]
                worst = max(np.max(over[k:]), np.max(np.abs(over[:k]), initial=0.0))
                violation = f"{max(worst, 0.0):.0e}"
            print(f"| {name} | {ms[0]:.3f} | {ms[1]:.3f} | {ms[0] / base:.3f} | {iterations} | {gap} | {violation} |")


if __name__ == "__main__":
    main()
