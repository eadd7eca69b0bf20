//! Truck files and overlays: what is read, what is refused and how.

use dynamics::{DynamicsError, Overlay, TruckParameters};

const REFERENCE: &str = include_str!("../../trucks/reference.toml");

fn refusal(from: &str, to: &str) -> String {
    let text = REFERENCE.replacen(from, to, 1);
    assert_ne!(text, REFERENCE, "no {from:?} in the truck file");
    TruckParameters::from_toml_str("bad.toml", &text).unwrap_err().to_string()
}

#[test]
fn every_built_in_truck_reads() {
    for name in TruckParameters::names() {
        let truck = TruckParameters::load(name).unwrap();
        assert_eq!(truck.name, name);
        dynamics::TruckModel::new(truck, 36_000.0).unwrap().vehicle_limits().unwrap();
    }
}

#[test]
fn the_reference_truck_weighs_19_and_55_tonnes() {
    let truck = TruckParameters::load("reference").unwrap();
    let mass = |payload| dynamics::TruckModel::new(truck.clone(), payload).unwrap().mass_kg();
    assert_eq!(mass(0.0), 19_000.0);
    assert_eq!(mass(36_000.0), 55_000.0);
}

#[test]
fn a_wrong_key_is_named_with_its_line() {
    let e = refusal("wheel_radius_m", "wheel_radius_mm");
    assert!(e.contains("wheel_radius_mm") && e.contains("line"), "{e}");
}

#[test]
fn all_values_out_of_bounds_are_named_at_once() {
    let text = REFERENCE
        .replace("rolling_coeff = 0.0062", "rolling_coeff = -1.0")
        .replace("final_drive_ratio = 2.85", "final_drive_ratio = nan")
        .replace("mass_kg = 9200.0", "mass_kg = -9200.0");
    let e = TruckParameters::from_toml_str("bad.toml", &text).unwrap_err().to_string();
    for key in ["resistance.rolling_coeff", "driveline.final_drive_ratio", "mass_kg"] {
        assert!(e.contains(key), "{key} is missing in: {e}");
    }
}

#[test]
fn a_table_that_goes_back_is_refused() {
    let e = refusal("600.0, 700.0, 800.0", "600.0, 500.0, 800.0");
    assert!(e.contains("full_load_torque_nm"), "{e}");
}

#[test]
fn an_overlay_changes_what_it_names_and_nothing_else() {
    let base = TruckParameters::load("reference").unwrap();
    let overlay: Overlay = toml::from_str(
        "schema = 1\nbase = \"reference\"\nname = \"reference.extended\"\n\
         [set.\"resistance.rolling_coeff\"]\nvalue = 0.0072\nsigma = 0.0001\nbounds = [0.003, 0.02]\n\
         source = \"fitted to 6 drives\"\n",
    )
    .unwrap();
    let truck = base.with_overlay(&overlay).unwrap();
    assert_eq!(truck.parameter("resistance.rolling_coeff"), Some(0.0072));
    assert_eq!(truck.name, "reference.extended");
    assert_eq!(truck.engine, base.engine);
}

#[test]
fn a_replaced_parameter_leaves_all_others_as_they_are_to_the_last_bit() {
    for name in TruckParameters::names() {
        let truck = TruckParameters::load(name).unwrap();
        let path = "resistance.rolling_coeff";
        let awkward = truck.with_parameter(path, 0.1 + 0.2).unwrap();
        assert_eq!(awkward.parameter(path), Some(0.1 + 0.2));
        let back = awkward.with_parameter(path, truck.resistance.rolling_coeff).unwrap();
        assert_eq!(back, truck);
    }
}

#[test]
fn an_overlay_that_names_nothing_is_refused() {
    let base = TruckParameters::load("reference").unwrap();
    let e = base.with_parameter("resistance.rolling_coef", 1.0).unwrap_err();
    assert!(matches!(e, DynamicsError::UnknownParameter { .. }), "{e}");
    assert!(e.to_string().contains("rolling_coef"));
    assert!(base.with_parameter("lateral.tyres.stiffness_scale[1]", 0.9).is_ok());
}

#[test]
fn an_unknown_truck_is_answered_with_the_known_ones() {
    let e = TruckParameters::load("scania").unwrap_err().to_string();
    assert!(e.contains("scania") && e.contains("reference") && e.contains("sinotruk"), "{e}");
    let e = TruckParameters::load("nowhere/truck.toml").unwrap_err().to_string();
    assert!(e.contains("nowhere/truck.toml"), "{e}");
}
