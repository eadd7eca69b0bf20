//! On a long descent the coolant derates the retarder, and the planner knows.

use std::convert::Infallible;
use std::sync::Arc;

use crate::support::slope;
use dynamics::{DynamicsError, TruckModel, TruckParameters};
use planner::{RatesConfig, Stack, StackConfig, drive_tick};
use sim::{EgoStart, SimTruck, Weather};
use tractrix_core::{
    Command, EgoState, Scene, Stamped, Time, TrafficSource, Vehicle, VehicleLimits,
};

const TICK_S: f64 = 0.01;
const SET_M_S: f64 = 20.0;

struct Nobody(Scene);

impl TrafficSource for Nobody {
    type Error = Infallible;

    fn advance(&mut self, now: Time, _ego: &EgoState) -> Result<&Scene, Infallible> {
        self.0.time = now;
        Ok(&self.0)
    }
}

/// A truck whose data sheet stays what it was when cold.
struct ByTheSheet(SimTruck, VehicleLimits);

impl Vehicle for ByTheSheet {
    type Error = DynamicsError;

    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, DynamicsError> {
        self.0.ego(now)
    }

    fn command(&mut self, now: Time, command: &Command) -> Result<(), DynamicsError> {
        self.0.command(now, command)
    }

    fn limits(&self) -> &VehicleLimits {
        &self.1
    }
}

/// Rolls 55 t down 9 km of 6.5 % at 35 degC with cruise control. Once the retarder is hot: the
/// highest speed, m/s, and the mean acceleration that the stack asks for to hold it, m/s².
fn descend<V: Vehicle<Error = DynamicsError>>(truck: &mut V) -> (f64, f64) {
    let road = slope(-0.065);
    let config = StackConfig {
        set_speed_m_s: SET_M_S,
        rates: RatesConfig::for_tick(TICK_S),
        ..StackConfig::default()
    };
    let mut stack = Stack::new(config, truck.limits()).unwrap();
    let mut nobody = Nobody(Scene::default());
    let (mut highest_m_s, mut asked_m_s) = (0.0_f64, 0.0);
    let hot = 20_000..45_000;
    for i in 0..hot.end {
        let now = Time::from_seconds(f64::from(i) * TICK_S);
        drive_tick(now, truck, &mut nobody, &mut stack, &road, &mut ()).unwrap();
        if hot.contains(&i) {
            asked_m_s += TICK_S * stack.plan().target_accel_m_s2;
            highest_m_s = highest_m_s.max(truck.ego(now).unwrap().value.speed_m_s);
        }
    }
    (highest_m_s, asked_m_s / (TICK_S * hot.len() as f64))
}

/// The planner divided what it wanted by the cold retarder's force. A hot one gave less: only the
/// integrator's guess made up for it, as if the truck were asked to slow down all the time.
#[test]
fn a_hot_retarder_is_known_to_the_planner() {
    let model = TruckModel::new(TruckParameters::load("longhaul").unwrap(), 36_000.0).unwrap();
    let start = EgoStart { s_m: 100.0, lane: Some(0), speed_m_s: SET_M_S };
    let cold = SimTruck::new(
        Arc::new(model),
        slope(-0.065),
        &start,
        &Weather { air_temperature_k: 308.15, ..Weather::default() },
    )
    .unwrap();
    let sheet = cold.limits().clone();
    let at = |l: &VehicleLimits| l.powertrain.retarder_force_n.as_ref().unwrap().at(SET_M_S);

    let mut truck = cold.clone();
    let (known_m_s, known_m_s2) = descend(&mut truck);
    let left_frac = truck.model().retarder_left_frac(truck.plant());
    assert!(left_frac < 0.9, "{left_frac} of the retarder is left: no test");
    assert!((at(truck.limits()) / at(&sheet) - left_frac).abs() < 0.015);

    let (sheet_m_s, sheet_m_s2) = descend(&mut ByTheSheet(cold, sheet));
    println!("{left_frac:.2}: {known_m_s:.2} {known_m_s2:.3}, {sheet_m_s:.2} {sheet_m_s2:.3}");
    assert!(known_m_s < SET_M_S + 0.1 && sheet_m_s < SET_M_S + 0.1, "{known_m_s} {sheet_m_s}");
    assert!(known_m_s2.abs() < 0.5 * sheet_m_s2.abs(), "{known_m_s2} {sheet_m_s2}");
}
