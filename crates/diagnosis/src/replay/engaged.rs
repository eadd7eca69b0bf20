//! Where the driveline is closed: in a gear, the clutch shut, no shift near.

use tractrix_core::RPM_PER_RAD_S;

use crate::Plant;

/// Without a gear, a driveline counts from this engine speed over idling and this speed on, m/s, where
/// their ratio changes by less than a part in the margin of a shift.
const OVER_IDLE: f64 = 1.15;
const LEAST_M_S: f64 = 2.5;
const RESTS_FRAC: f64 = 0.03;

/// Samples kept away from a shift on either side.
const SHIFT_MARGIN: usize = 12;

/// Runs of true, as (first, number).
pub(super) fn runs(on: &[bool]) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    let mut start = None;
    for (i, s) in on.iter().enumerate() {
        match (s, start) {
            (true, None) => start = Some(i),
            (false, Some(a)) => {
                out.push((a, i - a));
                start = None;
            }
            _ => {}
        }
    }
    out
}

/// In gear, clutch closed (engine speed fits the gear), no shift within the margin.
pub(super) fn engaged(
    plant: &Plant,
    speed: &[f64],
    rpm: &[f64],
    gear: &[usize],
    shifting: &[bool],
) -> Vec<bool> {
    let n = speed.len();
    let mut near = vec![false; n];
    for i in 0..n {
        if shifting[i] || (i > 0 && gear[i] != gear[i - 1]) {
            let (a, b) = (i.saturating_sub(SHIFT_MARGIN), (i + SHIFT_MARGIN).min(n - 1));
            near[a..=b].fill(true);
        }
    }
    (0..n)
        .map(|i| {
            let in_gear = |g| plant.truck.driveline.engine_speed_rad_s(speed[i], g);
            let expected = u8::try_from(gear[i]).map_or(0.0, in_gear) * RPM_PER_RAD_S;
            expected != 0.0 && !near[i] && (rpm[i] - expected).abs() < 60.0 + 0.08 * expected
        })
        .collect()
}

/// Where no gear was logged: the engine pulls or is turned, and engine over road speed rests over the
/// margins of a shift, as it does in a gear whether or not a converter slips.
pub(super) fn steady_ratio(plant: &Plant, speed: &[f64], rpm: &[f64]) -> Vec<bool> {
    let idle = plant.truck.engine.idle_speed_rpm;
    let ratio = |i: usize| {
        let turns = rpm[i] > OVER_IDLE * idle && speed[i] > LEAST_M_S;
        turns.then(|| (rpm[i] / speed[i]).ln())
    };
    let last = speed.len().saturating_sub(1);
    let around = |i: usize| [i.saturating_sub(SHIFT_MARGIN), i, (i + SHIFT_MARGIN).min(last)];
    (0..speed.len())
        .map(|i| {
            let [Some(before), Some(now), Some(after)] = around(i).map(ratio) else { return false };
            (now - before).abs() < RESTS_FRAC && (after - now).abs() < RESTS_FRAC
        })
        .collect()
}
