//! Times of whole-trip plans and of 4 km replans, with the structured solver and with Clarabel.
//!
//! `cargo run --release -p planner --example plan_times [-- ROAD]`
//!
//! Processor time of the thread, so that other work on the machine disturbs less; a replan is two
//! subproblems, linearisation, driving and bounds included.
#![allow(clippy::disallowed_macros, clippy::disallowed_methods, clippy::unwrap_used)]

#[path = "../tests/support/pcc/mod.rs"]
mod support;

use planner::pcc::solve::{
    Clarabel, DefaultSolver, Solution, SolveStatus, Structured, Subproblem, Terminal, TimeRule,
    clarabel,
};
use planner::pcc::trip::{Trip, plan_trip_with};
use rustix::time::{ClockId, clock_gettime};
use support::{BANDS_KM_H, Engine, MASSES_KG, corpus, replan, request, truck};

fn now_ms() -> f64 {
    let t = clock_gettime(ClockId::ThreadCPUTime);
    t.tv_sec as f64 * 1e3 + t.tv_nsec as f64 * 1e-6
}

/// The least of three runs, ms.
fn least_ms<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut best = f64::INFINITY;
    for _ in 0..2 {
        let t = now_ms();
        run();
        best = best.min(now_ms() - t);
    }
    let t = now_ms();
    let result = run();
    (best.min(now_ms() - t), result)
}

fn percentiles(name: &str, mut ms: Vec<f64>) {
    ms.sort_by(f64::total_cmp);
    let at = |f: f64| ms[((ms.len() - 1) as f64 * f).round() as usize];
    println!(
        "{name}: {} replans, p50 {:.3} ms, p90 {:.3} ms, p99 {:.3} ms, max {:.3} ms",
        ms.len(),
        at(0.5),
        at(0.9),
        at(0.99),
        at(1.0)
    );
}

fn main() {
    let only = std::env::args().nth(1);
    let (mut of_structured, mut of_clarabel, mut of_both) = (Vec::new(), Vec::new(), 0);
    println!(
        "road mass_t | prepare_ms solve_ms plan_trip_ms | subproblems iterations in_solver_ms second_opinions | clarabel plan_trip_ms"
    );
    for (name, profile) in corpus::roads() {
        if only.as_ref().is_some_and(|o| !name.contains(o.as_str())) {
            continue;
        }
        for mass in MASSES_KG {
            let limits = truck(mass, Engine::Willans);
            let request = request(&profile, &limits, BANDS_KM_H[1]);
            let mut solver = DefaultSolver::default();
            let mut default = |a: &Subproblem, b: Terminal, c: TimeRule, d: Option<&[f64]>| {
                solver.solve(a, b, c, d)
            };
            let (prepare, trip) = least_ms(|| Trip::new(&request).unwrap());
            let end = *trip.cruise.e_j_kg.last().unwrap();
            let goal = trip.cruise.trip_time_s();
            let (solve, (driven, plan)) = least_ms(|| trip.solve(goal, end, &mut default));
            let (whole, _) = least_ms(|| plan_trip_with(&request, &mut default).unwrap());
            let (mut calls, mut iterations, mut inside, mut second) = (0, 0, 0.0, 0);
            let mut fast = Structured::default();
            trip.solve(goal, end, &mut |sub, end, time, fence| {
                let t = now_ms();
                let mut found = Solution::default();
                fast.solve_into(sub, end, time, &mut found);
                inside += now_ms() - t;
                calls += 1;
                iterations += found.iterations;
                if found.status != SolveStatus::Solved {
                    second += 1;
                    return clarabel::solve(sub, end, time, fence);
                }
                found
            });
            let mut library = Clarabel::default();
            let mut by_library = |a: &Subproblem, b: Terminal, c: TimeRule, d: Option<&[f64]>| {
                library.solve(a, b, c, d)
            };
            let t = now_ms();
            plan_trip_with(&request, &mut by_library).unwrap();
            let clarabel = now_ms() - t;
            println!(
                "{name:9} {:2.0} | {prepare:6.2} {solve:6.2} {whole:6.2} | {calls:2} {iterations:3} {inside:6.2} {second} | {clarabel:7.1}",
                mass / 1e3
            );
            for window in replan::windows(&trip, &driven, plan.beta_g_s, 11) {
                let mut opinions = 0;
                let mut own = |sub: &Subproblem, end, time, fence: Option<&[f64]>| {
                    let mut found = Solution::default();
                    fast.solve_into(sub, end, time, &mut found);
                    if found.status != SolveStatus::Solved {
                        opinions += 1;
                        return clarabel::solve(sub, end, time, fence);
                    }
                    found
                };
                let t = now_ms();
                window.replan(&trip, &mut own);
                of_structured.push(now_ms() - t);
                of_both += opinions;
                let t = now_ms();
                window.replan(&trip, &mut by_library);
                of_clarabel.push(now_ms() - t);
            }
        }
    }
    percentiles("structured", of_structured);
    println!("of these, subproblems that went to Clarabel after all: {of_both}");
    percentiles("Clarabel", of_clarabel);
}
