//! The safe gap in worst-case simulations: sufficient at its full length, and tight.

use planner::safety::{RearResponse, SafeGap};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Worst case in steps of about 1 ms that end with the reaction time: the front vehicle brakes at once as hard as it can, the rear one
/// accelerates for its reaction time and then brakes no harder than it must. Calls `look` with
/// (time s, gap m, rear speed m/s, front speed m/s) in every step.
fn worst_case(
    gap: f64,
    (mut v_r, mut v_f): (f64, f64),
    r: &RearResponse,
    b_f: f64,
    grade: f64,
    mut look: impl FnMut(f64, f64, f64, f64),
) {
    let pull = 9.80665 * grade.sin();
    let (b_r, b_f) = (r.brake_min_m_s2 + pull, b_f + pull);
    let reaction_steps = (r.reaction_s / 1e-3).ceil();
    let dt = r.reaction_s / reaction_steps;
    let (mut gap, mut steps) = (gap, 0.0);
    while v_r > 0.0 {
        look(steps * dt, gap, v_r, v_f);
        let a_r: f64 = if steps < reaction_steps { r.accel_max_m_s2 } else { -b_r };
        let (next_r, next_f) = ((v_r + a_r * dt).max(0.0), f64::max(v_f - b_f * dt, 0.0));
        gap += 0.5 * (v_f + next_f - v_r - next_r) * dt;
        (v_r, v_f) = (next_r, next_f);
        steps += 1.0;
    }
    look(steps * dt, gap, v_r, v_f);
}

/// Collisions at `factor` times the safe gap in `draws` random situations.
fn collisions(draws: u32, factor: f64) -> u32 {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut count = 0;
    for _ in 0..draws {
        let rear = RearResponse {
            reaction_s: rng.random_range(0.5..2.0),
            accel_max_m_s2: rng.random_range(0.0..1.5),
            brake_min_m_s2: rng.random_range(2.5..4.5),
        };
        let b_f = rng.random_range(6.0..9.0);
        let grade = rng.random_range(-0.06..0.06);
        let (v_r, v_f) = (rng.random_range(5.0..33.0), rng.random_range(0.0..33.0));
        let gap = SafeGap::new(&rear, b_f, grade).gap_m(v_r, v_f);
        if gap < 1.0 {
            continue;
        }
        let mut least = gap;
        let speeds = (v_r, v_f);
        worst_case(gap * factor, speeds, &rear, b_f, grade, |_, g, _, _| least = least.min(g));
        // Up to a millisecond of standstill is integrated as driving: 0.01 m
        count += u32::from(least < -0.01);
    }
    count
}

#[test]
fn at_the_safe_gap_nobody_collides_and_at_nine_tenths_most_do() {
    let draws = 20_000;
    assert_eq!(collisions(draws, 1.0), 0);
    let tight = collisions(draws, 0.9);
    assert!(tight > draws / 2, "{tight} of {draws}");
}

#[test]
fn a_gap_that_is_safe_stays_safe_while_the_response_is_driven() {
    let rear = RearResponse { reaction_s: 1.0, accel_max_m_s2: 0.3, brake_min_m_s2: 3.5 };
    // Once the reaction time has passed, the response itself needs none
    let acting = RearResponse { reaction_s: 0.0, accel_max_m_s2: 0.0, ..rear };
    for v_r in [10.0, 18.0, 25.0, 30.0] {
        for v_f in [0.0, 10.0, 20.0, 30.0] {
            let gap = SafeGap::new(&rear, 8.0, -0.03).gap_m(v_r, v_f);
            let needed = SafeGap::new(&acting, 8.0, -0.03);
            worst_case(gap, (v_r, v_f), &rear, 8.0, -0.03, |t, gap, v_r, v_f| {
                let needs = needed.gap_m(v_r, v_f);
                assert!(t < 1.0 || gap >= needs - 0.01, "{gap} of {needs} at {t} s");
            });
        }
    }
}
