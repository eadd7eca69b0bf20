//! What tyres that saturate keep of their cornering stiffness: by the slip that they have, and by the
//! friction ellipse under what the same axle drives or brakes.
//!
//! With them what the same forces do by the angles between the bodies and of the road wheels.
//!
//! A tractor with one drive axle climbs with 1 to 7 % less of it, and without that a payload lay
//! elsewhere (143 nats) or drive tyres were soft (71) beside a hidden drag or mass.

use std::sync::Arc;

use dynamics::TruckParameters;
use dynamics::lateral::{AXLES, GROUP_AXLES, LoadedAxle, YawSideslip};

use super::force::Longitudinal;
use super::inputs::BLOCK;
use super::lateral::{BySpeed, State, plus};
use super::prepared::Prepared;
use super::retarder::retarder_n;
use crate::causes::param::PARAMS;
use crate::{Drive, Plant};

/// Samples over which a change of speed is taken, to either side.
const HALF_SECOND: usize = 10;

/// What is driven and braked at a sample.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Along {
    /// Forces of the engine and of the service brakes at the wheels, N.
    drive_n: f64,
    service_n: f64,
    /// Change of speed and gravity's component along the road, m/s².
    specific_m_s2: f64,
}

/// The truck without what causes put on its forces: those are figures of the balance, which the side
/// forces would only blur.
pub(super) fn as_built(truck: &TruckParameters) -> TruckParameters {
    let mut out = truck.clone();
    (out.engine.friction_scale_coeff, out.engine.engine_brake_scale_coeff) = (1.0, 1.0);
    (out.driveline.loss_scale_coeff, out.driveline.mesh_loss_frac) = (1.0, 0.0);
    out.engine.fan_power_w = 0.0;
    out.brake.gain_scale_coeff = 1.0;
    out
}

/// What is driven and braked at every sample, by the truck as it was built.
pub(super) fn along(d: &Prepared, built: &Plant) -> Vec<Along> {
    let balance = Longitudinal::new(d, built, &[0.0; PARAMS]);
    let mut out = Vec::with_capacity(d.balance.padded);
    for at in (0..d.balance.padded).step_by(BLOCK) {
        let (drive_n, service_n) = (balance.drive_n::<BLOCK>(at), balance.service_n::<BLOCK>(at));
        out.extend((0..BLOCK).map(|j| {
            let i = (at + j).min(d.n - 1);
            let (before, after) = (i.saturating_sub(HALF_SECOND), (i + HALF_SECOND).min(d.n - 1));
            let over_s = (after - before).max(1) as f64 * Drive::STEP_S;
            let change_m_s2 = (d.speed[after] - d.speed[before]) / over_s;
            Along {
                drive_n: drive_n[j],
                service_n: service_n[j],
                specific_m_s2: change_m_s2 + Prepared::gravity_along(d.grade[i]),
            }
        }));
    }
    out
}

/// What acts at one sample.
pub(super) struct Acting {
    /// Accelerations by the tyres' steady side forces per state, by columns.
    pub(super) tyres: [State; 4],
    /// Part of the steer axle's stiffness that follows the road wheels' angle.
    pub(super) steer_frac: f64,
    /// Accelerations per articulation by what pulls and brakes the trailer.
    pub(super) pulled: State,
}

impl Acting {
    /// Tyres of their stiffness alone.
    pub(super) fn of(tyres: [State; 4]) -> Self {
        Self { tyres, steer_frac: 1.0, pulled: [0.0; 4] }
    }
}

/// Tyres that saturate in one loading state.
pub(super) struct Grip<'a> {
    model: &'a YawSideslip,
    along: &'a [Along],
    /// Force of the retarder, N, at the cause's own size.
    retarder_n: Option<Arc<[f64]>>,
    system: &'a BySpeed,
    axles: [LoadedAxle; AXLES],
    /// Loads of the groups, N.
    load_n: [f64; 3],
    /// The tyres of one group alone.
    groups: [BySpeed; 3],
}

impl<'a> Grip<'a> {
    /// `None` where tyres do not saturate; with a retarder of `extra_nm` more per stage.
    pub(super) fn new(
        d: &'a Prepared,
        plant: &Plant,
        extra_nm: f64,
        model: &'a YawSideslip,
        system: &'a BySpeed,
    ) -> Option<Self> {
        let (c, load_n) = (model.stiffness_n_rad, model.axle_load_n);
        let of = |axles: core::ops::Range<usize>| {
            let mut alone = *model;
            alone.stiffness_n_rad =
                core::array::from_fn(|j| if axles.contains(&j) { c[j] } else { 0.0 });
            BySpeed::new(&alone)
        };
        (!d.along.is_empty()).then(|| Self {
            model,
            along: &d.along,
            retarder_n: retarder_n(d, plant, extra_nm),
            system,
            axles: core::array::from_fn(|j| model.law.under_load(c[j], load_n[j], 0.0)),
            load_n: GROUP_AXLES.map(|axles| load_n[axles].iter().sum()),
            groups: GROUP_AXLES.map(of),
        })
    }

    /// What acts at sample `i` in this state, with the road wheels at `angle`, rad.
    #[inline]
    pub(super) fn acting(&self, i: usize, v: f64, s: &State, angle: f64) -> Acting {
        let (along, model) = (&self.along[i.min(self.along.len() - 1)], self.model);
        let slip = model.slip_rad(v, s, angle);
        let per_load = along.service_n / self.load_n.iter().sum::<f64>();
        let [steer_n, braked_n, trailer_n] = self.load_n.map(|load_n| -per_load * load_n);
        let retarder_n = self.retarder_n.as_ref().map_or(0.0, |n| n[i.min(n.len() - 1)]);
        let along_n = [steer_n, along.drive_n + braked_n - retarder_n, trailer_n];
        let mut tyres = [[0.0; 4]; 4];
        let mut front = 1.0;
        for (g, group) in self.groups.iter().enumerate() {
            let middle = GROUP_AXLES[g].start + GROUP_AXLES[g].len() / 2;
            let left = model.law.left_frac(self.load_n[g], along_n[g]);
            let kept = left * self.axles[middle].kept_frac(slip[middle]);
            for (sum, own) in tyres.iter_mut().zip(group.tyres(1.0 / v)) {
                *sum = plus(sum, &own, kept);
            }
            front = if g == 0 { kept } else { front };
        }
        let lever_m = model.trailer_cg_behind_hitch_m;
        let moment_nm = lever_m * (model.trailer_mass_kg * along.specific_m_s2 - trailer_n);
        let [force, moment] = self.system.trailer();
        Acting {
            tyres,
            steer_frac: front + steer_n / model.stiffness_n_rad[0].max(1.0),
            pulled: plus(&force.map(|x| -trailer_n * x), moment, moment_nm),
        }
    }
}

#[cfg(test)]
mod tests {
    use dynamics::lateral::{LateralInputs, LateralModel, LateralState, TyreLaw};

    use super::super::lateral::loaded;
    use super::*;
    use crate::Channel as C;

    /// A truck that climbs, coasts and brakes, by its retarder too, in curves of up to 3 m/s² is replayed
    /// as the truck model drives it; tyres of their stiffness alone are off 20 times as much.
    #[test]
    fn tyres_that_drive_brake_and_slip_are_replayed_as_they_are_simulated() {
        let truck = TruckParameters::load("vecto-40t").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let n = 2_400;
        let wave = |i: usize, period_s: f64| {
            (core::f64::consts::TAU * i as f64 * Drive::STEP_S / period_s).sin()
        };
        let speed = |i: usize| 14.0 + 4.0 * wave(i, 40.0);
        let wheel = |i: usize| 0.6 * wave(i, 13.0);
        let mut drive = Drive::new("curves", 0.0, n);
        drive.reported_mass_kg = Some(truck.lateral.total_mass_kg());
        let gear = 8;
        let per_speed =
            truck.driveline.engine_speed_rad_s(1.0, gear) * tractrix_core::RPM_PER_RAD_S;
        let mut set = |c: C, f: &dyn Fn(usize) -> f64| drive.set(c, (0..n).map(f).collect());
        set(C::SpeedMS, &speed);
        set(C::Gear, &|_| f64::from(gear));
        set(C::EngineSpeedRpm, &|i| per_speed * speed(i));
        set(C::EngineTorquePercent, &|i| if wave(i, 40.0) > 0.0 { 80.0 } else { 0.0 });
        set(C::BrakePressureKpa, &|i| if wave(i, 40.0) < -0.5 { 150.0 } else { 0.0 });
        set(C::EngineBrakeFrac, &|i| if wave(i, 40.0) < -0.2 { 0.6 } else { 0.0 });
        set(C::GradeFrac, &|_| 0.03);
        set(C::SteeringWheelRad, &wheel);
        let d = Prepared::new(&drive, &plant);
        let balance = Longitudinal::new(&d, &plant, &[0.0; PARAMS]);
        let retarder_n = retarder_n(&d, &plant, 0.0).unwrap();
        let loaded = loaded(&d, &plant, &[0.0; PARAMS]);
        let model = LateralModel::new(&loaded).unwrap();
        let load_n = loaded.static_axle_load_n();
        let total_n: f64 = load_n.iter().sum();
        let mut state = LateralState::default();
        let mut logged: [Vec<f64>; 3] = Default::default();
        for i in 0..n {
            let [drive_n] = balance.drive_n::<1>(i);
            let [service_n] = balance.service_n::<1>(i);
            let along_n = core::array::from_fn(|j| {
                let pulls = 0.5 * (drive_n - retarder_n[i]);
                let drives = if GROUP_AXLES[1].contains(&j) { pulls } else { 0.0 };
                drives - service_n * load_n[j] / total_n
            });
            let last = i.min(n - 2);
            let accel_x_m_s2 = (speed(last + 1) - speed(last)) / Drive::STEP_S;
            let part = |from: f64, to: f64, x: f64| from + (to - from) * x;
            for k in 0..10 {
                let x = (f64::from(k) + 0.5) / 10.0;
                let inputs = LateralInputs {
                    speed_m_s: part(speed(i), speed(i + 1), x),
                    accel_x_m_s2,
                    steering_wheel_rad: part(wheel(i), wheel(i + 1), x),
                    grade_rad: 0.03_f64.atan(),
                    axle_longitudinal_force_n: along_n,
                    ..LateralInputs::default()
                };
                if k == 0 {
                    let out = model.outputs(&state, &inputs);
                    logged[0].push(out.yaw_rate_rad_s);
                    logged[1].push(out.trailer_yaw_rate_rad_s);
                    logged[2].push(out.tractor_accel_y_m_s2);
                }
                state = model.step(&state, &inputs, 0.1 * Drive::STEP_S);
            }
        }
        let most_m_s2 = logged[2].iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        assert!((2.0..3.5).contains(&most_m_s2), "{most_m_s2}");
        for (c, x) in [C::YawRateRadS, C::TrailerYawRateRadS, C::AccelYMS2].into_iter().zip(logged)
        {
            drive.set(c, x);
        }
        let off = |plant: &Plant| -> [f64; 3] {
            let d = Prepared::new(&drive, plant);
            let residuals = crate::replay::lateral::residuals(&d, plant, &[0.0; PARAMS]);
            let of = |x: &Vec<f64>| {
                let rows = &x[100..];
                (rows.iter().map(|x| x * x).sum::<f64>() / rows.len() as f64).sqrt()
            };
            core::array::from_fn(|j| of(&residuals[j]))
        };
        let own = off(&plant);
        let mut linear = truck.clone();
        linear.lateral.tyres.law = TyreLaw::Linear;
        let alone = off(&Plant::of_truck(&linear).unwrap());
        for (j, (own, alone)) in own.iter().zip(alone).enumerate() {
            assert!(*own < 0.06 * alone, "{j}: {own} of {alone}");
        }
    }
}
