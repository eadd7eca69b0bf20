//! The catalogue of causes: complete, within the truck files' bounds, and no figure of it is dead.

use dynamics::catalogue::{CATALOGUE, Cause, Estimate, cause};
use dynamics::{Overlay, RoadPatch, TruckModel, TruckParameters};
use tractrix_core::{BrakeMode, Command, EgoState};

/// The words that the format of a diagnosis fixes.
const IDS: &str = "rolling_resistance air_drag headwind wind mass grade_bias map_shift tyre_warmup \
    driveline_loss fan_load dragging_brake engine_friction altitude_derate heat_derate turbo_lag \
    pedal_delay shift_duration fuel_map_low_load brake_gain brake_fade brake_delay hidden_retarder \
    speed_scale yaw_rate_bias steering_ratio steering_offset steering_free_play steering_lag \
    cornering_stiffness_front cornering_stiffness_drive cornering_stiffness_trailer \
    payload_position road_bank crosswind engine_brake_torque fuel_flow_scale co2_scale";

const PAYLOAD_KG: f64 = 20_000.0;

fn extended(cause: &Cause, sizes: &[f64]) -> TruckParameters {
    let base = TruckParameters::load("reference").unwrap();
    let estimates: Vec<Estimate> =
        sizes.iter().map(|&size| Estimate { size, sigma: 0.0 }).collect();
    let overlay = cause.overlay(&base, "extended", &estimates, "test").unwrap();
    base.with_overlay(&overlay).unwrap()
}

/// A drive over a road whose map is known: a climb at full load high up in the heat, coasting until
/// it is slow and down a gentle slope, braking down the other side until the brakes are hot, then slalom; what the
/// instruments report every 0.5 s, and the CO2 in the exhaust, g/s. It is driven as far as it is asked.
fn drive(truck: TruckParameters) -> impl Iterator<Item = (EgoState, f64)> {
    let model = TruckModel::new(truck, PAYLOAD_KG).unwrap();
    let instruments = model.parameters().instruments;
    let mut s = model.initial_state(0.0, 0.0, 0.0, 18.0);
    (0..2_000).map(move |k| {
        let t = 0.5 * f64::from(k);
        let at_m = instruments.map_position_m(s.distance_m);
        let grade_frac = match t {
            168.0..180.0 => -0.008,
            0.0..200.0 => 0.025,
            _ => -0.07,
        };
        let patch = RoadPatch {
            grade_rad: 0.002 * (at_m / 90.0).sin() + grade_frac,
            altitude_m: 2_800.0,
            air_temperature_k: 318.0,
            ..RoadPatch::default()
        };
        let command = if t < 200.0 {
            let accelerator_pedal_frac = if t % 60.0 < 36.0 { 1.0 } else { 0.0 };
            Command { accelerator_pedal_frac, ..Command::default() }
        } else {
            let xbr_decel_m_s2 = if s.speed_m_s > 15.0 { 0.9 } else { 0.0 };
            let (brake_mode, retarder_frac) = (BrakeMode::Maximum, 0.5);
            Command { xbr_decel_m_s2, brake_mode, retarder_frac, ..Command::default() }
        };
        let steering_wheel_rad = 0.3 * (0.4 * t).sin();
        s = model.step(&s, &Command { steering_wheel_rad, ..command }, &patch, 0.5).unwrap();
        let truth = model.ego_state(&s, &patch);
        (model.measured(&truth), model.measured_co2_g_s(&truth))
    })
}

/// Largest difference of two drives until an instrument tells them apart, each signal in units of
/// what it can tell.
fn difference(a: &[(EgoState, f64)], b: impl Iterator<Item = (EgoState, f64)>) -> f64 {
    let one = |(a, a_co2_g_s): &(EgoState, f64), (b, b_co2_g_s): (EgoState, f64)| {
        [
            (a.speed_m_s - b.speed_m_s) / 0.01,
            (a.yaw_rate_rad_s - b.yaw_rate_rad_s) / 1e-4,
            (a.trailer.yaw_rate_rad_s - b.trailer.yaw_rate_rad_s) / 1e-4,
            (a.powertrain.fuel_rate_g_s - b.powertrain.fuel_rate_g_s) / 0.02,
            (a_co2_g_s - b_co2_g_s) / 0.1,
        ]
        .into_iter()
        .map(f64::abs)
        .fold(0.0, f64::max)
    };
    let mut largest: f64 = 0.0;
    for (a, b) in a.iter().zip(b) {
        largest = largest.max(one(a, b));
        if largest > 1.0 {
            break;
        }
    }
    largest
}

#[test]
fn every_word_of_the_format_is_in_the_catalogue_once() {
    for id in IDS.split_whitespace() {
        assert_eq!(CATALOGUE.iter().filter(|c| c.id == id).count(), 1, "{id}");
        assert_eq!(cause(id).unwrap().id, id);
    }
    assert_eq!(CATALOGUE.len(), IDS.split_whitespace().count());
    assert!(cause("gremlins").is_none());
}

#[test]
fn every_parameter_is_a_number_of_every_built_in_truck() {
    for name in TruckParameters::names() {
        let truck = TruckParameters::load(name).unwrap();
        for p in CATALOGUE.iter().flat_map(Cause::parameters) {
            assert!(truck.parameter(p.path).is_some(), "{name}: {}", p.path);
        }
    }
}

#[test]
fn sizes_carry_the_unit_that_the_key_ends_in() {
    let units = [
        ("_rad_s", "rad/s"),
        ("_m_s", "m/s"),
        ("_1_m", "1/m"),
        ("_1_k", "1/K"),
        ("_1_s", "1/s"),
        ("_frac", "1"),
        ("_coeff", "1"),
        ("_rad", "rad"),
        ("_nm", "Nm"),
        ("_n", "N"),
        ("_w", "W"),
        ("_k", "K"),
        ("_m", "m"),
        ("_s", "s"),
    ];
    use dynamics::catalogue::Acts;
    for p in CATALOGUE.iter().flat_map(Cause::parameters) {
        let expected = match p.acts {
            Acts::Scale => "1",
            Acts::Add => units.iter().find(|(end, _)| p.path.ends_with(end)).unwrap().1,
        };
        assert_eq!(p.unit, expected, "{}", p.path);
    }
}

#[test]
fn both_ends_of_every_parameter_make_a_truck_that_is_accepted() {
    for c in &CATALOGUE {
        for (i, p) in c.parameters().enumerate() {
            assert!(p.bounds[0] <= 0.0 && p.bounds[1] > 0.0 && p.prior_sigma > 0.0, "{}", p.path);
            assert!(p.prior_sigma < p.bounds[1], "{}", p.path);
            for end in p.bounds {
                let mut sizes = vec![0.0; i + 1];
                sizes[i] = end;
                let truck = extended(c, &sizes);
                TruckModel::new(truck, PAYLOAD_KG).unwrap();
            }
        }
    }
}

/// The instrument faults stood in the truck file, were checked against their bounds and did
/// nothing: an overlay that named one made the same truck.
#[test]
fn no_parameter_is_dead() {
    let base: Vec<_> = drive(TruckParameters::load("reference").unwrap()).collect();
    for c in &CATALOGUE {
        let sizes: Vec<f64> = c.sizes.iter().map(|p| p.prior_sigma).collect();
        for i in 0..sizes.len() {
            let mut alone = vec![0.0; sizes.len()];
            alone[i] = sizes[i];
            let d = difference(&base, drive(extended(c, &alone)));
            assert!(d > 1.0, "{} {}: {d}", c.id, c.sizes[i].path);
        }
        if c.shapes.is_empty() {
            continue;
        }
        let with: Vec<_> = drive(extended(c, &sizes)).collect();
        for (i, p) in c.shapes.iter().enumerate() {
            let mut shaped = sizes.clone();
            shaped.resize(sizes.len() + i, 0.0);
            let down = -p.prior_sigma;
            shaped.push(if down >= p.bounds[0] { down } else { p.prior_sigma });
            let d = difference(&with, drive(extended(c, &shaped)));
            assert!(d > 1.0, "{} {}: {d}", c.id, p.path);
        }
    }
}

#[test]
fn a_heavier_truck_than_its_load_sheet_weighs_what_the_scale_says() {
    let truck = extended(cause("mass").unwrap(), &[0.1]);
    let mass = TruckModel::new(truck, 36_000.0).unwrap().mass_kg();
    assert!((mass - 1.1 * 55_000.0).abs() < 1e-6, "{mass}");
    let light = extended(cause("mass").unwrap(), &[-0.1]);
    let e = TruckModel::new(light, 0.0).unwrap_err().to_string();
    assert!(e.contains("payload.mass_kg"), "{e}");
}

#[test]
fn a_road_steeper_than_its_map_is_driven_as_the_steeper_road() {
    let biased = extended(cause("grade_bias").unwrap(), &[0.01]);
    let biased = TruckModel::new(biased, PAYLOAD_KG).unwrap();
    let plain = TruckParameters::load("reference").unwrap();
    let plain = TruckModel::new(plain, PAYLOAD_KG).unwrap();
    let on = |grade_frac: f64| RoadPatch { grade_rad: grade_frac.atan(), ..RoadPatch::default() };
    let s = plain.initial_state(0.0, 0.0, 0.0, 20.0);
    let command = Command { accelerator_pedal_frac: 0.5, ..Command::default() };
    let a = biased.step(&s, &command, &on(0.01), 20.0).unwrap();
    let b = plain.step(&s, &command, &on(0.02), 20.0).unwrap();
    assert!((a.speed_m_s - b.speed_m_s).abs() < 1e-9, "{} {}", a.speed_m_s, b.speed_m_s);
}

#[test]
fn an_overlay_of_a_cause_survives_being_written_and_read() {
    let base = TruckParameters::load("reference").unwrap();
    let estimates = [Estimate { size: 0.17, sigma: 0.02 }];
    let c = cause("rolling_resistance").unwrap();
    let overlay = c.overlay(&base, "reference.extended", &estimates, "6 drives").unwrap();
    let text = toml::to_string(&overlay).unwrap();
    let read: Overlay = toml::from_str(&text).unwrap();
    assert_eq!(read, overlay);
    let new = &read.set["resistance.rolling_coeff"];
    assert!((new.value - 1.17 * 0.0062).abs() < 1e-15);
    assert!((new.sigma.unwrap() - 0.02 * 0.0062).abs() < 1e-15);
    assert_eq!(base.with_overlay(&read).unwrap().name, "reference.extended");
}
