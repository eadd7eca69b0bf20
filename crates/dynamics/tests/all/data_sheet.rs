//! A truck from its data sheet.

use dynamics::data_sheet::{DataSheet, TEMPLATE};
use dynamics::effects::engine::Engine;
use dynamics::{KnownBy, RoadPatch, TruckModel, TruckParameters};
use tractrix_core::Command;

fn whole_template() -> String {
    let uncommented = |line: &str| match line.strip_prefix("# ") {
        Some(rest) if rest.contains(" = ") => rest.to_owned(),
        _ => line.to_owned(),
    };
    TEMPLATE.lines().map(uncommented).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_template_makes_a_truck_that_drives_and_says_what_is_estimated() {
    let sheet = DataSheet::from_toml_str("template", TEMPLATE).unwrap();
    let text = sheet.truck_file().unwrap();
    let truck = TruckParameters::from_toml_str("my-truck", &text).unwrap();
    assert_eq!(truck.provenance["driveline.gear_ratios"].known_by, KnownBy::Sheet);
    let rolling = &truck.provenance["resistance.rolling_coeff"];
    assert_eq!(rolling.known_by, KnownBy::Estimate);
    assert!(rolling.sigma.unwrap() > 0.1 * truck.resistance.rolling_coeff);
    assert!(text.contains("rolling_coeff = 0.0053 # estimate"), "{text}");
    let model = TruckModel::new(truck, 20_000.0).unwrap();
    let pedal = Command { accelerator_pedal_frac: 1.0, ..Default::default() };
    let mut state = model.initial_state(0.0, 0.0, 0.0, 20.0);
    for _ in 0..1000 {
        state = model.step(&state, &pedal, &RoadPatch::default(), 0.01).unwrap();
    }
    assert!(state.speed_m_s > 21.0 && state.speed_m_s < 26.0, "{}", state.speed_m_s);
}

/// VECTO's truck is in the repository with its single figures: its sheet must lead back to it.
#[test]
fn the_sheet_of_a_built_in_truck_leads_to_that_truck() {
    let text = whole_template();
    let sheet = DataSheet::from_toml_str("whole", &text).unwrap();
    let made = TruckParameters::from_toml_str("made", &sheet.truck_file().unwrap()).unwrap();
    let known = TruckParameters::load("vecto-40t").unwrap();
    for (path, tolerance) in [
        ("driveline.wheel_radius_m", 0.002),
        ("engine.friction_constant_nm", 0.6),
        ("engine.friction_per_rpm_nm", 0.2),
        ("lateral.tractor.drive_group_behind_cg_m", 0.05),
        ("lateral.trailer.axle_half_spread_m", 0.001),
        ("resistance.rolling_coeff", 0.12),
    ] {
        let (a, b) = (made.parameter(path).unwrap(), known.parameter(path).unwrap());
        assert!((a / b - 1.0).abs() < tolerance, "{path}: {a} and {b}");
    }
    let flow = |t: &TruckParameters| {
        let engine = Engine::new(t.engine.clone()).unwrap();
        engine.fuel_rate_g_s(125.0, 1400.0)
    };
    assert!((flow(&made) / flow(&known) - 1.0).abs() < 0.05, "{} {}", flow(&made), flow(&known));
}

#[test]
fn all_that_is_missing_or_wrong_is_said_at_once() {
    let text = TEMPLATE
        .replace("tractor_kg = 7900.0", "tractor_kg = 7.9")
        .replace("drive_size = \"315/70 R22.5\"", "drive_size = \"big\"")
        .replace("max_torque_nm = 2300.0", "")
        .replace("wheelbase_m = 3.7", "wheelbase_m = 3700.0");
    let said = DataSheet::from_toml_str("a.toml", &text).unwrap_err().to_string();
    for word in ["masses.tractor_kg = 7.9", "big", "max_torque_nm", "wheelbase_m = 3700"] {
        assert!(said.contains(word), "{word} in {said}");
    }
    let unknown = TEMPLATE.replace("wheelbase_m", "wheel_base_m");
    let said = DataSheet::from_toml_str("a.toml", &unknown).unwrap_err().to_string();
    assert!(said.contains("wheel_base_m") && said.contains("wheelbase_m"), "{said}");
}
