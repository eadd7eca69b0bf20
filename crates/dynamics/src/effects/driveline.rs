//! Clutch, gearbox, final drive, wheels: torque to force, efficiencies, rotating masses.
//!
//! With the clutch closed the engine turns with the wheels, `omega_e = v i_g i_0 / r`, and
//! `F = T_net i_g i_0 / r * eta` when it drives, `/ eta` when it brakes; the rotating masses act
//! as `(J_w + J_e (i_g i_0)^2) / r^2`. With the clutch slipping the engine is a separate inertia
//! and the clutch passes its capacity.

use serde::{Deserialize, Serialize};

use crate::bounds::Bounds;

/// The driveline block of a truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrivelineParameters {
    /// Where the figures come from.
    pub source: String,
    /// Gearbox ratios, first gear first.
    pub gear_ratios: Vec<f64>,
    /// Final drive ratio.
    pub final_drive_ratio: f64,
    /// Efficiency of the gearbox, 0 to 1.
    pub gearbox_efficiency_frac: f64,
    /// Efficiency of the final drive, 0 to 1.
    pub axle_efficiency_frac: f64,
    /// Factor on the driveline's losses, 1 = as given.
    #[serde(default = "one")]
    pub loss_scale_coeff: f64,
    /// Share of the power that the gears lose on top whose teeth carry it: all but the direct one, whose
    /// ratio is 1 and which passes the shaft straight through.
    #[serde(default)]
    pub mesh_loss_frac: f64,
    /// Dynamic wheel radius, m.
    pub wheel_radius_m: f64,
    /// Inertia of all wheels, kg m².
    pub wheel_inertia_kg_m2: f64,
    /// Largest torque of the clutch, Nm.
    pub clutch_torque_nm: f64,
    /// Time to close the clutch on launch, s.
    pub clutch_closing_s: f64,
    /// Time from the pedal to the clutch's touch point on launch, s.
    #[serde(default)]
    pub clutch_delay_s: f64,
    /// Engine speed at which the clutch opens whatever the pedal, rpm; none = a controlled clutch,
    /// which opens above idle speed under a released pedal and slips at it under power.
    #[serde(default)]
    pub clutch_opens_rpm: Option<f64>,
    /// Gear for pulling away.
    pub launch_gear: u8,
    /// Secondary retarder: largest torque at the propeller shaft, Nm.
    #[serde(default)]
    pub retarder_torque_nm: f64,
    /// Secondary retarder: largest power, W.
    #[serde(default)]
    pub retarder_power_w: f64,
    /// Lag of the retarder, s.
    #[serde(default = "retarder_lag_s")]
    pub retarder_lag_s: f64,
    /// Retarder torque at the propeller shaft that acts although nobody asked for it while the
    /// accelerator is released, Nm.
    #[serde(default)]
    pub hidden_retarder_torque_nm: f64,
    /// Speed from which it acts, m/s.
    #[serde(default = "hidden_retarder_from_m_s")]
    pub hidden_retarder_from_m_s: f64,
    /// The same of a retarder that holds the truck on descents alone, Nm.
    #[serde(default)]
    pub hidden_retarder_downhill_nm: f64,
    /// Descent from which it acts.
    #[serde(default)]
    pub hidden_retarder_from_descent_frac: f64,
}

/// Pedal below which the accelerator counts as released.
pub const RELEASED_PEDAL_FRAC: f64 = 0.01;

/// A ratio this close to 1 is that of a direct gear.
const DIRECT_WITHIN: f64 = 1e-3;

/// Share of a torque that acts from a speed on, rising over one metre per second about it (own form:
/// a controller switches, a fit needs a slope).
#[must_use]
#[inline]
pub fn from_speed_frac(speed_m_s: f64, from_m_s: f64) -> f64 {
    (0.5 + speed_m_s - from_m_s).clamp(0.0, 1.0)
}

/// Share of a torque that acts from a descent on, rising over 0.4 % of grade about it (own form, as by
/// speed).
#[must_use]
#[inline]
pub fn from_descent_frac(descent_frac: f64, from_frac: f64) -> f64 {
    (0.5 + (descent_frac - from_frac) / 0.004).clamp(0.0, 1.0)
}

fn hidden_retarder_from_m_s() -> f64 {
    8.0
}

fn one() -> f64 {
    1.0
}
fn retarder_lag_s() -> f64 {
    0.6
}

/// Wheel force of a loss-free one, N: losses take from what drives and add to what brakes.
#[inline]
#[must_use]
pub fn with_losses_n(loss_free_n: f64, efficiency_frac: f64) -> f64 {
    if loss_free_n > 0.0 { loss_free_n * efficiency_frac } else { loss_free_n / efficiency_frac }
}

/// Efficiency of a gear whose teeth carry the share `in_mesh` of the power (direct: none, others: all).
#[inline]
#[must_use]
pub fn with_mesh_loss(direct_efficiency_frac: f64, mesh_loss_frac: f64, in_mesh: f64) -> f64 {
    direct_efficiency_frac * (1.0 - mesh_loss_frac * in_mesh)
}

impl DrivelineParameters {
    pub(crate) fn violations(&self) -> Vec<String> {
        let mut b = Bounds::of("driveline");
        let n = self.gear_ratios.len();
        b.require((1..=18).contains(&n), format!("gear_ratios: {n} gears, 1 to 18 are possible"));
        let falling = self.gear_ratios.windows(2).all(|w| w[1] < w[0]);
        b.require(falling, "gear_ratios must fall from gear to gear".into());
        for &r in &self.gear_ratios {
            b.within("gear_ratios", r, 0.3, 30.0);
        }
        b.within("final_drive_ratio", self.final_drive_ratio, 1.0, 10.0);
        b.within("gearbox_efficiency_frac", self.gearbox_efficiency_frac, 0.5, 1.0);
        b.within("axle_efficiency_frac", self.axle_efficiency_frac, 0.5, 1.0);
        b.within("loss_scale_coeff", self.loss_scale_coeff, 0.0, 5.0);
        b.within("mesh_loss_frac", self.mesh_loss_frac, -0.05, 0.3);
        b.within("wheel_radius_m", self.wheel_radius_m, 0.2, 1.0);
        b.within("wheel_inertia_kg_m2", self.wheel_inertia_kg_m2, 0.0, 2_000.0);
        b.within("clutch_torque_nm", self.clutch_torque_nm, 100.0, 20_000.0);
        b.within("clutch_closing_s", self.clutch_closing_s, 0.05, 10.0);
        b.within("clutch_delay_s", self.clutch_delay_s, 0.0, 5.0);
        b.within("clutch_opens_rpm", self.clutch_opens_rpm.unwrap_or(600.0), 200.0, 1_500.0);
        b.within("launch_gear", f64::from(self.launch_gear), 1.0, n.max(1) as f64);
        b.within("retarder_torque_nm", self.retarder_torque_nm, 0.0, 10_000.0);
        b.within("retarder_power_w", self.retarder_power_w, 0.0, 1e6);
        b.within("retarder_lag_s", self.retarder_lag_s, 0.005, 5.0);
        b.within("hidden_retarder_torque_nm", self.hidden_retarder_torque_nm, 0.0, 5_000.0);
        b.within("hidden_retarder_from_m_s", self.hidden_retarder_from_m_s, 1.0, 25.0);
        let (downhill_nm, from) =
            (self.hidden_retarder_downhill_nm, self.hidden_retarder_from_descent_frac);
        b.within("hidden_retarder_downhill_nm", downhill_nm, 0.0, 5_000.0);
        b.within("hidden_retarder_from_descent_frac", from, 0.0, 0.1);
        b.violations
    }

    /// Ratio engine to wheel in a gear (1-based); zero in neutral or outside the box.
    #[must_use]
    pub fn total_ratio(&self, gear: u8) -> f64 {
        let i = usize::from(gear).wrapping_sub(1);
        self.gear_ratios.get(i).map_or(0.0, |g| g * self.final_drive_ratio)
    }

    /// Efficiency engine to wheel in a gear (1-based).
    #[must_use]
    pub fn efficiency_frac(&self, gear: u8) -> f64 {
        let in_mesh = f64::from(u8::from(!self.is_direct(gear)));
        let direct = self.direct_efficiency_frac();
        with_mesh_loss(direct, self.mesh_loss_frac, in_mesh).clamp(0.05, 1.0)
    }

    /// Efficiency engine to wheel without what gears lose whose teeth carry the power.
    #[must_use]
    pub fn direct_efficiency_frac(&self) -> f64 {
        let loss = 1.0 - self.gearbox_efficiency_frac * self.axle_efficiency_frac;
        (1.0 - self.loss_scale_coeff * loss).clamp(0.05, 1.0)
    }

    /// Whether a gear passes the shaft straight through.
    #[must_use]
    pub fn is_direct(&self, gear: u8) -> bool {
        let i = usize::from(gear).wrapping_sub(1);
        self.gear_ratios.get(i).is_some_and(|r| (r - 1.0).abs() < DIRECT_WITHIN)
    }

    /// The highest gear.
    #[must_use]
    pub fn top_gear(&self) -> u8 {
        self.gear_ratios.len() as u8
    }

    /// Wheel force of a crank torque through a gear, N.
    #[must_use]
    pub fn force_n(&self, crank_nm: f64, gear: u8) -> f64 {
        let raw = crank_nm * self.total_ratio(gear) / self.wheel_radius_m;
        with_losses_n(raw, self.efficiency_frac(gear))
    }

    /// Engine speed with the clutch closed, rad/s.
    #[must_use]
    pub fn engine_speed_rad_s(&self, speed_m_s: f64, gear: u8) -> f64 {
        speed_m_s * self.total_ratio(gear) / self.wheel_radius_m
    }

    /// Rotating masses felt at the wheels, kg; `gear` 0 = driveline open.
    #[must_use]
    pub fn rotating_mass_kg(&self, engine_inertia_kg_m2: f64, gear: u8) -> f64 {
        let i = self.total_ratio(gear);
        (self.wheel_inertia_kg_m2 + engine_inertia_kg_m2 * i * i)
            / (self.wheel_radius_m * self.wheel_radius_m)
    }

    /// Largest retarder torque at the propeller shaft at a speed, Nm.
    #[must_use]
    pub fn retarder_limit_nm(&self, speed_m_s: f64) -> f64 {
        let shaft_rad_s = speed_m_s.abs() * self.final_drive_ratio / self.wheel_radius_m;
        self.retarder_torque_nm.min(self.retarder_power_w / shaft_rad_s.max(1.0))
            * (shaft_rad_s / 40.0).min(1.0)
    }

    /// One step of the retarder's torque towards its target, Nm.
    #[must_use]
    pub fn retarder_step_nm(&self, torque_nm: f64, target_nm: f64, dt_s: f64) -> f64 {
        torque_nm + (target_nm - torque_nm) * (dt_s / self.retarder_lag_s).min(1.0)
    }

    /// Torque of the hidden retarders at a speed, a pedal and a descent (rise over run, positive
    /// downhill), Nm. That of descents needs shafts that turn; that its oil fills within tenths of a second
    /// is left out.
    #[must_use]
    pub fn hidden_retarder_nm(
        &self,
        speed_m_s: f64,
        accelerator_pedal_frac: f64,
        descent_frac: f64,
    ) -> f64 {
        if accelerator_pedal_frac >= RELEASED_PEDAL_FRAC {
            return 0.0;
        }
        let coasting = from_speed_frac(speed_m_s, self.hidden_retarder_from_m_s);
        let descending = from_descent_frac(descent_frac, self.hidden_retarder_from_descent_frac)
            * speed_m_s.clamp(0.0, 1.0);
        self.hidden_retarder_torque_nm * coasting + self.hidden_retarder_downhill_nm * descending
    }

    /// Wheel force of a torque at the propeller shaft, N.
    #[must_use]
    pub fn shaft_force_n(&self, shaft_nm: f64) -> f64 {
        shaft_nm * self.final_drive_ratio / self.wheel_radius_m
    }
}

#[cfg(test)]
mod tests {
    use crate::TruckParameters;

    /// A countershaft gearbox carries the power by two pairs of teeth in all gears but the direct one.
    #[test]
    fn teeth_lose_in_all_gears_but_the_direct_one() {
        let truck = TruckParameters::load("reference").unwrap();
        let worn = truck.with_parameter("driveline.mesh_loss_frac", 0.02).unwrap();
        let (own, d) = (&truck.driveline, &worn.driveline);
        let direct = d.top_gear();
        assert!(d.is_direct(direct) && !d.is_direct(direct - 1) && !d.is_direct(0));
        assert_eq!(d.efficiency_frac(direct), own.efficiency_frac(direct));
        for gear in 1..direct {
            let kept = d.efficiency_frac(gear) / own.efficiency_frac(gear);
            assert!((kept - 0.98).abs() < 1e-12);
            // Driving takes, braking adds.
            assert!((d.force_n(500.0, gear) / own.force_n(500.0, gear) - 0.98).abs() < 1e-12);
            assert!(
                (d.force_n(-500.0, gear) / own.force_n(-500.0, gear) - 1.0 / 0.98).abs() < 1e-12
            );
        }
    }
}
