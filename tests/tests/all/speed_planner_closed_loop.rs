//! The receding-horizon speed planner in the full truck: what the plan promises is what the plant
//! saves; and the gearbox rests while the truck follows a slow car.

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use planner::pcc::model::profile_of;
use planner::pcc::{SpeedBand, TripRequest, Tuning, plan_trip};
use planner::{SpeedPlannerKind, Stack, StackConfig, drive_tick};
use road::{Cubics, Line, Road, builtin};
use sim::{EgoStart, Scenario, SimTruck, Status, Weather, World};
use tractrix_core::{
    EgoState, GearRequest, Maneuver, Neighbour, PlanStatus, Scene, Tick, Time, TrafficSource,
    Vehicle, VehicleClass,
};

const PAYLOAD_KG: f64 = 36_000.0;
const PREDICTIVE: &str = "speed_planner = \"predictive\"";
/// Marginal fuel of a joule at the wheels, g/J: 0.0505 g/s per kW through a 95 % driveline.
const FUEL_G_J: f64 = 5.3e-5;

/// Level, three hills of this slope, level; straight.
fn hills(amplitude: f64) -> Arc<Road> {
    let length = 6_000.0;
    let slopes: Vec<(f64, f64)> = (0..=300)
        .map(|i| f64::from(i) * 20.0)
        .map(|s| {
            let inside = (1_000.0..4_600.0).contains(&s);
            let phase = core::f64::consts::TAU * (s - 1_000.0) / 1_200.0;
            (s, if inside { amplitude * phase.sin() } else { 0.0 })
        })
        .collect();
    let height = Cubics::integral_of_linear(0.0, &slopes);
    let line = Line::from_curvature(0.0, &[(0.0, 0.0), (length, 0.0)], height, Cubics::default());
    let lanes = builtin::flat(length).lanes().to_vec();
    Arc::new(Road::new("three hills", line, lanes, vec![(0.0, 25.0)]).unwrap())
}

/// A run on `road`: fuel in g at equal end speed, time in s, share of ticks with a plan, time with
/// the driveline open in s.
fn drive(road: &Arc<Road>, stack: &str, to_m: f64) -> (f64, f64, f64, f64) {
    let text = format!(
        "schema = 1\nname = \"hills\"\nroad = \"builtin:flat\"\n\
         [truck]\nfile = \"sinotruk\"\npayload_kg = {PAYLOAD_KG}\n\
         [traffic]\nsource = \"none\"\n[stack]\n{stack}\n"
    );
    let scenario = Scenario::from_toml_str("hills", &text).unwrap();
    let model = TruckModel::new(TruckParameters::load("sinotruk").unwrap(), PAYLOAD_KG).unwrap();
    let mut world = World::assemble(&scenario, 1, Arc::clone(road), Arc::new(model)).unwrap();
    let (mut count, mut ticks) = (Count::default(), 0.0);
    while world.status() == Status::Running && world.truck().state().s_m < to_m {
        world.tick(&mut count).unwrap();
        ticks += 1.0;
    }
    let ego = world.truck().state();
    let mass_kg = world.truck().limits().road_load.mass_kg;
    let spare_g = 0.5 * mass_kg * (ego.speed_m_s.powi(2) - 400.0) * FUEL_G_J;
    let fuel_g = ego.powertrain.fuel_used_g - spare_g;
    (fuel_g, world.now().seconds(), count.planned / ticks, 0.01 * count.open)
}

/// Ticks with a plan, and with the driveline open.
#[derive(Default)]
struct Count {
    planned: f64,
    open: f64,
}

impl tractrix_core::Recorder for Count {
    fn record(&mut self, tick: &Tick<'_>) {
        let (plan, signals) = (tick.plan, &tick.ego.powertrain);
        assert!(plan.guard.is_empty(), "{:?}", plan.guard);
        self.planned += f64::from(u8::from(plan.speed_status == PlanStatus::Solved));
        let c = &plan.command;
        if c.gear == GearRequest::Neutral {
            self.open += f64::from(u8::from(signals.gear == 0 && !signals.shift_in_progress));
            let idle = c.accelerator_pedal_frac == 0.0;
            assert!(idle && c.retarder_frac == 0.0 && c.xbr_decel_m_s2 == 0.0, "{c:?}");
        }
    }
}

#[test]
fn what_the_plan_promises_is_saved_in_the_plant_within_one_percentage_point() {
    let (road, to_m) = (hills(0.025), 5_800.0);
    let (cruise_g, cruise_s, ..) = drive(&road, "speed_planner = \"cruise\"", to_m);
    let (fuel_g, time_s, planned, open_s) = drive(&road, PREDICTIVE, to_m);
    assert_eq!(open_s, 0.0);
    assert!(planned > 0.99, "a plan in {planned} of the ticks");

    let model = TruckModel::new(TruckParameters::load("sinotruk").unwrap(), PAYLOAD_KG).unwrap();
    let limits = model.vehicle_limits().unwrap();
    let mut profile = profile_of(&road, 12.5);
    profile.retain(|p| p.s_m >= 30.0 && p.s_m <= to_m);
    let trip = plan_trip(&TripRequest {
        profile: &profile,
        truck: &limits,
        band: SpeedBand { set_m_s: 20.0, min_m_s: 17.2, max_m_s: 22.2 },
        trip_time_s: None,
        eco_roll: false,
        tuning: Tuning::default(),
    })
    .unwrap();
    let promised = trip.saving_vs_set_speed_frac;
    let saved = 1.0 - (fuel_g + trip.beta_g_s * (time_s - cruise_s)) / cruise_g;
    let figures = format!(
        "promised {promised:.4}, saved {saved:.4}: {fuel_g:.0} g in {time_s:.1} s, cruise \
         {cruise_g:.0} g in {cruise_s:.1} s, plan {:.0} g, its cruise {:.0} g in {:.1} s",
        trip.plan.fuel_g, trip.baseline_set_speed.fuel_g, trip.baseline_set_speed.trip_time_s
    );
    println!("{figures}");
    assert!(promised > 0.05, "{figures}");
    assert!((saved - promised).abs() < 0.01, "{figures}");
}

#[test]
fn with_eco_roll_the_truck_rolls_in_neutral_and_never_drives_or_brakes_in_it() {
    let (road, to_m) = (hills(0.012), 5_800.0);
    let (engaged_g, engaged_s, ..) = drive(&road, PREDICTIVE, to_m);
    let stack = format!("{PREDICTIVE}\nspeed_plan = {{ eco_roll = true }}");
    let (rolling_g, rolling_s, planned, open_s) = drive(&road, &stack, to_m);
    let figures = format!(
        "{rolling_g:.1} g in {rolling_s:.1} s, {open_s:.1} s of it open, against {engaged_g:.1} g \
         in {engaged_s:.1} s"
    );
    println!("{figures}");
    assert!(planned > 0.99 && open_s > 20.0, "{figures}");
    assert!(rolling_g + 3.0 * (rolling_s - engaged_s) < engaged_g, "{figures}");
}

/// A car ahead whose speed swings slowly between 17 and 20 m/s.
struct SlowCar {
    rear_s_m: f64,
    last: Time,
    d_m: f64,
    scene: Scene,
}

impl TrafficSource for SlowCar {
    type Error = core::convert::Infallible;
    fn advance(&mut self, now: Time, _: &EgoState) -> Result<&Scene, Self::Error> {
        let t = now.seconds();
        let speed_m_s = 18.5 + 1.5 * (core::f64::consts::TAU * t / 60.0).cos();
        self.rear_s_m += speed_m_s * now.seconds_since(self.last);
        self.last = now;
        self.scene.time = now;
        self.scene.neighbours = vec![Neighbour {
            id: 7,
            class: VehicleClass::Car,
            front_s_m: self.rear_s_m + 4.5,
            rear_s_m: self.rear_s_m,
            d_m: self.d_m,
            width_m: 1.8,
            speed_m_s,
            ..Neighbour::default()
        }];
        Ok(&self.scene)
    }
}

/// In the first kilometres of the main job the gearbox went 12, 10, 12, 10 behind a slow car: the
/// truck did not tell its retarder to the planner, which asked for nearly all of an engine brake
/// five times weaker than what then braked; the gearbox saw a large demand and shifted down for the
/// engine brake, the truck slowed too much, the demand fell, the gearbox shifted up again. Now the
/// planner knows the retarder, and the gearbox does not shift up as long as it works.
#[test]
fn behind_a_slow_car_downhill_the_gearbox_rests() {
    let (length, slope) = (8_000.0, -0.012);
    let height = Cubics::integral_of_linear(0.0, &[(0.0, slope), (length, slope)]);
    let line = Line::from_curvature(0.0, &[(0.0, 0.0), (length, 0.0)], height, Cubics::default());
    let lanes = builtin::flat(length).lanes().to_vec();
    let road = Arc::new(Road::new("descent", line, lanes, vec![(0.0, 25.0)]).unwrap());
    let model = TruckModel::new(TruckParameters::load("sinotruk").unwrap(), PAYLOAD_KG).unwrap();
    let start = EgoStart { s_m: 100.0, lane: Some(0), speed_m_s: 20.0 };
    let weather = Weather::default();
    let mut truck = SimTruck::new(Arc::new(model), Arc::clone(&road), &start, &weather).unwrap();
    let mut car = SlowCar {
        rear_s_m: 180.0,
        last: Time::ZERO,
        d_m: road.lanes()[0].center_d_m(100.0),
        scene: Scene::default(),
    };
    let config = StackConfig { speed_planner: SpeedPlannerKind::Cruise, ..StackConfig::default() };
    let mut stack = Stack::new(config, truck.limits()).unwrap();
    let (mut gear, mut up, mut shifted_s, mut retarder) = (12, false, -60.0, 0.0_f64);
    for i in 0..24_000 {
        let now = Time(i * 10_000_000);
        let out = drive_tick(now, &mut truck, &mut car, &mut stack, &road, &mut ()).unwrap();
        assert!(!out.guarded && out.maneuver == Maneuver::KeepLane);
        let signals = out.ego.value.powertrain;
        retarder = retarder.max(signals.retarder_force_n);
        if !signals.shift_in_progress && signals.gear != gear {
            let (back, since_s) = ((signals.gear > gear) != up, now.seconds() - shifted_s);
            assert!(!back || since_s > 8.0, "{gear} to {} after {since_s} s", signals.gear);
            (up, gear, shifted_s) = (signals.gear > gear, signals.gear, now.seconds());
        }
    }
    assert!(retarder > 1_000.0, "the retarder has worked: {retarder} N");
}
