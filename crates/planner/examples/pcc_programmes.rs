//! Writes quadratic programmes of the speed planner as JSON, one line each, with the times that the
//! planner's two solvers take for them: the input of `tools/solver_bench.py`.
//!
//! `cargo run --release -p planner --example pcc_programmes > programmes.jsonl`
#![allow(clippy::disallowed_macros, clippy::disallowed_methods, clippy::unwrap_used)]

#[path = "../tests/support/pcc/mod.rs"]
mod support;

use planner::pcc::solve::{
    Programme, Solution, Structured, Subproblem, Terminal, TimeRule, Triplets, clarabel,
};
use planner::pcc::trip::Trip;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use support::{BANDS_KM_H, Engine, corpus, replan, request, truck};

const RUNS: usize = 9;

/// Least and median processor time of the thread, ms.
fn times_ms(mut run: impl FnMut()) -> [f64; 2] {
    let now = || {
        let t = clock_gettime(ClockId::ThreadCPUTime);
        t.tv_sec as f64 * 1e3 + t.tv_nsec as f64 * 1e-6
    };
    let mut all: Vec<f64> = (0..RUNS)
        .map(|_| {
            let t = now();
            run();
            now() - t
        })
        .collect();
    all.sort_by(f64::total_cmp);
    [all[0], all[RUNS / 2]]
}

fn matrix(entries: &Triplets) -> Value {
    json!({ "row": entries.row, "column": entries.column, "value": entries.value })
}

fn written(name: &str, sub: &Subproblem, end: Terminal, time: TimeRule) -> Value {
    // Both new each time: set-up included, and nothing to start from.
    let mut own = Solution::default();
    let structured = times_ms(|| Structured::default().solve_into(sub, end, time, &mut own));
    let mut oracle = Solution::default();
    let clarabel = times_ms(|| oracle = clarabel::solve(sub, end, time, None));
    let m = Programme::new(sub, end, time, None);
    json!({
        "name": name, "columns": m.columns, "rows": m.b.len(), "equalities": m.equalities,
        "p_upper": matrix(&m.p), "q": m.q, "a": matrix(&m.a), "b": m.b,
        "structured": { "ms": structured, "iterations": own.iterations, "e": own.e_j_kg[1..] },
        "clarabel": { "ms": clarabel, "iterations": oracle.iterations, "e": oracle.e_j_kg[1..] },
    })
}

fn main() {
    for (name, profile) in corpus::roads() {
        if !["rolling2", "hilly5", "test_site"].contains(&name) {
            continue;
        }
        let limits = truck(55_000.0, Engine::Willans);
        let request = request(&profile, &limits, BANDS_KM_H[1]);
        let trip = Trip::new(&request).unwrap();
        let end_e = *trip.cruise.e_j_kg.last().unwrap();
        let mut last = None;
        let (driven, plan) =
            trip.solve(trip.cruise.trip_time_s(), end_e, &mut |sub, end, time, _| {
                last = Some((sub.clone(), end, time));
                clarabel::solve(sub, end, time, None)
            });
        let (sub, end, time) = last.unwrap();
        println!("{}", written(&format!("{name}, 15 km trip"), &sub, end, time));
        let windows = replan::windows(&trip, &driven, plan.beta_g_s, 150);
        let mut first = None;
        windows[1].replan(&trip, &mut |sub, end, time, _| {
            first.get_or_insert((sub.clone(), end, time));
            clarabel::solve(sub, end, time, None)
        });
        let (sub, end, time) = first.unwrap();
        println!("{}", written(&format!("{name}, 4 km replan"), &sub, end, time));
    }
}
