//! A small independent truck for closed-loop tests of the planner: it shares no code with it.
//!
//! Longitudinal: torque lag, twelve gears by engine speed with an open phase, retarder, air brakes
//! with dead time and build-up. Lateral: tractor and trailer as two rigid bodies with linear tyres
//! joined at the hitch, written as force sums (not the planner's matrices), integrated at 1 ms.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

pub mod data_sheet;
pub mod traffic;

use core::convert::Infallible;
use road::Road;
use std::collections::VecDeque;
use tractrix_core::{
    Command, EgoState, PowertrainSignals, Scene, Stamped, Time, TrafficSource, Vehicle,
    VehicleLimits,
};

/// What differs between the truck and its data sheet.
#[derive(Debug, Clone, Copy)]
pub struct Misfit {
    pub mass_factor: f64,
    pub stiffness_factor: f64,
}

pub struct Plant<'a> {
    pub road: &'a Road,
    pub sheet: VehicleLimits,
    pub misfit: Misfit,
    pub ego: EgoState,
    pub time: Time,
    pub dt_s: f64,
    trailer_yaw: f64,
    torque: f64,
    retarder: f64,
    brake: f64,
    brake_line: VecDeque<f64>,
    shift_left_s: f64,
    since_shift_s: f64,
    pub command: Command,
}

impl<'a> Plant<'a> {
    pub fn new(road: &'a Road, sheet: VehicleLimits, s_m: f64, d_m: f64, speed: f64) -> Self {
        let at = road.at(s_m, d_m);
        let ego = EgoState {
            x_m: at.x_m,
            y_m: at.y_m,
            yaw_rad: at.heading_rad,
            s_m,
            d_m,
            speed_m_s: speed,
            powertrain: PowertrainSignals { gear: 12, ..Default::default() },
            ..Default::default()
        };
        Self {
            road,
            sheet,
            misfit: Misfit { mass_factor: 1.0, stiffness_factor: 1.0 },
            trailer_yaw: ego.yaw_rad,
            ego,
            time: Time::ZERO,
            dt_s: 0.01,
            torque: 0.0,
            retarder: 0.0,
            brake: 0.0,
            brake_line: VecDeque::new(),
            shift_left_s: 0.0,
            since_shift_s: 10.0,
            command: Command::default(),
        }
    }

    /// Lateral offset of the trailer's axle group from the lane-parallel line at `d_m`.
    pub fn trailer_position(&self) -> (f64, f64) {
        let g = &self.sheet.geometry;
        let (s, c) = self.ego.yaw_rad.sin_cos();
        let (hx, hy) = (self.ego.x_m + g.hitch_ahead_m * c, self.ego.y_m + g.hitch_ahead_m * s);
        let l = g.hitch_to_trailer_axle_m;
        (hx - l * self.trailer_yaw.cos(), hy - l * self.trailer_yaw.sin())
    }

    fn step(&mut self) {
        let steps = (self.dt_s / 0.001).round() as usize;
        for _ in 0..steps {
            self.lateral(0.001);
            self.longitudinal(0.001);
        }
        let p = self.road.project(self.ego.x_m, self.ego.y_m, Some(self.ego.s_m)).unwrap();
        self.ego.s_m = p.s_m;
        self.ego.d_m = p.d_m;
        self.time = self.time.plus_nanos((self.dt_s * 1e9).round() as i64);
    }

    fn longitudinal(&mut self, dt: f64) {
        let p = &self.sheet.powertrain;
        let e = &mut self.ego;
        let v = e.speed_m_s.max(0.0);
        let gear = usize::from(e.powertrain.gear.max(1)) - 1;
        let lever = |g: usize| p.gear_ratios[g] * p.final_drive_ratio / p.wheel_radius_m;
        let n = (v * lever(gear)).max(p.idle_speed_rad_s);
        self.since_shift_s += dt;
        self.shift_left_s = (self.shift_left_s - dt).max(0.0);
        if self.shift_left_s == 0.0 && self.since_shift_s > 2.0 {
            let rpm = n * 9.549_297;
            let change = if rpm < 950.0 && gear > 0 {
                -1
            } else if rpm > 1650.0 && gear < 11 {
                1
            } else {
                0
            };
            if change != 0 {
                e.powertrain.gear = (gear as i32 + 1 + change) as u8;
                self.shift_left_s = p.shift_duration_s;
                self.since_shift_s = 0.0;
            }
        }
        let shifting = self.shift_left_s > 0.0;
        let friction = p.friction_nm.at(n);
        let full = p.full_load_nm.at(n) + friction;
        let wanted = if shifting { 0.0 } else { self.command.accelerator_pedal_frac * full };
        self.torque += (wanted - self.torque) * dt / if shifting { 0.05 } else { 0.3 };
        let eta = p.gear_efficiency_frac[gear];
        let net = self.torque - friction - p.auxiliary_power_w / n;
        let drive = if shifting {
            0.0
        } else if net > 0.0 {
            net * lever(gear) * eta
        } else {
            net * lever(gear) / eta
        };
        let most = p.engine_brake_nm.at(n) * lever(gear) / eta;
        let wanted = if shifting { 0.0 } else { self.command.retarder_frac * most };
        self.retarder += (wanted - self.retarder) * dt / 0.4;
        self.brake_line.push_back(self.command.xbr_decel_m_s2);
        let dead = (self.sheet.brakes.dead_time_s / dt) as usize;
        let asked = if self.brake_line.len() > dead { self.brake_line.pop_front() } else { None };
        let most = self.sheet.brakes.max_decel_m_s2;
        let asked = asked.unwrap_or(0.0).min(most);
        let rate = most / self.sheet.brakes.build_up_s.max(0.05) * dt;
        self.brake += (asked - self.brake).clamp(-2.0 * rate, rate);
        let m = self.sheet.road_load.mass_kg * self.misfit.mass_factor;
        let k = &self.sheet.road_load;
        let slope = self.road.at(e.s_m, 0.0).grade_rad;
        let resist = m * 9.80665 * (slope.sin() + k.rolling_coeff * slope.cos())
            + 0.5 * k.air_density_kg_m3 * k.cd_a_m2 * v * v;
        let rotating = if shifting { p.rotating_mass_neutral_kg } else { p.rotating_mass_kg[gear] };
        let force = drive - self.retarder - m * self.brake - resist;
        e.accel_x_m_s2 = force / (m + rotating);
        e.speed_m_s = (v + e.accel_x_m_s2 * dt).max(0.0);
        e.powertrain.engine_speed_rad_s = n;
        e.powertrain.engine_torque_nm = self.torque;
        e.powertrain.engine_friction_torque_nm = friction;
        e.powertrain.drive_force_n = drive;
        e.powertrain.brake_force_n = m * self.brake;
        e.powertrain.retarder_force_n = self.retarder;
        e.powertrain.shift_in_progress = shifting;
    }

    fn lateral(&mut self, dt: f64) {
        let l = &self.sheet.lateral;
        let g = &self.sheet.geometry;
        let soft = self.misfit.stiffness_factor;
        let e = &mut self.ego;
        let wheel = self.command.steering_wheel_rad / l.steering_ratio;
        e.road_wheel_rad += (wheel - e.road_wheel_rad) * dt / l.steering_lag_s.max(dt);
        let v = e.speed_m_s.max(1.5);
        let (w, wt) = (e.yaw_rate_rad_s, e.trailer.yaw_rate_rad_s);
        let bend = e.yaw_rad - self.trailer_yaw;
        // lateral speed of a tractor point x ahead of the drive axle, and of a trailer point
        let at = |x: f64| e.lateral_speed_m_s + x * w;
        let hitch = at(g.hitch_ahead_m);
        let on_trailer = |behind: f64| hitch - behind * wt + v * bend;
        let tyre = |c: f64, slip: f64| -c * soft * slip;
        let mut f_c = 0.0; // sum of forces on the tractor, and moment about its centre of gravity
        let mut m_c = 0.0;
        let mut push = |x: f64, f: f64| {
            f_c += f;
            m_c += (x - g.cg_ahead_m) * f;
        };
        push(
            g.wheelbase_m,
            tyre(l.steer_stiffness_n_rad, at(g.wheelbase_m) / v - e.road_wheel_rad),
        );
        for x in [l.drive_half_spread_m, -l.drive_half_spread_m] {
            push(x, tyre(0.5 * l.drive_stiffness_n_rad, at(x) / v));
        }
        let (mut f_t, mut m_t) = (0.0, 0.0);
        for x in [-l.trailer_half_spread_m, 0.0, l.trailer_half_spread_m] {
            let behind = g.hitch_to_trailer_axle_m + x;
            let f = tyre(l.trailer_stiffness_n_rad / 3.0, on_trailer(behind) / v);
            f_t += f;
            m_t += (l.trailer_cg_behind_hitch_m - behind) * f;
        }
        // Unknown hitch force h on the tractor (-h on the trailer): the accelerations of the hitch
        // point as seen from both bodies are equal.
        let h_arm = g.hitch_ahead_m - g.cg_ahead_m;
        let t_arm = l.trailer_cg_behind_hitch_m;
        let trailer = l.trailer_mass_kg * self.misfit.mass_factor;
        let inertia = l.trailer_inertia_kg_m2 * self.misfit.mass_factor;
        let free_c = f_c / l.tractor_mass_kg + h_arm * m_c / l.tractor_inertia_kg_m2;
        let free_t = f_t / trailer + t_arm * m_t / inertia;
        let give = 1.0 / l.tractor_mass_kg
            + h_arm * h_arm / l.tractor_inertia_kg_m2
            + 1.0 / trailer
            + t_arm * t_arm / inertia;
        let h = (free_t - free_c) / give;
        let a_cg = (f_c + h) / l.tractor_mass_kg;
        let alpha = (m_c + h_arm * h) / l.tractor_inertia_kg_m2;
        let alpha_t = (m_t - t_arm * h) / inertia;
        e.accel_y_m_s2 = a_cg - g.cg_ahead_m * alpha;
        e.lateral_speed_m_s += (e.accel_y_m_s2 - v * w) * dt;
        e.yaw_rate_rad_s += alpha * dt;
        e.trailer.yaw_rate_rad_s += alpha_t * dt;
        e.yaw_rad += e.yaw_rate_rad_s * dt;
        self.trailer_yaw += e.trailer.yaw_rate_rad_s * dt;
        e.trailer.articulation_rad = self.trailer_yaw - e.yaw_rad;
        let (s, c) = e.yaw_rad.sin_cos();
        e.x_m += (e.speed_m_s * c - e.lateral_speed_m_s * s) * dt;
        e.y_m += (e.speed_m_s * s + e.lateral_speed_m_s * c) * dt;
        e.load_transfer_ratio = e.accel_y_m_s2 / l.rollover_accel_m_s2;
    }
}

impl Vehicle for Plant<'_> {
    type Error = Infallible;
    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, Infallible> {
        while self.time < now {
            self.step();
        }
        Ok(Stamped { time: self.time, value: self.ego })
    }
    fn command(&mut self, _now: Time, command: &Command) -> Result<(), Infallible> {
        self.command = *command;
        Ok(())
    }
    fn limits(&self) -> &VehicleLimits {
        &self.sheet
    }
}

/// Traffic given by a function of time.
pub struct Scripted<F: FnMut(Time, &EgoState) -> Scene>(pub F, pub Scene);

impl<F: FnMut(Time, &EgoState) -> Scene> TrafficSource for Scripted<F> {
    type Error = Infallible;
    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, Infallible> {
        self.1 = (self.0)(now, ego);
        self.1.time = now;
        Ok(&self.1)
    }
}

/// A road without traffic.
pub fn no_traffic() -> Scripted<impl FnMut(Time, &EgoState) -> Scene> {
    Scripted(|_, _| Scene::default(), Scene::default())
}
