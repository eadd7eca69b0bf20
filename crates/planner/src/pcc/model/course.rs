//! The course: a road sampled at equal steps with the speeds that are allowed on it.
//!
//! Node `k` lies at `s_k = s_0 + k h`, interval `k` between nodes `k` and `k+1`. Between nodes the
//! specific energy is linear, so speed lies between its node values: a limit that holds anywhere in
//! an interval is applied to both of its nodes. Grades are averaged by integrating height, so the
//! course climbs exactly as much as the road.

use alloc::{format, vec::Vec};

use road::{ProfilePoint, Road};
use tractrix_core::{RoadPiece, VehicleLimits, Wind};

use super::truck::Truck;
use crate::pcc::error::{PccError, check};

/// Largest number of intervals of a course.
pub(super) const MAX_INTERVALS: usize = 20_000;
/// Lowest speed that is planned, m/s; the space domain ends at standstill.
pub(crate) const MIN_SPEED_M_S: f64 = 1.0;

/// What the driver or operator asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedBand {
    /// Set speed, m/s: speed at both ends of a trip, and of the cruise-control baselines.
    pub set_m_s: f64,
    /// Lowest speed, m/s; relaxed where full power, a limit or a curve forces less.
    pub min_m_s: f64,
    /// Highest speed, m/s.
    pub max_m_s: f64,
}

/// Tuning that is not a property of truck or road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuning {
    /// Step of the course, m (25 m; a whole number of steps is fitted into the length).
    pub step_m: f64,
    /// `k_a` of Eq. 18, penalty on acceleration squared over time, g s³/m².
    pub accel_penalty_g_s3_m2: f64,
    /// Penalty on the change of acceleration from interval to interval squared, g s⁴/m².
    pub accel_change_penalty_g_s4_m2: f64,
    /// Fuel charged per gear shift, g: the traction gap, the engine's change of speed, wear.
    pub shift_fuel_g: f64,
    /// Largest planned brake force per mass, m/s² (service plus engine brake).
    pub brake_decel_m_s2: f64,
    /// Deceleration at which lower limits and curves are approached at the latest, m/s².
    pub approach_decel_m_s2: f64,
    /// Lateral acceleration that is planned in curves, m/s² (0.15 g, below tank-truck rollover).
    pub lateral_accel_m_s2: f64,
    /// Slack below the cruise-control speed when the minimum speed cannot be held, m/s.
    pub relax_m_s: f64,
    /// Shortest distance of an eco-roll phase, m.
    pub eco_roll_dwell_m: f64,
}

impl Default for Tuning {
    fn default() -> Self {
        Self {
            step_m: 25.0,
            accel_penalty_g_s3_m2: 0.5,
            accel_change_penalty_g_s4_m2: 5.0,
            shift_fuel_g: 2.0,
            brake_decel_m_s2: 2.0,
            approach_decel_m_s2: 0.6,
            lateral_accel_m_s2: 1.5,
            relax_m_s: 1.5,
            eco_roll_dwell_m: 200.0,
        }
    }
}

impl Tuning {
    pub(crate) fn check(&self) -> Result<(), PccError> {
        check("step_m", self.step_m, 1.0, 500.0, "1 to 500 m")?;
        check("accel_penalty_g_s3_m2", self.accel_penalty_g_s3_m2, 0.0, 1e4, "0 to 1e4")?;
        let jerk = self.accel_change_penalty_g_s4_m2;
        check("accel_change_penalty_g_s4_m2", jerk, 0.0, 1e6, "0 to 1e6")?;
        check("shift_fuel_g", self.shift_fuel_g, 0.0, 1e3, "0 to 1000 g")?;
        check("brake_decel_m_s2", self.brake_decel_m_s2, 0.05, 10.0, "0.05 to 10 m/s2")?;
        check("approach_decel_m_s2", self.approach_decel_m_s2, 0.05, 10.0, "0.05 to 10 m/s2")?;
        check("lateral_accel_m_s2", self.lateral_accel_m_s2, 0.1, 10.0, "0.1 to 10 m/s2")?;
        check("relax_m_s", self.relax_m_s, 0.0, 20.0, "0 to 20 m/s")?;
        check("eco_roll_dwell_m", self.eco_roll_dwell_m, 0.0, 1e5, "0 to 1e5 m")
    }
}

/// The profile of a whole road, every `step_m` metres and at its end.
#[must_use]
pub fn profile_of(road: &Road, step_m: f64) -> Vec<ProfilePoint> {
    let step = if step_m.is_finite() { step_m.max(0.5) } else { 10.0 };
    let n = libm::ceil(road.length_m() / step).clamp(1.0, 1e6) as usize;
    let mut points = alloc::vec![ProfilePoint::default(); n + 1];
    road.profile(0.0, road.length_m() / n as f64, &mut points);
    points
}

/// A road at equal steps, with the highest allowed energies.
#[derive(Debug, Clone)]
pub struct Course {
    /// Station of node 0, m.
    pub start_s_m: f64,
    /// Step, m.
    pub h_m: f64,
    /// Mean grade, curvature and wind, per interval.
    pub road: Vec<RoadPiece>,
    /// Highest speed by law and curvature, m/s, per node, before band and braking distance.
    pub limit_m_s: Vec<f64>,
    /// Largest planned brake force per mass, m/s².
    pub brake_m_s2: f64,
}

impl Course {
    /// Samples a profile. Points must increase and span at least one step.
    ///
    /// # Errors
    /// [`PccError`] names the element that is not usable.
    pub fn new(
        profile: &[ProfilePoint],
        limits: &VehicleLimits,
        tuning: &Tuning,
    ) -> Result<Self, PccError> {
        tuning.check()?;
        check_profile(profile)?;
        let start = profile[0].s_m;
        let length = profile[profile.len() - 1].s_m - start;
        let n = libm::round(length / tuning.step_m).max(2.0) as usize;
        if n > MAX_INTERVALS || length < 2.0 {
            return Err(PccError::BadValue {
                quantity: "length of the profile, m".into(),
                value: length,
                why: "2 m to 20000 steps",
            });
        }
        let h = length / n as f64;
        let mut course = Self {
            start_s_m: start,
            h_m: h,
            road: Vec::with_capacity(n),
            limit_m_s: alloc::vec![f64::INFINITY; n + 1],
            brake_m_s2: tuning.brake_decel_m_s2.min(limits.brakes.max_decel_m_s2),
        };
        course.sample_grades(profile);
        course.sample_curves(profile);
        course.sample_wind(profile, &limits.road_load.wind);
        let front = limits.geometry.front_m.clamp(0.0, 50.0);
        let rear = limits.geometry.rear_m().clamp(0.0, 50.0);
        course.sample_limits(profile, front, rear, tuning.lateral_accel_m_s2);
        Ok(course)
    }

    /// Number of intervals.
    #[must_use]
    pub fn n(&self) -> usize {
        self.road.len()
    }

    /// Station of node `k`, m.
    #[must_use]
    pub fn s_m(&self, k: usize) -> f64 {
        self.start_s_m + k as f64 * self.h_m
    }

    /// Length, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.n() as f64 * self.h_m
    }

    fn sample_grades(&mut self, profile: &[ProfilePoint]) {
        // Height is the integral of sin(grade) with grade linear between points.
        let n = self.limit_m_s.len() - 1;
        let mut i = 0;
        let mut height = 0.0;
        let mut last = (self.start_s_m, libm::sin(profile[0].grade_rad));
        let mut previous = 0.0;
        for k in 1..=n {
            let end = if k == n { profile[profile.len() - 1].s_m } else { self.s_m(k) };
            while i + 1 < profile.len() && profile[i + 1].s_m <= end {
                i += 1;
                let here = (profile[i].s_m, libm::sin(profile[i].grade_rad));
                height += (here.0 - last.0) * 0.5 * (here.1 + last.1);
                last = here;
            }
            if end > last.0 && i + 1 < profile.len() {
                let (a, b) = (&profile[i], &profile[i + 1]);
                let f = (end - a.s_m) / (b.s_m - a.s_m);
                let here = (end, libm::sin(a.grade_rad + f * (b.grade_rad - a.grade_rad)));
                height += (here.0 - last.0) * 0.5 * (here.1 + last.1);
                last = here;
            }
            let sin = ((height - previous) / self.h_m).clamp(-0.999, 0.999);
            let cos_grade = libm::sqrt(1.0 - sin * sin);
            self.road.push(RoadPiece { sin_grade: sin, cos_grade, ..RoadPiece::default() });
            previous = height;
        }
    }

    /// Mean square of the curvature, which is linear between points.
    fn sample_curves(&mut self, profile: &[ProfilePoint]) {
        if profile.iter().all(|p| p.curvature_1_m == 0.0) {
            return;
        }
        let squared: Vec<f64> = profile.iter().map(|p| p.curvature_1_m * p.curvature_1_m).collect();
        for (k, mean) in self.means(profile, &squared).into_iter().enumerate() {
            self.road[k].curvature_squared_1_m2 = mean;
        }
    }

    /// Wind against and across the course.
    fn sample_wind(&mut self, profile: &[ProfilePoint], wind: &Wind) {
        if wind.is_calm() {
            return;
        }
        let (head, cross): (Vec<f64>, Vec<f64>) =
            profile.iter().map(|p| wind.on_course(p.heading_rad)).unzip();
        let (head, cross) = (self.means(profile, &head), self.means(profile, &cross));
        for (piece, (head, cross)) in self.road.iter_mut().zip(head.into_iter().zip(cross)) {
            (piece.headwind_m_s, piece.crosswind_m_s) = (head, cross);
        }
    }

    /// Means over the intervals of what is linear between the points of a profile.
    fn means(&self, profile: &[ProfilePoint], values: &[f64]) -> Vec<f64> {
        let (n, mut i) = (self.road.len(), 0);
        let mut last = (self.start_s_m, values[0]);
        let mut out = Vec::with_capacity(n);
        for k in 1..=n {
            let end = if k == n { profile[profile.len() - 1].s_m } else { self.s_m(k) };
            let mut area = 0.0;
            let mut up_to = |here: (f64, f64)| {
                area += (here.0 - last.0) * 0.5 * (here.1 + last.1);
                last = here;
            };
            while i + 1 < profile.len() && profile[i + 1].s_m <= end {
                i += 1;
                up_to((profile[i].s_m, values[i]));
            }
            if i + 1 < profile.len() {
                let f = (end - profile[i].s_m) / (profile[i + 1].s_m - profile[i].s_m);
                up_to((end, values[i] + f * (values[i + 1] - values[i])));
            }
            out.push(area / self.h_m);
        }
        out
    }

    /// A limit holds for the whole truck: from when its front reaches it until its rear leaves it.
    fn sample_limits(&mut self, profile: &[ProfilePoint], front: f64, rear: f64, lateral: f64) {
        let n = self.limit_m_s.len() - 1;
        for w in profile.windows(2) {
            let curvature = w[0].curvature_1_m.abs().max(w[1].curvature_1_m.abs());
            let law = w[0].speed_limit_m_s.min(w[1].speed_limit_m_s);
            let limit = law.min(libm::sqrt(lateral / curvature.max(1e-9)));
            let from = (w[0].s_m - front - self.start_s_m) / self.h_m;
            let to = (w[1].s_m + rear - self.start_s_m) / self.h_m;
            let first = libm::floor(from).max(0.0) as usize;
            let last = (libm::ceil(to).max(0.0) as usize).min(n);
            for k in first..=last {
                self.limit_m_s[k] = self.limit_m_s[k].min(limit);
            }
        }
    }

    /// Highest energies, J/kg, per node: the smaller of law, curve and `cap_m_s`, swept backward so
    /// that every lower limit is reached with no more than the approach deceleration.
    ///
    /// # Errors
    /// [`PccError::BrakesTooWeak`] where the planned brakes cannot hold a limit on a descent.
    pub fn ceiling(
        &self,
        truck: &Truck,
        cap_m_s: f64,
        approach_m_s2: f64,
    ) -> Result<Vec<f64>, PccError> {
        let energy = |v: f64| 0.5 * v * v;
        let mut e: Vec<f64> =
            self.limit_m_s.iter().map(|&v| energy(v.min(cap_m_s).max(MIN_SPEED_M_S))).collect();
        for k in (0..self.n()).rev() {
            let held = self.brake_m_s2 + truck.resistance_m_s2(e[k + 1], &self.road[k]);
            // 0.9: the inertia of rotating parts, and room for the solver's interior.
            let decel = (0.9 * held).min(approach_m_s2);
            if decel <= 0.01 {
                return Err(PccError::BrakesTooWeak {
                    s_m: self.s_m(k),
                    grade_rad: libm::asin(self.road[k].sin_grade),
                    brake_decel_m_s2: self.brake_m_s2,
                });
            }
            e[k] = e[k].min(e[k + 1] + decel * self.h_m);
        }
        Ok(e)
    }
}

fn check_profile(profile: &[ProfilePoint]) -> Result<(), PccError> {
    if profile.len() < 2 || profile.len() > 4_000_000 {
        return Err(PccError::BadShape {
            quantity: "road profile".into(),
            why: format!("{} points, 2 to 4000000 needed", profile.len()),
        });
    }
    for (i, p) in profile.iter().enumerate() {
        check(&format!("profile[{i}].s_m"), p.s_m, -1e9, 1e9, "a finite station")?;
        let g = p.grade_rad;
        check(&format!("profile[{i}].grade_rad"), g, -0.5, 0.5, "-0.5 to 0.5 rad")?;
        let c = p.curvature_1_m;
        check(&format!("profile[{i}].curvature_1_m"), c, -0.2, 0.2, "-0.2 to 0.2 1/m")?;
        let v = p.speed_limit_m_s;
        if v.is_nan() || v < MIN_SPEED_M_S {
            return Err(PccError::BadValue {
                quantity: format!("profile[{i}].speed_limit_m_s"),
                value: v,
                why: "1 m/s or more",
            });
        }
        if i > 0 && p.s_m <= profile[i - 1].s_m {
            return Err(PccError::BadValue {
                quantity: format!("profile[{i}].s_m"),
                value: p.s_m,
                why: "stations must increase strictly",
            });
        }
    }
    Ok(())
}
