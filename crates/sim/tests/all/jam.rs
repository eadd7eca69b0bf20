//! The truck in jams.

use crate::support::{Followed, follow, jams, slope};
use planner::StackConfig;

/// Every jam with a truck and a grade of its own: empty downhill, loaded on the flat, uphill.
fn drive(mut check: impl FnMut(&str, &Followed)) {
    for (name, speeds) in jams() {
        for (payload_kg, grade) in [(0.0, -0.03), (36_000.0, 0.0), (21_000.0, 0.03)] {
            let config = StackConfig::default();
            let f = follow("sinotruk", payload_kg, &slope(grade), &speeds, &config, &mut ());
            check(&format!("{name}, {payload_kg} kg, {grade:+}"), &f);
        }
    }
}

/// A jam of 145 s made 27 shifts, one of them up while the truck was slowing down, the clutch
/// stayed closed down to 483 rpm, and +0.45 m/s² was followed by -2 within a second.
#[test]
fn a_jam_takes_few_shifts_no_low_engine_speed_and_no_jerk() {
    let mut wrong = Vec::new();
    let (mut shifts, mut minutes) = (0.0, 0.0);
    drive(|case, f| {
        let d = &f.drive;
        let per_min = f64::from(d.shifts) / d.duration_s * 60.0;
        shifts += f64::from(d.shifts);
        minutes += d.duration_s / 60.0;
        // The end of a queue at 20 m/s is an emergency: a lead that brakes with 3 m/s².
        let calm = !case.starts_with("queue");
        let bars = [
            ("collisions", f64::from(f.summary.collisions), 0.0),
            ("shifts a minute", per_min, 6.0),
            ("shifts up while slowing", f64::from(d.up_while_slowing), 0.0),
            // One that has almost stopped and starts again at once.
            ("shifts taken back", f64::from(d.taken_back), 1.0),
            ("s below idle", d.below_idle_s, 0.0),
            ("s of lugging", d.lugging_s, 0.0),
            ("m/s2 forward", d.accel_m_s2.max, 0.7),
            ("m/s2 braking", if calm { d.decel_m_s2.max } else { 0.0 }, 1.2),
            ("m/s3", if calm { d.jerk_m_s3.p99 } else { 0.0 }, 1.0),
            ("m/s3 wanted", if calm { d.wanted_jerk_m_s3.max } else { 0.0 }, 1.0),
            ("m short of 2 m of gap", 2.0 - d.min_gap_m.unwrap_or(2.0), 0.0),
        ];
        for (what, value, bar) in bars {
            if value > bar {
                wrong.push(format!("{case}: {value:.2} {what}, bar {bar}"));
            }
        }
    });
    assert!(shifts / minutes < 3.0, "{:.1} shifts a minute in all jams", shifts / minutes);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The truck went along with every wave of the traffic ahead: it stopped six times in a jam of five
/// minutes, as often as the car ahead.
#[test]
fn the_gap_takes_up_the_waves_of_a_jam() {
    for (name, speeds) in jams().into_iter().filter(|j| ["race", "creep", "slow"].contains(&j.0)) {
        let config = StackConfig::default();
        let f = follow("sinotruk", 36_000.0, &slope(0.0), &speeds, &config, &mut ());
        let stops = speeds.windows(2).filter(|w| w[0] > 0.0 && w[1] <= 0.0).count() as u32;
        let d = &f.drive;
        assert!(d.stops <= stops.div_ceil(2), "{name}: {} stops behind {stops}", d.stops);
        assert!(d.max_gap_m.unwrap() < 65.0, "{name}: {:?}", d.max_gap_m);
    }
}
