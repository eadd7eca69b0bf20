//! What a user sets about native traffic, and its check.
//!
//! Scenario families of the paper (Sec. VI-C): spawn probability 0.05, 0.02, 0.005 (dense, medium,
//! sparse) and maximum speed of the traffic 12.5 or 15 m/s. The paper does not say what the
//! probability refers to; here it is per lane and per simulation step of 0.1 s, so that "dense" is
//! 1800 vehicles per hour and lane (40 vehicles/km at 12.5 m/s), see `spawn_interval_s`.

use serde::{Deserialize, Serialize};
use tractrix_core::VehicleClass;

use super::human::HumanConfig;
use super::window::WindowConfig;
use crate::TrafficError;
use crate::schedule::Schedule;

/// Relative standard deviation of headways among drivers: between drivers on the same motorway it is
/// about half the mean (Treiber & Kesting 2013, Fig. 4.8; Banks, Transp. Res. C 11 (2003) 189).
const HEADWAY_SIGMA_FRAC: f64 = 0.5;

/// Means of one vehicle class; each driver draws their own values around them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassConfig {
    /// Length, m.
    pub length_m: f64,
    /// Half the range of lengths, m (uniform).
    pub length_spread_m: f64,
    /// Width, m.
    pub width_m: f64,
    /// Desired speed as a fraction of the smaller of `max_speed_m_s` and the speed limit.
    pub speed_factor_frac: f64,
    /// Standard deviation of the speed factor.
    pub speed_factor_sigma_frac: f64,
    /// IDM time headway, s.
    pub headway_s: f64,
    /// Relative standard deviation of the headway among drivers (log-normal).
    #[serde(default = "headway_sigma_frac")]
    pub headway_sigma_frac: f64,
    /// IDM standstill gap, m.
    pub min_gap_m: f64,
    /// IDM acceleration, m/s².
    pub accel_m_s2: f64,
    /// IDM comfortable deceleration, m/s².
    pub decel_m_s2: f64,
    /// Hardest braking, m/s².
    pub max_decel_m_s2: f64,
    /// Relative standard deviation of standstill gap, acceleration and deceleration.
    pub spread_frac: f64,
    /// MOBIL politeness.
    pub politeness_frac: f64,
    /// MOBIL safe braking of others, m/s².
    pub safe_decel_m_s2: f64,
    /// MOBIL changing threshold, m/s².
    pub threshold_m_s2: f64,
    /// MOBIL keep-right bias, m/s².
    pub right_bias_m_s2: f64,
    /// Duration of a lane change, s.
    pub lane_change_s: f64,
    /// Wheel power over mass, W/kg; what limits a truck on a grade.
    pub power_w_kg: f64,
    /// Rolling resistance, dimensionless.
    pub rolling_coeff: f64,
    /// Air drag over mass: ρ c_d A / (2 m), 1/m.
    pub drag_1_m: f64,
}

/// Relative standard deviation of headways where a file does not name one.
fn headway_sigma_frac() -> f64 {
    HEADWAY_SIGMA_FRAC
}

/// Native traffic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrafficConfig {
    /// Seed of every draw.
    pub seed: u64,
    /// Probability of an arrival per entry lane and `spawn_interval_s`.
    pub spawn_probability: f64,
    /// Interval that the probability refers to, s.
    pub spawn_interval_s: f64,
    /// The same for on-ramps.
    pub ramp_spawn_probability: f64,
    /// Vehicles per km and lane at the start; `None`: the density of the inflow at `max_speed_m_s`.
    pub initial_density_1_km: Option<f64>,
    /// Part of the vehicles of that start that stand in a queue, which lies anywhere on the road, in
    /// all lanes alike.
    pub initial_standing_frac: f64,
    /// Maximum speed of the traffic, m/s.
    pub max_speed_m_s: f64,
    /// Share of trucks.
    pub truck_share_frac: f64,
    /// Share of vans.
    pub van_share_frac: f64,
    /// Share of vehicles that leave at each off-ramp.
    pub exit_share_frac: f64,
    /// Traffic runs this long before the first scene, s.
    pub warm_up_s: f64,
    /// Free road kept around the ego at the start, in the lanes that it touches, m.
    pub ego_clearance_m: f64,
    /// Vehicles further away than this along the road are not published, m.
    pub scene_radius_m: f64,
    /// Drivers see the ego (mode `inter`); otherwise they drive through it (mode `pure`).
    pub sees_ego: bool,
    /// Trucks keep out of the leftmost of three or more lanes (German StVO § 7 (3c); most states of
    /// the USA have left-lane restrictions for trucks of the same kind).
    pub trucks_keep_out_of_left_lane: bool,
    /// Where a lane ends or an exit comes, drivers begin to change lanes this far before, m; those
    /// whose changes take longer than the mean car's (`lane_change_s`), as many times as far.
    pub mandatory_ahead_m: f64,
    /// Braking that a driver accepts to let another one merge, m/s².
    pub yield_decel_m_s2: f64,
    /// Mean speed at which traffic comes in at the start of the road, m/s, where a queue before it
    /// sets it. `None`: everyone comes at their desired speed.
    pub inflow_speed_m_s: Option<f64>,
    /// Standard deviation of that speed, m/s; it changes as that of the outflow does.
    pub inflow_sigma_m_s: f64,
    /// Mean speed of the traffic beyond the end of the road, m/s: what congestion comes from.
    /// `None`: the road goes on free.
    pub outflow_speed_m_s: Option<f64>,
    /// Standard deviation of that speed, m/s; it changes from lane to lane and in time.
    pub outflow_sigma_m_s: f64,
    /// Time between two independent draws of these speeds, s; in between they go over linearly.
    pub outflow_period_s: f64,
    /// Vehicles beyond it act less often; `None`: all act in every tick.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<WindowConfig>,
    /// What drivers misjudge, get used to and remember.
    pub human: HumanConfig,
    /// Passenger cars.
    pub car: ClassConfig,
    /// Light commercial vehicles.
    pub van: ClassConfig,
    /// Heavy trucks.
    pub truck: ClassConfig,
    /// What changes while traffic runs; of the scenario, beside these figures.
    #[serde(skip)]
    pub schedule: Schedule,
}

impl Default for TrafficConfig {
    /// Medium density at 15 m/s. Headways and accelerations give a level two-lane road the capacity
    /// of the HCM (6th ed., Exh. 12-4 and 12-25); standstill gaps are those of Treiber & Kesting
    /// (2013), Table 11.2, politeness and thresholds those of Kesting, Treiber, Helbing (2007). Cars
    /// use 25 W/kg of their power. Trucks: 40 t at 300 kW at the wheels, c_d A = 6.3 m², rolling
    /// 0.0055 (VECTO generic long-haul tractor).
    fn default() -> Self {
        let car = ClassConfig {
            length_m: 4.6,
            length_spread_m: 0.5,
            width_m: 1.85,
            speed_factor_frac: 1.0,
            speed_factor_sigma_frac: 0.1,
            headway_s: 1.25,
            headway_sigma_frac: HEADWAY_SIGMA_FRAC,
            min_gap_m: 2.0,
            accel_m_s2: 2.0,
            decel_m_s2: 2.0,
            max_decel_m_s2: 8.0,
            spread_frac: 0.12,
            politeness_frac: 0.2,
            safe_decel_m_s2: 3.0,
            threshold_m_s2: 0.1,
            right_bias_m_s2: 0.1,
            lane_change_s: 4.0,
            power_w_kg: 25.0,
            rolling_coeff: 0.01,
            drag_1_m: 2.8e-4,
        };
        let van = ClassConfig {
            length_m: 6.5,
            length_spread_m: 1.0,
            width_m: 2.1,
            headway_s: 1.35,
            accel_m_s2: 1.7,
            power_w_kg: 18.0,
            drag_1_m: 4.5e-4,
            ..car
        };
        let truck = ClassConfig {
            length_m: 16.0,
            length_spread_m: 2.0,
            width_m: 2.55,
            speed_factor_frac: 0.92,
            speed_factor_sigma_frac: 0.04,
            headway_s: 1.7,
            min_gap_m: 3.0,
            accel_m_s2: 1.2,
            decel_m_s2: 1.5,
            max_decel_m_s2: 6.0,
            safe_decel_m_s2: 2.5,
            threshold_m_s2: 0.2,
            lane_change_s: 6.0,
            power_w_kg: 7.5,
            rolling_coeff: 0.0055,
            drag_1_m: 9.5e-5,
            ..car
        };
        Self {
            seed: 1,
            spawn_probability: 0.02,
            spawn_interval_s: 0.1,
            ramp_spawn_probability: 0.005,
            initial_density_1_km: None,
            initial_standing_frac: 0.0,
            max_speed_m_s: 15.0,
            truck_share_frac: 0.2,
            van_share_frac: 0.1,
            exit_share_frac: 0.1,
            warm_up_s: 30.0,
            ego_clearance_m: 50.0,
            scene_radius_m: 300.0,
            sees_ego: true,
            trucks_keep_out_of_left_lane: false,
            mandatory_ahead_m: 800.0,
            yield_decel_m_s2: 1.5,
            inflow_speed_m_s: None,
            inflow_sigma_m_s: 0.0,
            outflow_speed_m_s: None,
            outflow_sigma_m_s: 0.0,
            outflow_period_s: 20.0,
            window: None,
            human: HumanConfig::default(),
            car,
            van,
            truck,
            schedule: Schedule::default(),
        }
    }
}

/// Densities of the paper's scenario families.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Density {
    /// Spawn probability 0.05.
    Dense,
    /// Spawn probability 0.02.
    Medium,
    /// Spawn probability 0.005.
    Sparse,
}

impl Density {
    /// All three, as in the paper's Table II.
    pub const ALL: [Self; 3] = [Self::Dense, Self::Medium, Self::Sparse];

    /// The paper's spawn probability.
    #[must_use]
    pub fn spawn_probability(self) -> f64 {
        match self {
            Self::Dense => 0.05,
            Self::Medium => 0.02,
            Self::Sparse => 0.005,
        }
    }
}

/// Maximum speeds of the paper's scenario families, m/s.
pub const FAMILY_MAX_SPEEDS_M_S: [f64; 2] = [12.5, 15.0];

impl TrafficConfig {
    /// One of the paper's six scenario families.
    #[must_use]
    pub fn family(density: Density, max_speed_m_s: f64, seed: u64) -> Self {
        Self {
            seed,
            spawn_probability: density.spawn_probability(),
            max_speed_m_s,
            ..Self::default()
        }
    }

    /// Means of a class.
    #[must_use]
    pub fn class(&self, class: VehicleClass) -> &ClassConfig {
        match class {
            VehicleClass::Car | VehicleClass::Barrier => &self.car,
            VehicleClass::Van | VehicleClass::Emergency => &self.van,
            VehicleClass::Truck => &self.truck,
        }
    }

    /// Density of the initial fill, vehicles per km and lane.
    #[must_use]
    pub fn start_density_1_km(&self) -> f64 {
        self.initial_density_1_km.unwrap_or_else(|| {
            1000.0 * self.spawn_probability / (self.spawn_interval_s * self.max_speed_m_s)
        })
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`TrafficError::Config`] lists every key that is out of its range, with the value.
    pub fn validate(&self) -> Result<(), TrafficError> {
        let mut bad = Vec::new();
        let mut check = |key: String, value: f64, low: f64, high: f64| {
            if !(value >= low && value <= high) {
                bad.push(format!("{key} = {value} is outside [{low}, {high}]"));
            }
        };
        for (key, value, low, high) in [
            ("spawn_probability", self.spawn_probability, 0.0, 1.0),
            ("spawn_interval_s", self.spawn_interval_s, 0.1, 3600.0),
            ("ramp_spawn_probability", self.ramp_spawn_probability, 0.0, 1.0),
            ("initial_density_1_km", self.initial_density_1_km.unwrap_or(0.0), 0.0, 140.0),
            ("initial_standing_frac", self.initial_standing_frac, 0.0, 0.9),
            ("max_speed_m_s", self.max_speed_m_s, 1.0, 70.0),
            ("truck_share_frac", self.truck_share_frac, 0.0, 1.0),
            (
                "van_share_frac",
                self.van_share_frac,
                0.0,
                1.0 - self.truck_share_frac.clamp(0.0, 1.0),
            ),
            ("exit_share_frac", self.exit_share_frac, 0.0, 1.0),
            ("warm_up_s", self.warm_up_s, 0.0, 3600.0),
            ("ego_clearance_m", self.ego_clearance_m, 0.0, 1000.0),
            ("scene_radius_m", self.scene_radius_m, 1.0, 100_000.0),
            ("mandatory_ahead_m", self.mandatory_ahead_m, 10.0, 10_000.0),
            ("yield_decel_m_s2", self.yield_decel_m_s2, 0.0, 5.0),
            ("inflow_speed_m_s", self.inflow_speed_m_s.unwrap_or(1.0), 1.0, 70.0),
            ("inflow_sigma_m_s", self.inflow_sigma_m_s, 0.0, 30.0),
            ("outflow_speed_m_s", self.outflow_speed_m_s.unwrap_or(0.0), 0.0, 70.0),
            ("outflow_sigma_m_s", self.outflow_sigma_m_s, 0.0, 30.0),
            ("outflow_period_s", self.outflow_period_s, 1.0, 3600.0),
        ] {
            check(key.to_owned(), value, low, high);
        }
        if let Some(window) = self.window {
            let radius_m = self.scene_radius_m;
            check("window.behind_m".to_owned(), window.behind_m, radius_m, 100_000.0);
            check("window.ahead_m".to_owned(), window.ahead_m, radius_m, 100_000.0);
            if let Some(awake_m) = window.awake_m {
                let least_m = window.behind_m.max(window.ahead_m);
                check("window.awake_m".to_owned(), awake_m, least_m, 100_000.0);
            }
        }
        for (key, value, low, high) in self.human.ranges() {
            check(key.to_owned(), value, low, high);
        }
        for (name, c) in [("car", &self.car), ("van", &self.van), ("truck", &self.truck)] {
            for (key, value, low, high) in [
                ("length_m", c.length_m, 1.0, 40.0),
                ("length_spread_m", c.length_spread_m, 0.0, 0.5 * c.length_m),
                ("width_m", c.width_m, 0.5, 4.0),
                ("speed_factor_frac", c.speed_factor_frac, 0.2, 2.0),
                (
                    "speed_factor_sigma_frac",
                    c.speed_factor_sigma_frac,
                    0.0,
                    0.25 * c.speed_factor_frac,
                ),
                ("headway_s", c.headway_s, 0.3, 10.0),
                ("headway_sigma_frac", c.headway_sigma_frac, 0.0, 1.0),
                ("min_gap_m", c.min_gap_m, 0.5, 20.0),
                ("accel_m_s2", c.accel_m_s2, 0.1, 6.0),
                ("decel_m_s2", c.decel_m_s2, 0.3, 6.0),
                ("max_decel_m_s2", c.max_decel_m_s2, c.decel_m_s2, 12.0),
                ("spread_frac", c.spread_frac, 0.0, 0.25),
                ("politeness_frac", c.politeness_frac, 0.0, 2.0),
                ("safe_decel_m_s2", c.safe_decel_m_s2, 0.1, c.max_decel_m_s2),
                ("threshold_m_s2", c.threshold_m_s2, 0.0, 5.0),
                ("right_bias_m_s2", c.right_bias_m_s2, -5.0, 5.0),
                ("lane_change_s", c.lane_change_s, 0.5, 20.0),
                ("power_w_kg", c.power_w_kg, 1.0, 500.0),
                ("rolling_coeff", c.rolling_coeff, 0.0, 0.1),
                ("drag_1_m", c.drag_1_m, 0.0, 0.01),
            ] {
                check(format!("{name}.{key}"), value, low, high);
            }
        }
        if let Err(TrafficError::Config { why }) = self.schedule.validate(None) {
            bad.push(why);
        }
        if self.window.is_some() && !self.schedule.is_empty() {
            bad.push("window: not with incidents or changing demand".to_owned());
        }
        if bad.is_empty() { Ok(()) } else { Err(TrafficError::Config { why: bad.join("; ") }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_and_the_six_families_are_valid() {
        for density in Density::ALL {
            for v in FAMILY_MAX_SPEEDS_M_S {
                TrafficConfig::family(density, v, 3).validate().unwrap();
            }
        }
        let dense = TrafficConfig::family(Density::Dense, 12.5, 1);
        assert!((dense.start_density_1_km() - 40.0).abs() < 1e-9);
    }

    #[test]
    fn every_bad_value_is_named_at_once() {
        let mut c = TrafficConfig { spawn_probability: 1.5, ..TrafficConfig::default() };
        c.truck.headway_s = f64::NAN;
        let e = c.validate().unwrap_err().to_string();
        assert!(
            e.contains("spawn_probability = 1.5") && e.contains("truck.headway_s = NaN"),
            "{e}"
        );
    }

    #[test]
    fn a_misspelt_key_is_refused_by_name() {
        let e = toml::from_str::<TrafficConfig>("spawn_probabillity = 0.1").unwrap_err();
        assert!(e.to_string().contains("spawn_probabillity"));
        let c: TrafficConfig = toml::from_str("spawn_probability = 0.05\nseed = 9").unwrap();
        assert_eq!((c.spawn_probability, c.seed, c.max_speed_m_s), (0.05, 9, 15.0));
    }
}
