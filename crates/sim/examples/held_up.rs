//! Why the truck does not get past: who is ahead, what the decider wishes, what the gate says.
//!
//! `cargo run --release -p sim --example held_up -- [--scenarios highway] [--seeds 10]
//! [--decider mobil|METRES] [--log SEED]` drives every scenario with seeds from 1 on, each against its ghost, and prints a row per run:
//! saving, time held up, lane changes, refusals by reason, collisions, and vehicles put to braking
//! harder than 2 m/s² by a lane change of the truck. `--log` prints every second of one seed instead.
#![allow(clippy::unwrap_used, missing_docs)]
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use std::collections::{BTreeMap, BTreeSet};

use planner::DeciderKind;
use planner::decider::MobilConfig;
use planner::safety::{RssConfig, SafeGap};
use sim::{Drivability, Scenario, Status, World};
use tractrix_core::{Geometry, Maneuver, Neighbour, Recorder, Tick, Vehicle};

/// Braking behind the truck that counts, m/s².
const BRAKING_M_S2: f64 = 2.0;
/// Time after a change for which braking of the new follower is the truck's doing, s.
const AFTER_S: f64 = 5.0;

struct Watch {
    drive: Drivability,
    geometry: Geometry,
    rss: RssConfig,
    log: bool,
    refusals: BTreeMap<String, u32>,
    braked: BTreeSet<u64>,
    hardest_m_s2: f64,
    changing: bool,
    changed_s: f64,
    ticks: u64,
}

impl Watch {
    fn beside<'a>(&self, t: &'a Tick<'_>, lane: u16, ahead: bool) -> Option<&'a Neighbour> {
        let front = t.ego.s_m + self.geometry.front_m;
        let there = |n: &&Neighbour| {
            (n.lane == lane || n.target_lane == Some(lane)) && (n.front_s_m > front) == ahead
        };
        let all = t.scene.neighbours.iter().filter(there);
        if ahead {
            all.min_by(|a, b| a.rear_s_m.total_cmp(&b.rear_s_m))
        } else {
            all.max_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m))
        }
    }

    fn line(&self, t: &Tick<'_>) {
        let front = t.ego.s_m + self.geometry.front_m;
        let rear = t.ego.s_m - self.geometry.rear_m();
        let v = t.ego.speed_m_s;
        let one = |n: Option<&Neighbour>, ahead: bool| match n {
            None => format!("{:28}", "-"),
            Some(n) => {
                let gap = if ahead { n.rear_s_m - front } else { rear - n.front_s_m };
                let class = &format!("{:?}", n.class)[..2];
                let safe = if ahead {
                    String::new()
                } else {
                    let safe =
                        SafeGap::new(&self.rss.behind(n.class), self.rss.ego_brake_max_m_s2, 0.0);
                    format!("/{:3.0}", safe.gap_m(n.speed_m_s, v))
                };
                format!(
                    "{class} {:3} {gap:5.0}{safe} m {:4.1} m/s {:4.1}",
                    n.id, n.speed_m_s, n.accel_m_s2
                )
            }
        };
        let lane = t.plan.lane;
        print!(
            "{:5.0} s {:6.0} m lane {lane} v {v:4.1} ref {:4.1} {:?} {} ",
            t.now.seconds(),
            t.ego.s_m,
            t.plan.reference_speed_m_s,
            t.plan.maneuver,
            if t.plan.held_up { "held" } else { "    " },
        );
        println!(
            "| own {} | left {} | {} | right {} | {} | {:?} {:?}",
            one(self.beside(t, lane, true), true),
            one(self.beside(t, lane + 1, true), true),
            one(self.beside(t, lane + 1, false), false),
            if lane > 0 { one(self.beside(t, lane - 1, true), true) } else { "none".into() },
            if lane > 0 { one(self.beside(t, lane - 1, false), false) } else { "none".into() },
            t.plan.reason,
            t.plan.refusal,
        );
    }
}

impl Recorder for Watch {
    fn record(&mut self, t: &Tick<'_>) {
        self.drive.record(t);
        let changing = t.plan.maneuver != Maneuver::KeepLane;
        if changing || self.changing {
            self.changed_s = t.now.seconds();
        }
        self.changing = changing;
        if let Some(reason) = t.plan.refusal {
            *self.refusals.entry(format!("{reason:?}")).or_default() += 1;
        }
        if t.now.seconds() - self.changed_s < AFTER_S {
            let front = t.ego.s_m + self.geometry.front_m;
            let target = match t.plan.maneuver {
                Maneuver::ChangeLeft => t.plan.lane + 1,
                Maneuver::ChangeRight => t.plan.lane.saturating_sub(1),
                _ => t.plan.lane,
            };
            if let Some(n) = self.beside(t, target, false)
                && n.front_s_m > front - 150.0
            {
                self.hardest_m_s2 = self.hardest_m_s2.max(-n.accel_m_s2);
                if n.accel_m_s2 < -BRAKING_M_S2 {
                    self.braked.insert(n.id);
                }
            }
        }
        if self.log && self.ticks.is_multiple_of(100) {
            self.line(t);
        }
        self.ticks += 1;
    }
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let value = |flag: &str| args.iter().position(|a| a == flag).map(|i| args[i + 1].clone());
    let scenarios = value("--scenarios").unwrap_or("highway".into());
    let seeds: u64 = value("--seeds").map_or(10, |v| v.parse().unwrap());
    let log: Option<u64> = value("--log").map(|v| v.parse().unwrap());
    for name in scenarios.split(',') {
        println!(
            "scenario      seed saved % free % held s held km  v m/s  km   fuel g changes right hits hard braked most  refusals"
        );
        let mut mean = [0.0; 5];
        let range = log.map_or(1..=seeds, |seed| seed..=seed);
        let count = range.clone().count() as f64;
        for seed in range {
            let mut scenario = Scenario::builtin(name).unwrap();
            match value("--decider").as_deref() {
                None => {}
                Some("mobil") => {
                    scenario.stack.decider = DeciderKind::Mobil(MobilConfig::default())
                }
                Some(d) => {
                    scenario.stack.decider = DeciderKind::Rules { distance_m: d.parse().unwrap() }
                }
            }
            let mut world = World::new(&scenario, seed).unwrap();
            world.attach_ghost().unwrap();
            let mut watch = Watch {
                drive: Drivability::new(world.truck().limits(), &scenario.stack.rss),
                geometry: world.geometry(),
                rss: scenario.stack.rss,
                log: log.is_some(),
                refusals: BTreeMap::new(),
                braked: BTreeSet::new(),
                hardest_m_s2: 0.0,
                changing: false,
                changed_s: f64::NEG_INFINITY,
                ticks: 0,
            };
            while world.tick(&mut watch).unwrap() == Status::Running {}
            let s = world.summary();
            let g = world.ghost().unwrap();
            println!(
                "{name:13} {seed:4} {:7.1} {:6.1} {:6.0} {:7.1} {:6.2} {:4.1} {:6.0} {:8} {:5.2} {:4} {:4} {:6} {:4.1}  {:?}",
                100.0 * g.saving_frac.unwrap_or(f64::NAN),
                100.0 * g.free_saving_frac.unwrap_or(f64::NAN),
                g.held_up_s,
                1e-3 * g.held_up_m,
                s.mean_speed_m_s,
                1e-3 * s.distance_m,
                s.fuel_g,
                s.lane_changes,
                s.keep_right_frac,
                s.collisions,
                watch.drive.figures().hard_braking_caused,
                watch.braked.len(),
                watch.hardest_m_s2,
                watch.refusals
            );
            for (sum, x) in mean.iter_mut().zip([
                100.0 * g.saving_frac.unwrap_or(f64::NAN),
                g.held_up_s,
                s.mean_speed_m_s,
                f64::from(s.lane_changes),
                watch.braked.len() as f64,
            ]) {
                *sum += x / count;
            }
        }
        println!(
            "{name:13} mean {:7.1} saved, {:.0} s held up, {:.2} m/s, {:.1} changes, {:.1} braked",
            mean[0], mean[1], mean[2], mean[3], mean[4]
        );
    }
}
