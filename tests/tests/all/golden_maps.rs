//! Maps of behaviour, kept as text and reviewed like code: a change of the truck or the stack shows
//! here as lines that differ, and whoever made it says in the commit why they may.
//!
//! `GOLDEN=write cargo test --release -p tractrix-tests --test all golden_maps::` writes them anew.

use std::fmt::Write;
use std::path::Path;

use dynamics::{RoadPatch, TruckModel, TruckParameters};
use planner::DeciderKind;
use sim::{Scenario, World};
use tractrix_core::{BrakeMode, Command};

fn compare(name: &str, now: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden").join(name);
    if std::env::var_os("GOLDEN").is_some_and(|v| v == "write") {
        std::fs::write(&path, now).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    for (line, (a, b)) in kept.lines().zip(now.lines()).enumerate() {
        assert_eq!(a, b, "line {} of {}", line + 1, path.display());
    }
    assert_eq!(kept.lines().count(), now.lines().count(), "{}", path.display());
}

/// Metres from the demand to standstill, 80 km/h, full service braking (6 m/s² demanded) on a dry
/// road; a dash where the truck does not stop within five minutes.
#[test]
fn stopping_distance_over_mass_and_grade() {
    let grades = [-6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0];
    let mut text = String::from("stopping distance, m, from 80 km/h\nmass, t |");
    for g in grades {
        write!(text, "{g:6.0} %").unwrap();
    }
    for mass_kg in [19e3, 30e3, 40e3, 50e3, 55e3] {
        let file = Scenario::builtin("highway").unwrap().truck.file;
        let truck = TruckParameters::load(&file).unwrap();
        let empty = TruckModel::new(truck.clone(), 0.0).unwrap().mass_kg();
        let model = TruckModel::new(truck, mass_kg - empty).unwrap();
        write!(text, "\n{:7.0} |", 1e-3 * mass_kg).unwrap();
        for g in grades {
            let patch = RoadPatch { grade_rad: (0.01_f64 * g).atan(), ..RoadPatch::default() };
            let command = Command {
                xbr_decel_m_s2: 6.0,
                brake_mode: BrakeMode::Maximum,
                ..Command::default()
            };
            let mut s = model.initial_state(0.0, 0.0, 0.0, 80.0 / 3.6);
            let mut steps = 0;
            while s.speed_m_s > 0.0 && steps < 30_000 {
                s = model.step(&s, &command, &patch, 0.01).unwrap();
                steps += 1;
            }
            if s.speed_m_s > 0.0 {
                write!(text, "       -").unwrap();
            } else {
                write!(text, "{:8.1}", s.distance_m).unwrap();
            }
        }
    }
    text.push('\n');
    compare("stopping_distance.txt", &text);
}

/// What a decider does with 400 s of each density, seed 1.
#[test]
fn density_over_decider() {
    let rules = |distance_m| DeciderKind::Rules { distance_m };
    let deciders = [
        ("keep", DeciderKind::KeepLane),
        ("rules:50", rules(50.0)),
        ("rules:150", rules(150.0)),
        ("mobil", DeciderKind::Mobil(planner::decider::MobilConfig::default())),
    ];
    let mut text = String::from(
        "scenario     | decider   | distance, m | changes | collisions | delta speed, % | guard ticks",
    );
    for scenario in ["dense-12.5", "medium-12.5", "sparse-12.5"] {
        for (name, decider) in &deciders {
            let mut s = Scenario::builtin(scenario).unwrap();
            s.run.duration_s = 400.0;
            s.stack.decider = *decider;
            let r = World::new(&s, 1).unwrap().run(&mut ()).unwrap();
            write!(
                text,
                "\n{scenario:12} | {name:9} | {:11.0} | {:7} | {:10} | {:14.1} | {:11}",
                r.distance_m,
                r.lane_changes,
                r.collisions,
                100.0 * r.delta_speed_frac,
                r.guard_activations
            )
            .unwrap();
        }
    }
    text.push('\n');
    compare("density_decider.txt", &text);
}

/// What the predictive planner saves against the ghost on the main job's road without traffic.
#[test]
fn truck_and_mass_over_what_is_saved_against_the_ghost() {
    let mut text = String::from(
        "truck     | payload, t | fuel, g | time, s | ghost: fuel, g | time, s | a second, g | saved, %",
    );
    for truck in ["longhaul", "sinotruk"] {
        for payload_kg in [36_000.0, 21_000.0] {
            let mut s = Scenario::builtin("highway-empty").unwrap();
            s.truck.file = truck.into();
            s.truck.payload_kg = payload_kg;
            let mut world = World::new(&s, 1).unwrap();
            world.attach_ghost().unwrap();
            world.run(&mut ()).unwrap();
            let ghost = world.ghost().unwrap();
            write!(
                text,
                "\n{truck:9} | {:10.0} | {:7.0} | {:7.1} | {:14.0} | {:7.1} | {:11.1} | {:8.1}",
                1e-3 * payload_kg,
                ghost.ego_fuel_g,
                ghost.ego_time_s,
                ghost.fuel_g,
                ghost.time_s,
                ghost.price_of_time_g_s.unwrap(),
                100.0 * ghost.saving_frac.unwrap()
            )
            .unwrap();
        }
    }
    text.push('\n');
    compare("against_the_ghost.txt", &text);
}
