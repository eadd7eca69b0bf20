//! What a plan of the whole trip promises is what the plant burns when it follows the plan.
//!
//! The story: the planner's truck knew mass, drag area, standard air and one rolling coefficient. A
//! truck file whose tyres roll harder with speed, whose engine burns more at low load, or a road with
//! bends, wind or thin air made the plan promise less than it took; nothing said so.

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use planner::SpeedProfile;
use planner::pcc::model::profile_of;
use planner::pcc::{SpeedBand, TripRequest, Tuning, plan_trip};
use road::{Cubics, Line, Road, builtin};
use sim::{Scenario, Status, World};
use tractrix_core::{PlanStatus, SpeedPoint, Vehicle};

const PAYLOAD_KG: f64 = 21_000.0;
const SET_M_S: f64 = 22.0;
/// Stretch that is compared, m.
const FROM_M: f64 = 1_000.0;
const TO_M: f64 = 9_000.0;
/// Marginal fuel of a joule at the wheels, g/J, for the little kinetic energy that differs.
const FUEL_G_J: f64 = 5.1e-5;

/// Hills of one per cent, 1.6 km long, and bends that sharpen to a radius of 400 m.
fn road() -> Arc<Road> {
    let length = 10_000.0;
    let wave = |s: f64, amplitude: f64, length_m: f64| {
        let inside = (FROM_M..TO_M).contains(&s);
        let phase = core::f64::consts::TAU * (s - FROM_M) / length_m;
        if inside { amplitude * phase.sin() } else { 0.0 }
    };
    let every = |amplitude: f64, length_m: f64| -> Vec<(f64, f64)> {
        (0..=500).map(|i| f64::from(i) * 20.0).map(|s| (s, wave(s, amplitude, length_m))).collect()
    };
    let height = Cubics::integral_of_linear(0.0, &every(0.01, 1_600.0));
    let line = Line::from_curvature(0.5, &every(1.0 / 400.0, 2_000.0), height, Cubics::default());
    let lanes = builtin::flat(length).lanes().to_vec();
    Arc::new(Road::new("hills and bends", line, lanes, vec![(0.0, 30.0)]).unwrap())
}

/// Fuel promised and burnt, g, over the stretch, for a truck file with changes in a weather.
fn promised_and_burnt(changes: &[(&str, f64)], weather: &str) -> (f64, f64) {
    let road = road();
    let text = format!(
        "schema = 1\nname = \"promise\"\nroad = \"builtin:flat\"\n\
         [truck]\nfile = \"longhaul\"\npayload_kg = {PAYLOAD_KG}\n\
         [ego]\ns_m = 40.0\nspeed_m_s = {SET_M_S}\n[traffic]\nsource = \"none\"\n\
         [stack]\nset_speed_m_s = {SET_M_S}\nspeed_planner = \"predictive\"\n[weather]\n{weather}\n"
    );
    let scenario = Scenario::from_toml_str("promise", &text).unwrap();
    let truck = changes.iter().fold(TruckParameters::load("longhaul").unwrap(), |truck, change| {
        truck.with_parameter(change.0, change.1).unwrap()
    });
    let model = Arc::new(TruckModel::new(truck, PAYLOAD_KG).unwrap());
    let mut world = World::assemble(&scenario, 1, Arc::clone(&road), model).unwrap();
    let mut profile = profile_of(&road, 12.5);
    profile.retain(|p| (FROM_M..=TO_M).contains(&p.s_m));
    let trip = plan_trip(&TripRequest {
        profile: &profile,
        truck: world.truck().limits(),
        band: SpeedBand { set_m_s: SET_M_S, min_m_s: 20.0, max_m_s: 23.5 },
        trip_time_s: None,
        eco_roll: false,
        tuning: Tuning::default(),
    })
    .unwrap();
    let points: Vec<SpeedPoint> = trip
        .rows
        .iter()
        .map(|r| SpeedPoint { s_m: r.s_m, speed_m_s: r.v_m_s, accel_m_s2: 0.0 })
        .collect();
    let planned = SpeedProfile::new(points, PlanStatus::Solved).unwrap();
    world.stack_mut().set_speed_profile(Some(planned));
    // What the truck has used, with the fuel that its kinetic energy would have spared.
    let mass_kg = world.truck().limits().road_load.mass_kg;
    let used_g = |world: &World| {
        let ego = world.truck().state();
        ego.powertrain.fuel_used_g - 0.5 * mass_kg * ego.speed_m_s.powi(2) * FUEL_G_J
    };
    let mut began_g = None;
    let mut ticks = 0;
    while world.truck().state().s_m < TO_M {
        assert_eq!(world.status(), Status::Running);
        world.tick(&mut Quiet).unwrap();
        ticks += 1;
        assert!(ticks < 100_000);
        if began_g.is_none() && world.truck().state().s_m >= FROM_M {
            began_g = Some(used_g(&world));
        }
    }
    (trip.plan.fuel_g, used_g(&world) - began_g.unwrap())
}

struct Quiet;
impl tractrix_core::Recorder for Quiet {
    fn record(&mut self, _tick: &tractrix_core::Tick<'_>) {}
}

/// What is set alone: its name, figures of the truck file, and what else the test reads.
type Case = (&'static str, &'static [(&'static str, f64)], &'static str, f64);

#[test]
fn each_effect_of_a_truck_file_costs_what_the_plan_promises_within_half_a_per_cent() {
    // change of the promise against the truck file as it is, at least
    let cases: [Case; 10] = [
        ("as it is", &[], "", 0.0),
        ("no drag in bends", &[("resistance.curve_drag_coeff", 0.0)], "", -0.05),
        ("rolling by speed", &[("resistance.rolling_per_speed_s_m", 6e-5)], "", 0.08),
        // A plan that reads the map keeps out of its way: it cost 8 % of the promise and 3 % more in
        // the plant before plans did.
        (
            "low load",
            &[("engine.fuel.low_load_extra_frac", 0.3), ("engine.fuel.low_load_kw", 200.0)],
            "",
            0.04,
        ),
        ("dragging brake", &[("resistance.parasitic_force_n", 600.0)], "", 0.1),
        ("head wind", &[("resistance.headwind_m_s", 4.0)], "", 0.1),
        ("crosswind", &[("resistance.crosswind_to_left_m_s", 6.0)], "", 0.08),
        ("wind over the ground", &[], "wind_x_m_s = -4.0\nwind_y_m_s = 3.0", 0.02),
        ("thin air", &[], "air_pressure_pa = 80000.0\nair_temperature_k = 305.0", -0.06),
        ("fan", &[("engine.fan_on_k", 340.0)], "", 0.1),
    ];
    let (plain_g, _) = promised_and_burnt(&[], "");
    let mut wrong = Vec::new();
    for (name, changes, weather, matters) in cases {
        let (promised_g, burnt_g) = promised_and_burnt(changes, weather);
        let off = burnt_g / promised_g - 1.0;
        let more = promised_g / plain_g - 1.0;
        let line = format!(
            "{name}: promised {promised_g:.0} g ({more:+.3}), burnt {burnt_g:.0} g, {:+.2} %",
            100.0 * off
        );
        let shows = matters == 0.0 || more / matters > 1.0;
        if off.abs() > 0.005 || !shows {
            wrong.push(line.clone());
        }
        #[allow(clippy::disallowed_macros)]
        {
            println!("{line}");
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
