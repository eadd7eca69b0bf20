//! The structured solver asks for memory only while its workspace grows.

#[path = "support/counting.rs"]
mod counting;
#[path = "support/pcc/mod.rs"]
mod support;

use counting::requests_of;
use planner::pcc::model::drive_profile;
use planner::pcc::solve::{
    CutModel, Linearisation, Solution, SolveStatus, Structured, Subproblem, Terminal, TimeRule,
};
use planner::pcc::trip::Trip;
use support::{BANDS_KM_H, Engine, corpus, request, truck};

#[test]
fn after_the_first_solve_neither_linearisation_nor_solution_allocates() {
    let (_, profile) = corpus::roads().swap_remove(4);
    let limits = truck(55_000.0, Engine::Willans);
    let request = request(&profile, &limits, BANDS_KM_H[1]);
    let trip = Trip::new(&request).unwrap();
    let (truck, course, gears) = (&trip.truck, &trip.course, &trip.cruise.drive);
    // Another profile, so that the second solve is another problem than the first.
    let slower: Vec<f64> = trip.cruise.e_j_kg.iter().map(|e| 0.97 * e).collect();
    let slower = drive_profile(truck, course, &slower, gears, &[], 0.0).e_j_kg;
    let (mut sub, mut solver, mut found) =
        (Subproblem::default(), Structured::default(), Solution::default());
    let mut solve = |e: &[f64], terminal: Terminal, time: TimeRule| {
        let point = Linearisation { e_j_kg: e, gears, beta_g_s: 3.0, cut: CutModel::Hull };
        sub.linearise(truck, course, &trip.tuning, &point);
        sub.e_max.copy_from_slice(&trip.e_max);
        for (low, e) in sub.e_min.iter_mut().zip(e) {
            *low = 0.8 * e;
        }
        solver.solve_into(&sub, terminal, time, &mut found);
        assert_eq!(found.status, SolveStatus::Solved);
    };
    let end = trip.cruise.e_j_kg[course.n()];
    let fixed = (Terminal::Fixed(end), TimeRule::AtMost(1.01 * trip.cruise.trip_time_s()));
    let soft = (Terminal::Soft { reference: end, pay: 3.3, credit: 2.4 }, TimeRule::Price(3.0));
    assert!(requests_of(|| solve(&trip.cruise.e_j_kg, fixed.0, fixed.1)) > 0, "counts nothing");
    assert_eq!(requests_of(|| solve(&slower, soft.0, soft.1)), 0);
    assert_eq!(requests_of(|| solve(&slower, fixed.0, fixed.1)), 0);
}
