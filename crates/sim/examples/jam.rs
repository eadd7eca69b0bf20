//! A truck behind a vehicle that stops and goes: shifts, engine speed, comfort, gaps.
//!
//! `cargo run --release -p sim --example jam -- [--truck NAME] [--speeds FILE.csv] [--trace JAM
//! PAYLOAD_KG GRADE]` drives every jam of `tests/support` at 19, 40 and 55 t on -3, 0 and +3 %;
//! with `--speeds` the lead's speeds come from a file instead (one run per line, m/s, comma
//! separated, 0.5 s apart), on the flat; with `--trace` one case is printed every half second.
#![allow(clippy::unwrap_used, missing_docs)]
#![expect(clippy::disallowed_macros, reason = "an example prints")]

#[path = "../tests/support/mod.rs"]
mod support;

use planner::StackConfig;
use support::{Followed, follow, jams, slope};
use tractrix_core::{Recorder, Tick};

const PAYLOADS_KG: [f64; 3] = [0.0, 21_000.0, 36_000.0];
const GRADES: [f64; 3] = [-0.03, 0.0, 0.03];

struct Trace(Option<u64>);

impl Recorder for Trace {
    fn record(&mut self, tick: &Tick<'_>) {
        let Some(ticks) = &mut self.0 else { return };
        *ticks += 1;
        if *ticks % 50 != 1 {
            return;
        }
        let (e, p) = (tick.ego, &tick.ego.powertrain);
        let lead = tick.scene.neighbours.first().copied().unwrap_or_default();
        let c = &tick.plan.command;
        println!(
            "{:6.1} v {:5.2} lead {:5.2} gap {:5.1} a {:5.2} wanted {:5.2} gear {:2}{} n {:4.0} pedal {:.2} retarder {:.2} brake {:.2} {:?}",
            tick.now.seconds(),
            e.speed_m_s,
            lead.speed_m_s,
            lead.rear_s_m - e.s_m - 5.3,
            e.accel_x_m_s2,
            tick.plan.target_accel_m_s2,
            p.gear,
            if p.shift_in_progress { "*" } else { " " },
            p.engine_speed_rad_s * tractrix_core::RPM_PER_RAD_S,
            c.accelerator_pedal_frac,
            c.retarder_frac,
            c.xbr_decel_m_s2,
            tick.plan.guard,
        );
    }
}

fn show(name: &str, f: &Followed) {
    let (d, s) = (&f.drive, &f.summary);
    println!(
        "{name:24} {:5.1} {:3} {:3} {:3} {:5.0} {:5.1} {:5.1} {:6.2} {:6.2} {:6.2} {:6.2} {:6.2} {:6.2} {:6.1} {:6.1} {:6.1} {:3}",
        f64::from(d.shifts) / d.duration_s * 60.0,
        d.taken_back,
        d.up_while_slowing,
        d.stops,
        d.min_engine_rpm,
        d.below_idle_s,
        d.lugging_s,
        d.accel_m_s2.p99,
        d.accel_m_s2.max,
        d.decel_m_s2.p99,
        d.decel_m_s2.max,
        d.jerk_m_s3.p99,
        d.jerk_m_s3.max,
        d.min_gap_m.unwrap_or(f64::NAN),
        d.max_gap_m.unwrap_or(f64::NAN),
        s.min_time_to_collision_s.unwrap_or(f64::INFINITY),
        s.collisions,
    );
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let after = |flag: &str| args.iter().position(|a| a == flag).map(|i| &args[i + 1..]);
    let truck = after("--truck").map_or("sinotruk", |a| a[0].as_str()).to_owned();
    let config = StackConfig::default();
    if let Some(case) = after("--trace") {
        let (_, speeds) = jams().into_iter().find(|j| j.0 == case[0]).unwrap();
        let road = slope(case[2].parse().unwrap());
        follow(&truck, case[1].parse().unwrap(), &road, &speeds, &config, &mut Trace(Some(0)));
        return;
    }
    println!(
        "{:24} {:>5} {:>3} {:>3} {:>3} {:>5} {:>5} {:>5} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>3}",
        "case",
        "sh/m",
        "bck",
        "up-",
        "stp",
        "n min",
        "<idle",
        "lug s",
        "a p99",
        "a max",
        "b p99",
        "b max",
        "j p99",
        "j max",
        "gap-",
        "gap+",
        "ttc",
        "hit"
    );
    if let Some(file) = after("--speeds") {
        let text = std::fs::read_to_string(&file[0]).unwrap();
        for (i, line) in text.lines().enumerate() {
            let speeds: Vec<f64> = line.split(',').map(|v| v.trim().parse().unwrap()).collect();
            for payload in PAYLOADS_KG {
                let f = follow(&truck, payload, &slope(0.0), &speeds, &config, &mut Trace(None));
                show(&format!("line {} {:.0} t", i + 1, 19.0 + payload * 1e-3), &f);
            }
        }
        return;
    }
    for (name, speeds) in jams() {
        for payload in PAYLOADS_KG {
            for grade in GRADES {
                let road = slope(grade);
                let f = follow(&truck, payload, &road, &speeds, &config, &mut Trace(None));
                let t = 19.0 + payload * 1e-3;
                show(&format!("{name} {t:.0} t {:+.0} %", 100.0 * grade), &f);
            }
        }
    }
}
