//! The learned decider against an independent forward pass, and what it refuses.

use planner::decider::Policy;
use planner::decider::observation::{ObservationSpec, SIZE};
use planner::{LaneChoice, PlannerError};

const WEIGHTS: &[u8] = include_bytes!("../fixtures/policy.safetensors");
const SIDECAR: &str = include_str!("../fixtures/policy.json");
const GOLDEN: &[u8] = include_bytes!("../fixtures/golden.safetensors");

fn floats(file: &safetensors::SafeTensors<'_>, name: &str) -> Vec<f32> {
    let bytes = file.tensor(name).unwrap();
    bytes.data().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn the_forward_pass_equals_an_independent_one_to_1e_5() {
    let policy = Policy::from_files(WEIGHTS, SIDECAR).unwrap();
    let golden = safetensors::SafeTensors::deserialize(GOLDEN).unwrap();
    assert_eq!(policy.spec(), ObservationSpec::Paper216);
    let mut scratch = policy.scratch();
    let (observations, values) = (floats(&golden, "observations"), floats(&golden, "values"));
    for (x, q) in observations.chunks_exact(SIZE).zip(values.chunks_exact(3)) {
        let ours = policy.values(x, &mut scratch);
        for (a, b) in ours.iter().zip(q) {
            assert!((a - b).abs() < 1e-5, "{a} and {b}");
        }
    }
    assert_eq!(observations.len(), 64 * SIZE);
    assert!(policy.values(&observations[1..SIZE], &mut scratch).iter().all(|v| v.is_nan()));
}

#[test]
fn the_mask_removes_lanes_that_do_not_exist() {
    let policy = Policy::from_files(WEIGHTS, SIDECAR).unwrap();
    let golden = safetensors::SafeTensors::deserialize(GOLDEN).unwrap();
    let (mut seen, mut scratch) = ([0; 3], policy.scratch());
    for x in floats(&golden, "observations").chunks_exact(SIZE) {
        let free = policy.choose(x, &mut scratch, |_| true);
        seen[free as usize] += 1;
        assert_eq!(policy.choose(x, &mut scratch, |_| false), LaneChoice::Keep);
        let other = |choice| choice != free || free == LaneChoice::Keep;
        let masked = policy.choose(x, &mut scratch, other);
        assert!(masked != free || free == LaneChoice::Keep);
    }
    assert!(seen.iter().filter(|n| **n > 0).count() >= 2, "{seen:?}");
}

fn refused(weights: &[u8], sidecar: &str, word: &str) {
    let error = Policy::from_files(weights, sidecar).unwrap_err();
    assert!(matches!(error, PlannerError::Policy(_)));
    assert!(error.to_string().contains(word), "{error}");
}

#[test]
fn weights_for_another_observation_are_refused_by_hash() {
    let hash = format!("{:016x}", ObservationSpec::Paper216.hash());
    refused(WEIGHTS, &SIDECAR.replace(&hash, "0123456789abcdef"), "observation");
    // The hash says what the policy sees: these weights have no columns for what ours adds.
    let ours = format!("{:016x}", ObservationSpec::Tractrix1.hash());
    refused(WEIGHTS, &SIDECAR.replace(&hash, &ours), "237 inputs");
}

#[test]
fn torn_or_foreign_files_are_refused_with_their_reason() {
    refused(&WEIGHTS[..WEIGHTS.len() - 7], SIDECAR, "SHA-256");
    refused(WEIGHTS, "{}", "policy.json");
    refused(WEIGHTS, &SIDECAR.replace("\"keep\"", "\"left\""), "actions");
    let layers = vec![(vec![0.0; SIZE * 3], vec![f32::NAN; 3])];
    let actions = [LaneChoice::Left, LaneChoice::Keep, LaneChoice::Right];
    assert!(
        Policy::new(ObservationSpec::Paper216, &layers, actions)
            .unwrap_err()
            .to_string()
            .contains("finite")
    );
    let layers = vec![(vec![0.0; SIZE * 2], vec![0.0; 2])];
    assert!(
        Policy::new(ObservationSpec::Paper216, &layers, actions)
            .unwrap_err()
            .to_string()
            .contains("2 outputs")
    );
}
