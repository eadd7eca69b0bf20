//! Closed loop over scenarios, seeds and deciders: collisions, hard braking caused, shifts, jerk.
//!
//! `cargo run --release -p sim --example kilometres -- [--km 1000] [--first-seed 1]
//! [--scenarios a,b] [--deciders keep,rules50,rules100,rules150,mobil] [--json FILE]` drives every
//! scenario with every decider, seed after seed, until the kilometres are full, and prints one row
//! per scenario and decider; `--json` writes the same. A collision's scenario, decider, seed and
//! time are printed as it happens.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use std::fmt::Write as _;

use planner::DeciderKind;
use planner::decider::MobilConfig;
use sim::{Drivability, Drive, Scenario, Status, World};
use tractrix_core::Vehicle;

struct Row {
    scenario: String,
    decider: String,
    runs: u32,
    collisions: u32,
    lane_changes: u32,
    safe_gap_violations: u32,
    drive: Option<Drivability>,
}

fn decider(name: &str) -> DeciderKind {
    match (name, name.strip_prefix("rules")) {
        ("keep", _) => DeciderKind::KeepLane,
        ("mobil", _) => DeciderKind::Mobil(MobilConfig::default()),
        (_, Some(distance)) => DeciderKind::Rules { distance_m: distance.parse().unwrap() },
        _ => panic!("{name}: keep, mobil or rulesDISTANCE"),
    }
}

/// Drives one run to its end and adds it to a row.
fn drive(row: &mut Row, seed: u64) {
    let mut scenario = Scenario::builtin(&row.scenario).unwrap();
    scenario.stack.decider = decider(&row.decider);
    let mut world = World::new(&scenario, seed).unwrap();
    let mut watch = Drivability::new(world.truck().limits(), &scenario.stack.rss);
    let mut hit = 0;
    while world.tick(&mut watch).unwrap() == Status::Running {
        let hits = world.collisions();
        if hits > hit {
            let (name, by, t) = (&row.scenario, &row.decider, world.now().seconds());
            println!("COLLISION {name} {by} seed {seed} at {t:.2} s");
            hit = hits;
        }
    }
    let summary = world.summary();
    row.runs += 1;
    row.collisions += summary.collisions;
    row.lane_changes += summary.lane_changes;
    row.safe_gap_violations += summary.rss_violations;
    match &mut row.drive {
        Some(sum) => sum.join(&watch),
        None => row.drive = Some(watch),
    }
}

fn line(row: &Row, d: &Drive) -> String {
    let km = d.distance_m * 1e-3;
    format!(
        "{:14} {:9} {:4} {:7.1} {:4} {:5} {:5} {:5} {:6.2} {:4} {:4} {:6.1} {:5.0} {:5.2} {:5.2} {:5.2} {:5.2} {:5.2}",
        row.scenario,
        row.decider,
        row.runs,
        km,
        row.collisions,
        row.safe_gap_violations,
        d.hard_braking_caused,
        row.lane_changes,
        f64::from(d.shifts) / km,
        d.taken_back,
        d.up_while_slowing,
        d.lugging_s,
        d.min_engine_rpm,
        d.accel_m_s2.p99,
        d.decel_m_s2.p99,
        d.jerk_m_s3.p95,
        d.jerk_m_s3.p99,
        d.jerk_m_s3.max,
    )
}

fn json(row: &Row, d: &Drive) -> String {
    format!(
        "{{\"scenario\":\"{}\",\"decider\":\"{}\",\"runs\":{},\"collisions\":{},\"lane_changes\":{},\
         \"safe_gap_violations\":{},\"drive\":{}}}",
        row.scenario,
        row.decider,
        row.runs,
        row.collisions,
        row.lane_changes,
        row.safe_gap_violations,
        serde_json::to_string(d).unwrap()
    )
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let value = |flag: &str| args.iter().position(|a| a == flag).map(|i| args[i + 1].clone());
    let list = |flag: &str, otherwise: String| -> Vec<String> {
        value(flag).unwrap_or(otherwise).split(',').map(str::to_owned).collect()
    };
    let km: f64 = value("--km").map_or(1_000.0, |v| v.parse().unwrap());
    let first: u64 = value("--first-seed").map_or(1, |v| v.parse().unwrap());
    let scenarios = list("--scenarios", Scenario::names().collect::<Vec<_>>().join(","));
    let deciders = list("--deciders", "keep,rules50,rules100,rules150,mobil".into());
    let mut rows: Vec<Row> = scenarios
        .iter()
        .flat_map(|s| deciders.iter().map(move |d| (s.clone(), d.clone())))
        .map(|(scenario, decider)| Row {
            scenario,
            decider,
            runs: 0,
            collisions: 0,
            lane_changes: 0,
            safe_gap_violations: 0,
            drive: None,
        })
        .collect();
    let driven = |rows: &[Row]| -> f64 {
        rows.iter().filter_map(|r| r.drive.as_ref()).map(|d| d.figures().distance_m * 1e-3).sum()
    };
    for seed in first.. {
        for i in 0..rows.len() {
            if driven(&rows) < km {
                drive(&mut rows[i], seed);
            }
        }
        if driven(&rows) >= km {
            break;
        }
    }
    println!(
        "{:14} {:9} {:>4} {:>7} {:>4} {:>5} {:>5} {:>5} {:>6} {:>4} {:>4} {:>6} {:>5} {:>5} {:>5} {:>5} {:>5} {:>5}",
        "scenario",
        "decider",
        "runs",
        "km",
        "hits",
        "rss",
        "hard",
        "lanes",
        "sh/km",
        "back",
        "up-",
        "lug s",
        "n min",
        "a p99",
        "b p99",
        "j p95",
        "j p99",
        "j max"
    );
    let mut all = Row {
        scenario: "all".into(),
        decider: String::new(),
        runs: 0,
        collisions: 0,
        lane_changes: 0,
        safe_gap_violations: 0,
        drive: None,
    };
    let mut text = String::from("[");
    for row in rows.iter().filter(|r| r.drive.is_some()) {
        let drive = row.drive.as_ref().unwrap();
        println!("{}", line(row, &drive.figures()));
        writeln!(text, "{},", json(row, &drive.figures())).unwrap();
        all.runs += row.runs;
        all.collisions += row.collisions;
        all.lane_changes += row.lane_changes;
        all.safe_gap_violations += row.safe_gap_violations;
        match &mut all.drive {
            Some(sum) => sum.join(drive),
            None => all.drive = Some(drive.clone()),
        }
    }
    if let Some(drive) = &all.drive {
        println!("{}", line(&all, &drive.figures()));
        write!(text, "{}]", json(&all, &drive.figures())).unwrap();
    }
    if let Some(file) = value("--json") {
        std::fs::write(file, text).unwrap();
    }
}
