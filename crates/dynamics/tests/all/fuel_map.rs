//! Fuel maps in truck files: what they burn, what is refused, and that everybody reads the same.
//!
//! The story: `sinotruk` and `reference` charge a motored friction of 190 Nm at the slope of a
//! Willans line whose own intercept is 70 Nm, so they need 219 g/kWh at 80 km/h where a present
//! engine needs 189, and no truck file could say what its engine had been measured to burn.

use dynamics::effects::engine::Engine;
use dynamics::{TruckModel, TruckParameters};
use tractrix_core::{FuelModel, RPM_PER_RAD_S};

const LONGHAUL: &str = include_str!("../../trucks/longhaul.toml");
const REFERENCE: &str = include_str!("../../trucks/reference.toml");
const ADVISOR: &str = include_str!("../../data/advisor_fc_ci330/bsfc_map.csv");

fn engine(name: &str) -> Engine {
    Engine::new(TruckParameters::load(name).unwrap().engine).unwrap()
}

/// g/kWh at a speed and a brake torque.
fn bsfc_g_kwh(engine: &Engine, rpm: f64, brake_nm: f64) -> f64 {
    let p = &engine.parameters;
    let friction_nm = p.friction_constant_nm + p.friction_per_rpm_nm * rpm;
    let rad_s = rpm / RPM_PER_RAD_S;
    engine.fuel_rate_g_s(rad_s, brake_nm + friction_nm) / (brake_nm * rad_s) * 3.6e6
}

#[test]
fn the_present_truck_burns_189_g_kwh_at_cruise_where_the_older_files_burn_219() {
    let cruise_nm = 129e3 * RPM_PER_RAD_S / 1141.0;
    for (name, want) in [("longhaul", 189.0), ("sinotruk", 219.5), ("reference", 219.5)] {
        let got = bsfc_g_kwh(&engine(name), 1141.0, cruise_nm);
        assert!((got - want).abs() < 0.5, "{name}: {got}");
    }
}

#[test]
fn its_best_point_lies_where_and_about_as_high_as_those_of_published_engines() {
    let e = engine("longhaul");
    let mut best = (f64::MAX, 0.0, 0.0);
    for rpm in (600..=2100).step_by(10).map(f64::from) {
        let full_nm = e.full_load_nm.at(rpm / RPM_PER_RAD_S);
        for nm in (50..=2600).step_by(10).map(f64::from).filter(|nm| *nm <= full_nm) {
            best = (bsfc_g_kwh(&e, rpm, nm), rpm, nm).min_by_first(best);
        }
    }
    let (g_kwh, rpm, nm) = best;
    // 182.5 (VECTO's generic engine), 183.4 (Wang et al.), 189.5 (ADVISOR, an engine of 1994)
    assert!((182.5..189.5).contains(&g_kwh), "{best:?}");
    assert!((1000.0..1300.0).contains(&rpm) && (1600.0..2000.0).contains(&nm), "{best:?}");
}

trait MinByFirst {
    fn min_by_first(self, other: Self) -> Self;
}
impl MinByFirst for (f64, f64, f64) {
    fn min_by_first(self, other: Self) -> Self {
        if self.0 < other.0 { self } else { other }
    }
}

/// The measured map at its own speeds, 250 rpm above, at the level of the present engine: the form
/// of the consumption over speed and torque is the measured one.
#[test]
fn the_form_of_the_map_is_that_of_a_measured_engine() {
    let e = engine("longhaul");
    let mut ratios = Vec::new();
    for line in ADVISOR.lines().skip(1) {
        let v: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        if v[1] >= 400.0 && v[0] <= 2000.0 {
            ratios.push(bsfc_g_kwh(&e, v[0] - 250.0, v[1]) / v[2]);
        }
    }
    assert_eq!(ratios.len(), 40);
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!((0.96..1.0).contains(&mean), "level {mean}");
    for r in &ratios {
        assert!((r / mean - 1.0).abs() < 0.03, "{r} against {mean}");
    }
}

#[test]
fn flow_rises_ever_faster_with_torque_from_cut_off_to_full_load() {
    let e = engine("longhaul");
    // below 700 rpm no gear pulls; there what idling takes is dearer than the first torque
    for rpm in (700..2150).step_by(50).map(f64::from) {
        let flow = |nm: f64| e.fuel_rate_g_s(rpm / RPM_PER_RAD_S, nm);
        assert_eq!(flow(0.0), 0.0);
        let steps: Vec<f64> =
            (0..280).map(|i| flow(10.0 * f64::from(i + 1)) - flow(10.0 * f64::from(i))).collect();
        assert!(steps.windows(2).all(|w| w[1] > w[0] - 1e-9), "not convex at {rpm} rpm");
        assert!(steps[0] > 0.0);
    }
}

#[test]
fn planner_and_plant_read_the_same_map() {
    let truck = TruckModel::new(TruckParameters::load("longhaul").unwrap(), 36_000.0).unwrap();
    let limits = truck.vehicle_limits().unwrap().powertrain;
    let e = engine("longhaul");
    assert!(matches!(limits.fuel, FuelModel::Map { .. }));
    for (rad_s, nm) in [(63.0, 130.0), (119.5, 1250.0), (150.0, 90.0), (200.0, 2400.0)] {
        assert_eq!(limits.fuel.rate_g_s(rad_s, nm), e.fuel_rate_g_s(rad_s, nm));
    }
    let idle = 600.0 / RPM_PER_RAD_S;
    let holding = e.friction_nm(idle) + e.auxiliary_nm(idle, 0.0);
    assert_eq!(limits.idle_fuel_g_s, e.fuel_rate_g_s(idle, holding));
    assert!((2.0..3.0).contains(&(limits.idle_fuel_g_s * 3.6 / 0.835)), "l/h at idle");
}

/// A stiffer engine needs more gas torque for the same brake torque, so it burns more; the map is
/// that of the engine as it was measured.
#[test]
fn friction_beyond_the_files_costs_fuel() {
    let truck = TruckParameters::load("longhaul").unwrap();
    let stiff = truck.with_parameter("engine.friction_scale_coeff", 1.5).unwrap();
    let (a, b) = (engine("longhaul"), Engine::new(stiff.engine).unwrap());
    let at_brake = |e: &Engine| e.fuel_rate_g_s(120.0, 1000.0 + e.friction_nm(120.0));
    assert!((at_brake(&b) / at_brake(&a) - 1.0) > 0.05);
    assert_eq!(a.fuel_rate_g_s(120.0, 900.0), b.fuel_rate_g_s(120.0, 900.0));
}

#[test]
fn the_low_load_cause_acts_on_a_map() {
    let truck = TruckParameters::load("longhaul").unwrap();
    let low = truck.with_parameter("engine.fuel.low_load_extra_frac", 0.2).unwrap();
    let (a, b) = (engine("longhaul"), Engine::new(low.engine).unwrap());
    let ratio = |nm: f64| b.fuel_rate_g_s(100.0, nm) / a.fuel_rate_g_s(100.0, nm);
    assert!((ratio(400.0) - 1.1).abs() < 1e-12, "40 of 80 kW is half of it");
    assert_eq!(ratio(900.0), 1.0);
}

/// Consumption per work and flow without load say the same as the flow itself.
#[test]
fn a_map_may_be_given_as_consumption_per_work() {
    let e = engine("longhaul");
    let map = e.parameters.fuel_map.clone().unwrap();
    let flow = map.fuel_g_s.clone().unwrap();
    let per_work = flow.iter().zip(&map.speed_rpm).map(|(row, rpm)| {
        let kwh_s = |nm: &f64| nm * rpm / RPM_PER_RAD_S / 3.6e6;
        row.iter().zip(&map.torque_nm).skip(1).map(|(g_s, nm)| g_s / kwh_s(nm)).collect()
    });
    let mut p = e.parameters.clone();
    p.fuel_map = Some(dynamics::effects::fuel::FuelMap {
        bsfc_g_kwh: Some(per_work.collect()),
        zero_torque_g_s: Some(flow.iter().map(|row| row[0]).collect()),
        fuel_g_s: None,
        torque_nm: map.torque_nm[1..].to_vec(),
        ..map
    });
    let same = Engine::new(p).unwrap();
    for (rad_s, nm) in [(63.0, 30.0), (63.0, 130.0), (119.5, 1250.0), (190.0, 2400.0)] {
        let (a, b) = (e.fuel_rate_g_s(rad_s, nm), same.fuel_rate_g_s(rad_s, nm));
        assert!((a - b).abs() < 1e-12 * a, "{a} {b}");
    }
}

fn refusal(text: &str, from: &str, to: &str) -> String {
    let changed = text.replacen(from, to, 1);
    assert_ne!(changed, text, "no {from:?} in the truck file");
    TruckParameters::from_toml_str("bad.toml", &changed).unwrap_err().to_string()
}

#[test]
fn a_map_that_cannot_be_used_is_refused_by_name() {
    let speeds = "speed_rpm = [600.0, 750.0";
    for (from, to, says) in [
        (speeds, "speed_rpm = [600.0, 550.0", "increasing"),
        (speeds, "speed_rpm = [700.0, 750.0", "extrapolate"),
        ("torque_nm = [0.0, 200.0", "torque_nm = [50.0, 200.0", "begin at 0"),
        ("2600.0]\nfuel_g_s", "2500.0]\nfuel_g_s", "2600 Nm"),
        ("[0.3692, 0.9597", "[-0.3692, 0.9597", "600 rpm"),
        ("[0.3692, 0.9597", "[0.3692, 0.1", "rise with torque"),
        ("[0.3692, 0.9597, ", "[0.3692, ", "13 values for 14"),
        ("fuel_g_s = [", "bsfc_g_kwh = [", "zero_torque_g_s"),
        ("density_kg_m3 = 835.0", "density_kg_m3 = 835.0\nconstant_g_s = 0.05", "contradict"),
    ] {
        let e = refusal(LONGHAUL, from, to);
        assert!(e.contains("fuel") && e.contains(says), "{to}: {e}");
    }
    let e = refusal(REFERENCE, "per_kw_g_s = 0.0505", "");
    assert!(e.contains("engine.fuel needs"), "{e}");
}

/// A bench rarely measures at idle: a file may say that its map is to be continued.
#[test]
fn a_map_that_is_too_small_is_continued_where_the_file_says_so() {
    let text = LONGHAUL.replacen(
        "speed_rpm = [600.0, 750.0",
        "extrapolate = true\nspeed_rpm = [700.0, 750.0",
        1,
    );
    let truck = TruckParameters::from_toml_str("small.toml", &text).unwrap();
    let e = Engine::new(truck.engine).unwrap();
    let friction = |rad_s: f64| 60.0 + 0.105 * rad_s * RPM_PER_RAD_S;
    let at = |rpm: f64| e.fuel_rate_g_s(rpm / RPM_PER_RAD_S, 100.0 + friction(rpm / RPM_PER_RAD_S));
    assert!((at(560.0) / at(700.0) - 0.8).abs() < 1e-9, "flow per revolution is held");
}
