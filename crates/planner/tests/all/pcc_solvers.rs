//! The structured solver against Clarabel on identical subproblems.

use crate::pcc::{BANDS_KM_H, Engine, MASSES_KG, corpus, request, truck};
use planner::pcc::solve::{
    Solution, SolveStatus, Structured, Subproblem, Terminal, TimeRule, clarabel,
};
use planner::pcc::trip::Trip;

/// The subproblem's objective at a solution, g.
fn cost(sub: &Subproblem, end: Terminal, time: TimeRule, x: &Solution) -> f64 {
    let e = &x.e_j_kg;
    let mut sum = 0.0;
    for k in 0..sub.n {
        let p = sub.p(k, e, x.b_m_s2[k]);
        let mean = 0.5 * (e[k] + e[k + 1]);
        sum += sub.q1[k] * p + 0.5 * sub.q2[k] * p * p - sub.discount[k] * p.min(sub.kink[k]);
        sum += sub.ge[k] * mean + sub.wa[k] * (e[k + 1] - e[k]).powi(2);
        sum += 0.5 * sub.hessian_price * sub.t2[k] * (mean - sub.mean0[k]).powi(2);
        sum += sub.b_cost * x.b_m_s2[k];
        if k + 2 <= sub.n {
            sum += sub.wj * (e[k + 2] - 2.0 * e[k + 1] + e[k]).powi(2);
        }
    }
    if let TimeRule::Price(beta) = time {
        sum += beta * sub.time_s(e);
    }
    if let Terminal::Soft { reference, pay, credit } = end {
        let spare = e[sub.n] - reference;
        sum += if spare < 0.0 { -pay * spare } else { -credit * spare };
    }
    sum
}

#[test]
fn the_structured_solver_matches_clarabel_on_the_whole_corpus() {
    let mut compared = 0;
    let mut fast = Structured::default();
    for (name, profile) in corpus::roads() {
        for mass in MASSES_KG {
            let limits = truck(mass, Engine::Willans);
            let request = request(&profile, &limits, BANDS_KM_H[1]);
            let trip = Trip::new(&request).unwrap();
            let (mut worst, mut seen) = (0.0f64, 0);
            let mut judge = |sub: &Subproblem, end: Terminal, time: TimeRule, _: Option<&[f64]>| {
                seen += 1;
                let oracle = clarabel::solve(sub, end, time, None);
                if seen > 2 {
                    return oracle;
                }
                let price = TimeRule::Price(oracle.beta_g_s);
                let reference = sub.e_max[sub.n].min(190.0);
                // Worth of energy at the end, with a narrow and a wide indifferent range.
                let worth = 0.052 * mass / 1e3;
                let soft = |pay, credit| Terminal::Soft { reference, pay, credit };
                for (end, time) in [
                    (end, time),
                    (end, price),
                    (soft(3.0, 2.0), price),
                    (soft(1.15 * worth, 0.85 * worth), price),
                ] {
                    // Clarabel's own tolerance, 1e-8 of the cost, is too wide here: the cost is so
                    // flat along some directions that 1e-8 of it are 1e-4 of an energy.
                    let oracle = clarabel::solve_to(sub, end, time, None, 1e-10);
                    let mut own = Solution::default();
                    fast.solve_into(sub, end, time, &mut own);
                    if oracle.status != SolveStatus::Solved {
                        continue;
                    }
                    assert_eq!(own.status, SolveStatus::Solved, "{name} {mass} {time:?} {end:?}");
                    let (ours, theirs) =
                        (cost(sub, end, time, &own), cost(sub, end, time, &oracle));
                    assert!(
                        ours <= theirs + 1e-8 * theirs.abs().max(100.0),
                        "{name} {mass}: {ours} g, Clarabel {theirs} g"
                    );
                    let gap = own.e_j_kg.iter().zip(&oracle.e_j_kg);
                    let gap = gap.map(|(a, b)| (a - b).abs() / b).fold(0.0, f64::max);
                    worst = worst.max(gap);
                    compared += 1;
                }
                oracle
            };
            trip.solve(trip.cruise.trip_time_s(), *trip.cruise.e_j_kg.last().unwrap(), &mut judge);
            assert!(worst < 1e-4, "{name} {mass}: {worst:e}");
        }
    }
    assert!(compared > 100, "{compared}");
}

#[test]
#[ignore = "campaign: cargo test --release -p planner --test all pcc_solvers:: -- --ignored --nocapture"]
fn campaign_the_difference_to_clarabel_shrinks_with_clarabels_tolerance() {
    let tolerances = [1e-6, 1e-7, 1e-8, 1e-9, 1e-10];
    let mut worst = [(0.0f64, 0.0f64); 5];
    let mut fast = Structured::default();
    for (_, profile) in corpus::roads() {
        let limits = truck(55_000.0, Engine::Willans);
        let request = request(&profile, &limits, BANDS_KM_H[1]);
        let trip = Trip::new(&request).unwrap();
        let mut seen = 0;
        let mut judge = |sub: &Subproblem, end: Terminal, time: TimeRule, _: Option<&[f64]>| {
            let oracle = clarabel::solve(sub, end, time, None);
            seen += 1;
            if seen > 2 {
                return oracle;
            }
            let reference = sub.e_max[sub.n].min(190.0);
            let (end, time) = (
                Terminal::Soft { reference, pay: 3.0, credit: 2.0 },
                TimeRule::Price(oracle.beta_g_s),
            );
            let mut own = Solution::default();
            fast.solve_into(sub, end, time, &mut own);
            for (worst, tolerance) in worst.iter_mut().zip(tolerances) {
                let other = clarabel::solve_to(sub, end, time, None, tolerance);
                let gap = own.e_j_kg.iter().zip(&other.e_j_kg);
                let gap = gap.map(|(a, b)| (a - b).abs() / b).fold(0.0, f64::max);
                worst.0 = worst.0.max(gap);
                worst.1 = worst.1.max(cost(sub, end, time, &other) - cost(sub, end, time, &own));
            }
            oracle
        };
        trip.solve(trip.cruise.trip_time_s(), *trip.cruise.e_j_kg.last().unwrap(), &mut judge);
    }
    println!(
        "| Clarabel's tolerance | largest energy difference, relative | Clarabel's cost above, g |"
    );
    println!("|---|---|---|");
    for ((gap, dearer), tolerance) in worst.iter().zip(tolerances) {
        println!("| {tolerance:.0e} | {gap:.1e} | {dearer:.1e} |");
    }
    assert!(worst[4].0 < 0.1 * worst[0].0, "{worst:?}");
}
