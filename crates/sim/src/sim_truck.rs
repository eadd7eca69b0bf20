//! The simulated truck as a [`Vehicle`]: the plant read and commanded directly.

use std::sync::Arc;

use dynamics::effects::resistance::air_above;
use dynamics::{DynamicsError, RoadPatch, SUBSTEP_S, TruckModel, TruckState};
use road::{LaneKind, Road};
use tractrix_core::{Command, Curve, EgoState, Stamped, Time, Vehicle, VehicleLimits};

use crate::{EgoStart, SimError, Weather};

/// Change of the retarder's share that is told.
const RETARDER_STEP_FRAC: f64 = 0.01;

/// A truck model on a road. A command given at `k` acts until the next one: reading the truck at a
/// later time first moves the plant there. Its limits are those of now: a hot retarder gives less.
#[derive(Debug, Clone)]
pub struct SimTruck {
    model: Arc<TruckModel>,
    road: Arc<Road>,
    weather: Weather,
    limits: VehicleLimits,
    /// Force of the cold retarder, and the share of it that [`Self::limits`] tell.
    cold_retarder_n: Option<Curve>,
    retarder_left_frac: f64,
    /// Height of the road's start, m.
    start_z_m: f64,
    plant: TruckState,
    ego: EgoState,
    command: Command,
    time: Time,
}

impl Weather {
    /// Temperature, K, and pressure, Pa, of the air so many metres above the start of the road.
    #[must_use]
    pub fn air_at(&self, climbed_m: f64) -> (f64, f64) {
        air_above((self.air_temperature_k, self.air_pressure_pa), climbed_m)
    }
}

impl SimTruck {
    /// A truck at its start: in the middle of a lane, along it, rolling.
    ///
    /// # Errors
    /// [`SimError::Scenario`] if the start is not on a drivable lane.
    pub fn new(
        model: Arc<TruckModel>,
        road: Arc<Road>,
        start: &EgoStart,
        weather: &Weather,
    ) -> Result<Self, SimError> {
        let limits = model.vehicle_limits_in(&RoadPatch {
            wind_m_s: (weather.wind_x_m_s, weather.wind_y_m_s),
            air_temperature_k: weather.air_temperature_k,
            air_pressure_pa: weather.air_pressure_pa,
            ..RoadPatch::default()
        })?;
        Self::with_limits(model, road, start, weather, limits)
    }

    /// As [`Self::new`], with the limits of such a truck in this weather, which take longer to work
    /// out than the rest.
    pub(crate) fn with_limits(
        model: Arc<TruckModel>,
        road: Arc<Road>,
        start: &EgoStart,
        weather: &Weather,
        limits: VehicleLimits,
    ) -> Result<Self, SimError> {
        let refuse = |why: String| SimError::Scenario { name: "ego".into(), why };
        let needs_m = limits.geometry.rear_m();
        if start.s_m < needs_m || start.s_m + limits.geometry.front_m >= road.length_m() {
            return Err(refuse(format!(
                "ego.s_m = {} must be between {needs_m:.1} (the trailer's length) and the road's \
                 length {:.1}",
                start.s_m,
                road.length_m()
            )));
        }
        let drivable = |l: &&road::LaneTrack| matches!(l.kind, LaneKind::Driving | LaneKind::Entry);
        let lane = match start.lane {
            Some(id) => road.lanes_at(start.s_m).find(|l| l.id == id),
            None => road
                .lanes_at(start.s_m)
                .filter(drivable)
                .min_by(|a, b| a.center_d_m(start.s_m).total_cmp(&b.center_d_m(start.s_m))),
        };
        let lane = lane.ok_or_else(|| {
            refuse(format!("no lane {:?} at ego.s_m = {}", start.lane, start.s_m))
        })?;
        let d_m = lane.center_d_m(start.s_m);
        let at = road.at(start.s_m, d_m);
        let start_z_m = road.at(0.0, 0.0).z_m;
        let plant = model.initial_state(at.x_m, at.y_m, at.heading_rad, start.speed_m_s);
        let mut truck = Self {
            model,
            road,
            weather: weather.clone(),
            cold_retarder_n: limits.powertrain.retarder_force_n.clone(),
            retarder_left_frac: 1.0,
            limits,
            start_z_m,
            plant,
            ego: EgoState { s_m: start.s_m, d_m, ..EgoState::default() },
            command: Command::default(),
            time: Time::ZERO,
        };
        truck.observe(&truck.patch());
        Ok(truck)
    }

    /// The true state read last; [`Vehicle::ego`] gives what the instruments make of it.
    #[must_use]
    pub const fn state(&self) -> &EgoState {
        &self.ego
    }

    /// The plant behind it.
    #[must_use]
    pub const fn plant(&self) -> &TruckState {
        &self.plant
    }

    /// The road that it is on.
    pub(crate) fn road(&self) -> &Road {
        &self.road
    }

    /// The truck model.
    #[must_use]
    pub fn model(&self) -> &TruckModel {
        &self.model
    }

    /// Road (as the map has it for where the truck is) and weather.
    #[must_use]
    pub fn patch(&self) -> RoadPatch {
        let mapped_m = self.model.parameters().instruments.map_position_m(self.ego.s_m);
        let at = self.road.surface(mapped_m, self.ego.d_m);
        let w = &self.weather;
        let (air_temperature_k, air_pressure_pa) = w.air_at(at.z_m - self.start_z_m);
        RoadPatch {
            grade_rad: at.grade_rad,
            bank_rad: at.bank_rad,
            wind_m_s: (w.wind_x_m_s, w.wind_y_m_s),
            air_temperature_k,
            air_pressure_pa,
            altitude_m: at.z_m,
            adhesion_coeff: w.adhesion_coeff,
        }
    }

    /// Tells what the retarder has left, as its control unit does.
    fn tell_retarder(&mut self) {
        let left_frac = self.model.retarder_left_frac(&self.plant);
        if (left_frac - self.retarder_left_frac).abs() > RETARDER_STEP_FRAC
            && let Some(cold_n) = &self.cold_retarder_n
        {
            self.retarder_left_frac = left_frac;
            self.limits.powertrain.retarder_force_n = Some(cold_n.scaled(left_frac));
        }
    }

    /// Refreshes the reported state from the plant, which has come here on `patch`.
    fn observe(&mut self, patch: &RoadPatch) {
        let hint = self.ego.s_m;
        let mut ego = self.model.ego_state(&self.plant, patch);
        if let Some(p) = self.road.project(ego.x_m, ego.y_m, Some(hint)) {
            (ego.s_m, ego.d_m) = (p.s_m, p.d_m);
        }
        ego.z_m = self.road.surface(ego.s_m, ego.d_m).z_m;
        self.ego = ego;
    }
}

impl Vehicle for SimTruck {
    type Error = DynamicsError;

    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, DynamicsError> {
        let ahead_s = now.seconds_since(self.time);
        if ahead_s >= SUBSTEP_S {
            let steps = libm::floor(ahead_s / SUBSTEP_S + 1e-6);
            let patch = self.patch();
            self.model.advance(&mut self.plant, &self.command, &patch, steps * SUBSTEP_S)?;
            self.time = self.time.plus_nanos(Time::from_seconds(steps * SUBSTEP_S).0);
            self.observe(&patch);
            self.tell_retarder();
        }
        Ok(Stamped { time: self.time, value: self.model.measured(&self.ego) })
    }

    fn command(&mut self, _now: Time, command: &Command) -> Result<(), DynamicsError> {
        self.command = *command;
        Ok(())
    }

    fn limits(&self) -> &VehicleLimits {
        &self.limits
    }
}
