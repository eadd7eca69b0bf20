//! A step of a kinematic environment, and keeping a state and going back to it, ask for no memory
//! once the first steps have.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

#[path = "support/arrays.rs"]
mod arrays;
#[path = "../../planner/tests/support/counting.rs"]
mod counting;

use arrays::{Arrays, allowed};
use counting::requests_of;
use sim::Scenario;
use sim::batch::{Batch, EnvSnapshot, EnvSpec, Fidelity};

fn batch(name: &str) -> (Batch, Arrays) {
    let scenario = Scenario::builtin(name).unwrap();
    let spec = EnvSpec { start_spread_m: 500.0, ..EnvSpec::new(scenario, Fidelity::Kinematic) };
    let mut batch = Batch::new(vec![spec; 2], 3, 1).unwrap();
    let mut arrays = Arrays::of(&batch);
    batch.reset(None, &mut arrays.views()).unwrap();
    (batch, arrays)
}

#[test]
fn steps_after_the_first_ask_for_no_memory() {
    for name in ["table2-dense-12.5", "table2-medium-15", "table2-sparse-12.5"] {
        let (mut batch, mut arrays) = batch(name);
        let mut changes = 0;
        for step in 0..300 {
            let actions = [0, 1].map(|i| allowed(&arrays.mask[3 * i..3 * i + 3], step / 7 + i));
            let requests = requests_of(|| batch.step(&actions, &mut arrays.views()).unwrap());
            assert!(step == 0 || requests == 0, "{name}: step {step}: {requests} requests");
            changes = arrays.episodes[0].lane_changes;
        }
        assert!(changes > 0, "{name}");
    }
}

#[test]
fn keeping_a_state_and_going_back_asks_for_memory_once() {
    for name in ["table2-dense-12.5", "table2-sparse-15"] {
        let (mut batch, mut arrays) = batch(name);
        let mut kept = EnvSnapshot::default();
        let mut keep = |batch: &Batch| requests_of(|| batch.save(0, &mut kept));
        assert!(keep(&batch) > 0, "the first makes room, or this counts nothing");
        for _ in 0..20 {
            batch.step(&[1, 1], &mut arrays.views()).unwrap();
            assert_eq!(keep(&batch), 0, "{name}");
        }
        for _ in 0..20 {
            batch.step(&[1, 1], &mut arrays.views()).unwrap();
            assert_eq!(requests_of(|| batch.restore(0, &kept)), 0, "{name}");
        }
    }
}
