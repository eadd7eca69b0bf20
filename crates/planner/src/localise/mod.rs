//! Where a truck is that has no better source: wheel speed and yaw rate carry the pose on, satellite
//! fixes correct it, the road says where on the route it is.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | the pose source, the spreading of corrections, articulation |
//! | `filter` | dead reckoning and fixes in an extended Kalman filter |
//! | `projection` | latitude and longitude to the map |
//! | `nmea` | sentences of a receiver |
//!
//! A correction would be a jump of the truck to everybody who drives by the pose: it is spread over
//! the time after it, slower than any guard takes offence at.

mod filter;
mod nmea;
mod projection;

pub use nmea::{Nmea, NmeaError};
pub use projection::MapProjection;

use alloc::string::String;
use alloc::sync::Arc;

use filter::Filter;
use road::Road;
use serde::{Deserialize, Serialize};
use tractrix_core::{Fix, Motion, Pose, PoseSource, Stamped, Time, VehicleLimits};

use crate::PlannerError;
use crate::error::config_in;

/// What the sensors are worth, and how corrections are spread.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LocaliserConfig {
    /// Standard deviation of a fix, m, in x and in y.
    pub fix_sd_m: f64,
    /// Standard deviation of a course over ground, rad.
    pub course_sd_rad: f64,
    /// Antenna ahead of the reference point, m.
    pub antenna_ahead_m: f64,
    /// Antenna to the left of the truck's middle, m.
    pub antenna_left_m: f64,
    /// Error of the position that dead reckoning gathers in one second at 20 m/s, m (standard
    /// deviation; it grows with the root of time).
    pub position_drift_m: f64,
    /// Error of the heading that the yaw rate gathers in one second, rad.
    pub yaw_drift_rad: f64,
    /// Change of the yaw rate's bias in one second, rad/s.
    pub bias_drift_rad_s: f64,
    /// Bias of the yaw rate at the start, rad/s (standard deviation).
    pub bias_sd_rad_s: f64,
    /// A fix farther off than this many standard deviations is not believed.
    pub gate_sd: f64,
    /// The truck is lost when so many fixes in a row were not believed.
    pub disbelieved_max: u32,
    /// The truck is lost when the position's standard deviation is larger, m.
    pub position_sd_max_m: f64,
    /// Fastest correction of the position, m/s.
    pub spread_m_s: f64,
    /// Fastest correction of the heading, rad/s.
    pub spread_rad_s: f64,
    /// The truck is lost when more than this is still to be corrected, m.
    pub spread_max_m: f64,
    /// The truck is lost this far from the road's reference line, m.
    pub off_road_m: f64,
}

impl Default for LocaliserConfig {
    fn default() -> Self {
        Self {
            fix_sd_m: 0.05,
            course_sd_rad: 0.02,
            antenna_ahead_m: 0.0,
            antenna_left_m: 0.0,
            position_drift_m: 0.03,
            yaw_drift_rad: 0.001,
            bias_drift_rad_s: 1e-5,
            bias_sd_rad_s: 0.002,
            gate_sd: 4.0,
            disbelieved_max: 10,
            position_sd_max_m: 0.5,
            spread_m_s: 0.3,
            spread_rad_s: 0.01,
            spread_max_m: 3.0,
            off_road_m: 50.0,
        }
    }
}

impl LocaliserConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("localiser.fix_sd_m", self.fix_sd_m, 1e-3, 100.0)?;
        config_in("localiser.course_sd_rad", self.course_sd_rad, 1e-4, 1.0)?;
        config_in("localiser.antenna_ahead_m", self.antenna_ahead_m, -20.0, 20.0)?;
        config_in("localiser.antenna_left_m", self.antenna_left_m, -3.0, 3.0)?;
        config_in("localiser.position_drift_m", self.position_drift_m, 1e-4, 10.0)?;
        config_in("localiser.yaw_drift_rad", self.yaw_drift_rad, 1e-6, 1.0)?;
        config_in("localiser.bias_drift_rad_s", self.bias_drift_rad_s, 0.0, 1.0)?;
        config_in("localiser.bias_sd_rad_s", self.bias_sd_rad_s, 0.0, 1.0)?;
        config_in("localiser.gate_sd", self.gate_sd, 1.0, 100.0)?;
        config_in("localiser.position_sd_max_m", self.position_sd_max_m, 1e-2, 100.0)?;
        // What the guard's default takes for a jump is more than 1 m plus 5 m/s across
        config_in("localiser.spread_m_s", self.spread_m_s, 1e-2, 2.0)?;
        config_in("localiser.spread_rad_s", self.spread_rad_s, 1e-4, 0.5)?;
        config_in("localiser.spread_max_m", self.spread_max_m, 0.1, 100.0)?;
        config_in("localiser.off_road_m", self.off_road_m, 1.0, 10_000.0)
    }
}

/// Why there is no pose that can be driven with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LocaliseError {
    /// No fix has come in yet, or the truck has not said how it moves.
    #[error("no fix and motion yet")]
    Unknown,
    /// Without fixes for too long.
    #[error("the position is known to {sd_m:.2} m only, {max_m} m are allowed")]
    Uncertain {
        /// Standard deviation, m.
        sd_m: f64,
        /// Largest allowed, m.
        max_m: f64,
    },
    /// Fixes and dead reckoning contradict each other.
    #[error("{0} fixes in a row do not fit the truck's motion")]
    Disagrees(u32),
    /// The correction is too large to be spread.
    #[error("{0:.1} m are still to be corrected")]
    TooFar(f64),
    /// The road does not contain the pose.
    #[error("the road does not contain x = {x_m:.1} m, y = {y_m:.1} m")]
    OffRoad {
        /// Map x, m.
        x_m: f64,
        /// Map y, m.
        y_m: f64,
    },
    /// The map's projection cannot be evaluated.
    #[error("projection of the map: {0}")]
    Projection(String),
}

/// A pose source on a known road.
#[derive(Debug, Clone)]
pub struct Localiser {
    config: LocaliserConfig,
    limits: VehicleLimits,
    road: Arc<Road>,
    projection: MapProjection,
    filter: Option<Filter>,
    motion: Option<Stamped<Motion>>,
    /// What is still to be corrected: x, y, m, and heading, rad, of what is told minus estimated.
    owed: [f64; 3],
    disbelieved: u32,
    articulation_rad: f64,
    trailer_yaw_rate_rad_s: f64,
    /// Last position along the road, m, where the next is looked for.
    near_m: Option<f64>,
}

impl Localiser {
    /// A localiser on a road whose map says where on earth it lies. The sheet gives the lengths that
    /// the articulation follows from.
    ///
    /// # Errors
    /// [`LocaliseError::Projection`] for a map without a projection or with one that cannot be
    /// evaluated, and for a configuration out of range.
    pub fn new(
        config: LocaliserConfig,
        limits: &VehicleLimits,
        road: Arc<Road>,
    ) -> Result<Self, LocaliseError> {
        let refuse =
            |why: &dyn core::fmt::Display| LocaliseError::Projection(alloc::format!("{why}"));
        config.check().map_err(|e| refuse(&e))?;
        let reference = road.geo_reference().ok_or_else(|| refuse(&"the map has none"))?;
        let projection = MapProjection::new(reference)?;
        Ok(Self {
            config,
            limits: limits.clone(),
            road,
            projection,
            filter: None,
            motion: None,
            owed: [0.0; 3],
            disbelieved: 0,
            articulation_rad: 0.0,
            trailer_yaw_rate_rad_s: 0.0,
            near_m: None,
        })
    }

    /// Standard deviations of position, m (of its worse axis), and heading, rad; infinite before the
    /// first fix.
    #[must_use]
    pub fn deviation(&self) -> [f64; 2] {
        self.filter.as_ref().map_or([f64::INFINITY; 2], Filter::deviation)
    }

    /// Lateral speed of the reference point, m/s: the drive axles' slip in a steady turn. They carry
    /// their share of both bodies' side forces.
    fn lateral_speed_m_s(&self, motion: &Motion) -> f64 {
        let (g, l) = (&self.limits.geometry, &self.limits.lateral);
        let accel = motion.speed_m_s * motion.yaw_rate_rad_s;
        let own = l.tractor_mass_kg * (1.0 - g.cg_ahead_m / g.wheelbase_m);
        let hitched = l.trailer_mass_kg
            * (1.0 - l.trailer_cg_behind_hitch_m / g.hitch_to_trailer_axle_m)
            * (1.0 - g.hitch_ahead_m / g.wheelbase_m);
        -motion.speed_m_s * (own + hitched) * accel / l.drive_stiffness_n_rad
    }

    /// The trailer follows its hitch without side slip (the paper's Eq. 1).
    fn tow(&mut self, motion: &Motion, lateral_m_s: f64, yaw_rate_rad_s: f64, dt_s: f64) {
        let g = &self.limits.geometry;
        let (sin, cos) = libm::sincos(self.articulation_rad);
        let hitch_m_s = lateral_m_s + yaw_rate_rad_s * g.hitch_ahead_m;
        self.trailer_yaw_rate_rad_s =
            (hitch_m_s * cos - motion.speed_m_s * sin) / g.hitch_to_trailer_axle_m;
        let rate = self.trailer_yaw_rate_rad_s - yaw_rate_rad_s;
        self.articulation_rad = (self.articulation_rad + rate * dt_s).clamp(-1.6, 1.6);
    }

    /// Pays a part of what is owed.
    fn spread(&mut self, dt_s: f64) {
        let [x, y, yaw] = &mut self.owed;
        let distance = libm::hypot(*x, *y);
        let left = (distance - self.config.spread_m_s * dt_s).max(0.0);
        let share = if distance > 0.0 { left / distance } else { 0.0 };
        (*x, *y) = (*x * share, *y * share);
        let step = self.config.spread_rad_s * dt_s;
        *yaw -= yaw.clamp(-step, step);
    }

    /// The first fix: along the road where the receiver has no course. It is carried on by the way
    /// driven since, m.
    fn start(&mut self, at_m: [f64; 2], heading: Option<f64>, since_m: f64) {
        self.near_m = self.road.project(at_m[0], at_m[1], None).map(|p| p.s_m);
        let along = self.near_m.map_or(0.0, |s_m| self.road.line().at(s_m).heading_rad);
        let c = &self.config;
        // The map's headings are not wrapped: the nearest turn to the road's
        let (yaw, sd) = heading.map_or((along, 0.05), |heading| {
            (along + crate::wrapped(heading - along), c.course_sd_rad)
        });
        let (sin, cos) = libm::sincos(yaw);
        let (ahead, left) = (c.antenna_ahead_m - since_m, c.antenna_left_m);
        let (x_m, y_m) = (at_m[0] - ahead * cos + left * sin, at_m[1] - ahead * sin - left * cos);
        self.filter = Some(Filter::new([x_m, y_m, yaw], c.fix_sd_m, sd, c.bias_sd_rad_s));
    }
}

/// Longest step of dead reckoning, s; after a longer pause the truck has to be found anew.
const STEP_MAX_S: f64 = 0.5;

impl PoseSource for Localiser {
    type Error = LocaliseError;

    /// The pose at the last motion that was heard.
    fn pose(&mut self, _now: Time) -> Result<Stamped<Pose>, LocaliseError> {
        let (Some(filter), Some(motion)) = (&self.filter, &self.motion) else {
            return Err(LocaliseError::Unknown);
        };
        let c = &self.config;
        let [sd_m, _] = filter.deviation();
        let owed_m = libm::hypot(self.owed[0], self.owed[1]);
        let (x_m, y_m) = (filter.state[0] + self.owed[0], filter.state[1] + self.owed[1]);
        if !(sd_m <= c.position_sd_max_m) {
            return Err(LocaliseError::Uncertain { sd_m, max_m: c.position_sd_max_m });
        }
        if self.disbelieved >= c.disbelieved_max {
            return Err(LocaliseError::Disagrees(self.disbelieved));
        }
        if owed_m > c.spread_max_m {
            return Err(LocaliseError::TooFar(owed_m));
        }
        let off_road = LocaliseError::OffRoad { x_m, y_m };
        let on_road = |p: &road::RoadPosition| p.d_m.abs() <= c.off_road_m;
        let p = self.road.project(x_m, y_m, self.near_m).filter(on_road).ok_or(off_road)?;
        self.near_m = Some(p.s_m);
        let value = Pose {
            x_m,
            y_m,
            z_m: self.road.at(p.s_m, p.d_m).z_m,
            yaw_rad: filter.state[2] + self.owed[2],
            s_m: p.s_m,
            d_m: p.d_m,
            lateral_speed_m_s: self.lateral_speed_m_s(&motion.value),
            articulation_rad: self.articulation_rad,
            trailer_yaw_rate_rad_s: self.trailer_yaw_rate_rad_s,
        };
        Ok(Stamped { time: motion.time, value })
    }

    fn moved(&mut self, motion: &Stamped<Motion>) {
        let m = motion.value;
        if !(m.speed_m_s.is_finite() && m.yaw_rate_rad_s.is_finite()) {
            return;
        }
        let Some(last) = self.motion.replace(*motion) else { return };
        let dt_s = motion.time.seconds_since(last.time);
        if !(0.0..=STEP_MAX_S).contains(&dt_s) {
            self.filter = None;
            self.owed = [0.0; 3];
            return;
        }
        let mean = Motion {
            speed_m_s: 0.5 * (last.value.speed_m_s + m.speed_m_s),
            yaw_rate_rad_s: 0.5 * (last.value.yaw_rate_rad_s + m.yaw_rate_rad_s),
        };
        let lateral_m_s = self.lateral_speed_m_s(&mean);
        let bias = self.filter.as_ref().map_or(0.0, |filter| filter.state[3]);
        self.tow(&mean, lateral_m_s, mean.yaw_rate_rad_s - bias, dt_s);
        self.spread(dt_s);
        if let Some(filter) = &mut self.filter {
            let velocity = [mean.speed_m_s, lateral_m_s];
            filter.predict(dt_s, velocity, mean.yaw_rate_rad_s, &self.config);
        }
    }

    /// A fix that is late is carried on to the last motion at the present velocity.
    fn fixed(&mut self, fix: &Stamped<Fix>) {
        let Fix { latitude_deg, longitude_deg, course_rad } = fix.value;
        if !(latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 360.0) {
            return;
        }
        let Some(motion) = self.motion else { return };
        let [x_m, y_m] = self.projection.to_map_m(latitude_deg, longitude_deg);
        let slip = self.lateral_speed_m_s(&motion.value);
        let drift = libm::atan2(slip, motion.value.speed_m_s.max(1.0));
        let heading = course_rad
            .filter(|course| course.is_finite())
            .map(|course| self.projection.north_rad(latitude_deg, longitude_deg) - course - drift);
        let late_s = motion.time.seconds_since(fix.time).clamp(-STEP_MAX_S, STEP_MAX_S);
        let since_m = motion.value.speed_m_s * late_s;
        let Some(filter) = &mut self.filter else {
            return self.start([x_m, y_m], heading, since_m);
        };
        let c = &self.config;
        let (sin, cos) = libm::sincos(filter.state[2]);
        let (forward, left) = (since_m, slip * late_s);
        let now_m = [x_m + forward * cos - left * sin, y_m + forward * sin + left * cos];
        let before = filter.state;
        let lever = [c.antenna_ahead_m, c.antenna_left_m];
        if filter.take_position(now_m, lever, c.fix_sd_m, c.gate_sd) {
            self.disbelieved = 0;
        } else {
            self.disbelieved = self.disbelieved.saturating_add(1);
            if self.disbelieved >= self.config.disbelieved_max.saturating_mul(2) {
                // Lost for long enough: it is found anew with the next fix
                (self.filter, self.owed, self.disbelieved) = (None, [0.0; 3], 0);
                return;
            }
        }
        if let Some(heading) = heading {
            filter.take_heading(heading, c.course_sd_rad, c.gate_sd);
        }
        let correction = filter.state - before;
        for (owed, by) in self.owed.iter_mut().zip(correction.iter()) {
            *owed -= by;
        }
    }
}
