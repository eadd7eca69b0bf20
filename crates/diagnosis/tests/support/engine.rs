//! Engine, gearbox and shift schedule of the generator's truck.

use rand_chacha::ChaCha8Rng;

use super::random::{between, normal};
use super::sheet::{AXLE, Figures, GEARS, RADIUS_M, RPM, friction, full_load};

/// Torque ramp down, open, torque ramp up, s.
const PHASES: [f64; 3] = [0.25, 0.45, 0.30];

/// Engine and gearbox.
pub(crate) struct Drivetrain {
    pub(crate) gear: usize,
    pub(crate) rpm: f64,
    /// Indicated torque, Nm.
    pub(crate) indicated_nm: f64,
    /// Time in the present shift, s; `None` in gear.
    shift: Option<f64>,
    durations: [f64; 3],
    goal: usize,
    since_s: f64,
    up_rpm: f64,
    down_rpm: f64,
}

impl Drivetrain {
    pub(crate) fn new(rng: &mut ChaCha8Rng) -> Self {
        Self {
            gear: 1,
            rpm: 600.0,
            indicated_nm: 0.0,
            shift: None,
            durations: PHASES,
            goal: 1,
            since_s: 0.0,
            up_rpm: between(rng, 1240.0, 1320.0),
            down_rpm: between(rng, 1000.0, 1080.0),
        }
    }

    pub(crate) fn shifting(&self) -> bool {
        self.shift.is_some()
    }

    /// Ratio from crank to wheel over the radius, 1/m.
    pub(crate) fn per_m(&self) -> f64 {
        GEARS[self.gear - 1] * AXLE / RADIUS_M
    }

    /// Part of the torque that the clutch passes.
    pub(crate) fn closed(&self) -> f64 {
        let [down, open, up] = self.durations;
        match self.shift {
            None => 1.0,
            Some(t) if t < down => 1.0 - t / down,
            Some(t) if t < down + open => 0.0,
            Some(t) => ((t - down - open) / up).min(1.0),
        }
    }

    fn rpm_in(gear: usize, v: f64) -> f64 {
        v / RADIUS_M * GEARS[gear - 1] * AXLE * RPM
    }

    /// Advances the shift and the engine speed at speed `v`; `extra_s` lengthens shifts.
    pub(crate) fn turn(
        &mut self,
        v: f64,
        pedal: f64,
        slowing: bool,
        extra_s: f64,
        rng: &mut ChaCha8Rng,
        dt: f64,
    ) {
        self.since_s += dt;
        if let Some(t) = self.shift {
            let t = t + dt;
            if t >= self.durations[0] {
                self.gear = self.goal;
            }
            self.shift = (t < self.durations.iter().sum()).then_some(t);
            if self.shift.is_none() {
                self.since_s = 0.0;
            }
        } else if let Some(goal) = self.wish(v, pedal, slowing) {
            self.goal = goal;
            self.shift = Some(0.0);
            let stretch = 1.0 + extra_s + 0.05 * normal(rng);
            self.durations = PHASES.map(|p| p * stretch.max(0.3));
        }
        let turning = Self::rpm_in(self.gear, v).max(600.0);
        if self.closed() > 0.0 || self.shift.is_none() {
            self.rpm = turning;
        } else {
            self.rpm += (turning - self.rpm) * dt / 0.12;
        }
    }

    fn wish(&self, v: f64, pedal: f64, slowing: bool) -> Option<usize> {
        if self.since_s < 1.0 {
            return None;
        }
        let up = if slowing { 1850.0 } else { self.up_rpm + 310.0 * pedal };
        let down = if slowing { self.down_rpm + 250.0 } else { self.down_rpm + 90.0 * pedal };
        if self.rpm > up && self.gear < 12 {
            let mut goal = self.gear + 1;
            while goal < 12 && goal < self.gear + 2 && Self::rpm_in(goal + 1, v) > down + 80.0 {
                goal += 1;
            }
            return (Self::rpm_in(goal, v) > down + 20.0).then_some(goal);
        }
        if self.rpm < down && self.gear > 1 {
            let mut goal = self.gear - 1;
            while goal > 1 && Self::rpm_in(goal, v) < down {
                goal -= 1;
            }
            return (Self::rpm_in(goal, v) < up - 20.0).then_some(goal);
        }
        None
    }

    /// Advances the indicated torque towards what the pedal of a dead time ago demands.
    pub(crate) fn fuel_up(&mut self, f: &Figures, pedal: f64, derate: f64, demand: f64, dt: f64) {
        let full = full_load(self.rpm) * derate;
        let wanted = pedal * (full + friction(self.rpm)) * demand * self.closed();
        let lag = if wanted > self.indicated_nm && self.indicated_nm > f.boost_from * full {
            f.boost_lag_s
        } else {
            0.15
        };
        self.indicated_nm += (wanted - self.indicated_nm) * (1.0 - (-dt / lag.max(0.02)).exp());
    }
}
