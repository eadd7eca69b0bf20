//! The sheet of a truck: what an on-truck program reads instead of a truck file.

use dynamics::{TruckModel, TruckParameters};
use tractrix_core::VehicleLimits;

fn limits(truck: &str) -> VehicleLimits {
    let truck = TruckParameters::load(truck).unwrap();
    TruckModel::new(truck, 20_000.0).unwrap().vehicle_limits().unwrap()
}

fn refusal(change: &[(&str, &str)]) -> String {
    let mut text = limits("reference").to_sheet().unwrap();
    for (from, to) in change {
        assert!(text.contains(from), "no {from:?} in\n{text}");
        text = text.replacen(from, to, 1);
    }
    VehicleLimits::from_sheet("s.toml", &text).unwrap_err().to_string()
}

#[test]
fn the_sheet_of_every_built_in_truck_reads_as_it_was_written() {
    for name in TruckParameters::names() {
        let limits = limits(name);
        let sheet = limits.to_sheet().unwrap();
        assert_eq!(VehicleLimits::from_sheet(name, &sheet).unwrap(), limits, "{name}");
    }
}

#[test]
fn everything_that_is_wrong_with_the_keys_is_said_at_once() {
    let said = refusal(&[
        ("front_m = ", "frontal_m = "),
        ("wheel_radius_m = ", "wheel_radius_m = true # "),
        ("[brakes]", "[breaks]"),
        ("gear_ratios = [", "gear_ratios = [\"first\", "),
        ("[road_load]\n", "[road_load]\nmass_t = 40.0\n"),
    ]);
    for named in [
        "s.toml: ",
        "unknown key \"geometry.frontal_m\"; the nearest are front_m",
        "geometry.front_m is missing",
        "powertrain.wheel_radius_m is of kind boolean",
        "unknown key \"breaks\"; the nearest are brakes",
        "brakes is missing",
        "powertrain.gear_ratios holds a string",
        "unknown key \"road_load.mass_t\"; the nearest are mass_kg",
    ] {
        assert!(said.contains(named), "{named} is not in: {said}");
    }
    assert_eq!(said.lines().count(), 1, "{said}");
}

#[test]
fn maps_that_are_none_are_named_with_their_place() {
    let curve = "full_load_nm]\nx = [";
    let said = refusal(&[
        (curve, "full_load_nm]\nx = [900.0, "),
        ("friction_nm]\nx = [", "friction_nm]\nx = []\ny = []\n[powertrain.other]\nx = ["),
    ]);
    assert!(said.contains("table powertrain.full_load_nm: "), "{said}");
    assert!(said.contains("table powertrain.friction_nm: "), "{said}");
    assert!(said.contains("unknown key \"powertrain.other\""), "{said}");
}

#[test]
fn all_values_out_of_range_are_said_at_once() {
    let said = refusal(&[
        ("steering_ratio = ", "steering_ratio = nan # "),
        ("[road_load]\nmass_kg = ", "[road_load]\nmass_kg = 40.0 # "),
        ("dead_time_s = ", "dead_time_s = -1 # "),
    ]);
    for named in ["lateral.steering_ratio = NaN", "mass_kg = 40", "brakes.dead_time_s = -1"] {
        assert!(said.contains(named), "{named} is not in: {said}");
    }
}

#[test]
fn a_truck_file_is_refused_with_the_command_that_makes_a_sheet_of_it() {
    let text = include_str!("../../trucks/reference.toml");
    let said = VehicleLimits::from_sheet("t.toml", text).unwrap_err().to_string();
    assert!(said.contains("sim-server truck sheet"), "{said}");
}

#[test]
fn what_is_no_toml_is_said_on_one_line() {
    for text in ["[geometry", "x = 1 2", "", "\u{0}"] {
        let said = VehicleLimits::from_sheet("s.toml", text).unwrap_err().to_string();
        assert!(said.starts_with("s.toml: ") && said.lines().count() == 1, "{said}");
    }
}

#[test]
fn limits_that_cannot_be_planned_with_make_no_sheet() {
    let mut odd = limits("reference");
    odd.road_load.mass_kg = 0.0;
    assert!(odd.to_sheet().unwrap_err().to_string().contains("mass_kg"));
}
