//! Fuel flow of an engine: a Willans line or a measured map, one reading for plant, planner and
//! diagnosis.
//!
//! | symbol | meaning |
//! |---|---|
//! | T_ind | indicated (gas) torque, Nm; zero exactly when nothing is injected |
//! | T_f | friction torque, Nm, positive |
//! | T = T_ind - T_f | brake torque at the flywheel, auxiliaries not yet taken, Nm |

use serde::{Deserialize, Serialize};

use crate::{Curve, Grid};

/// Revolutions per minute in one rad/s.
pub const RPM_PER_RAD_S: f64 = 9.549_296_585_513_72;

/// Extra consumption at low load: a factor on the fuel flow that fades out with indicated power.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LowLoadFuel {
    /// Extra at no load, relative; 0: there is none.
    pub extra_frac: f64,
    /// Indicated power at which it has faded out, kW.
    pub fades_out_kw: f64,
}

impl Default for LowLoadFuel {
    fn default() -> Self {
        Self { extra_frac: 0.0, fades_out_kw: 80.0 }
    }
}

impl LowLoadFuel {
    /// Factor on the fuel flow at an indicated power, kW.
    #[inline]
    #[must_use]
    pub fn factor(&self, indicated_kw: f64) -> f64 {
        1.0 + self.extra_frac * (1.0 - indicated_kw / self.fades_out_kw).max(0.0)
    }
}

/// Fuel mass flow from engine speed and torque: one figure for plant, planner and diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum FuelModel {
    /// Willans line on indicated power: `constant + per_rpm n + per_kw P_ind`.
    Willans {
        /// Constant part, g/s.
        constant_g_s: f64,
        /// Part per engine speed, g/s per rpm.
        per_rpm_g_s: f64,
        /// Part per indicated power, g/s per kW.
        per_kw_g_s: f64,
        /// Extra at low load.
        #[serde(default)]
        low_load: LowLoadFuel,
    },
    /// Flow as measured on a test bench, over speed and brake torque.
    Map {
        /// g/s over (engine speed rad/s, brake torque Nm); the torque axis begins at zero.
        flow_g_s: Grid,
        /// Friction torque of that engine over speed (rad/s), Nm, positive: brake torque is the
        /// indicated torque less this.
        friction_nm: Curve,
        /// Extra at low load.
        #[serde(default)]
        low_load: LowLoadFuel,
    },
}

impl FuelModel {
    /// Fuel flow, g/s, at an engine speed and an indicated (gas) torque. Zero when nothing is
    /// injected.
    ///
    /// A map is bilinear. Between fuel cut-off (no indicated torque) and the map's first row (no
    /// brake torque) the flow rises linearly from zero; above the last row it goes on with the
    /// slope of the last interval; beyond the ends of the speed axis the flow per revolution is
    /// that at the end.
    #[must_use]
    pub fn rate_g_s(&self, speed_rad_s: f64, indicated_nm: f64) -> f64 {
        if indicated_nm <= 0.0 {
            return 0.0;
        }
        let indicated_kw = indicated_nm * speed_rad_s * 1e-3;
        let (flow, low_load) = match self {
            Self::Willans { constant_g_s, per_rpm_g_s, per_kw_g_s, low_load } => (
                constant_g_s
                    + per_rpm_g_s * speed_rad_s * RPM_PER_RAD_S
                    + per_kw_g_s * indicated_nm * speed_rad_s * 1e-3,
                low_load,
            ),
            Self::Map { flow_g_s, friction_nm, low_load } => {
                let friction_nm = friction_nm.at(speed_rad_s);
                let brake_nm = indicated_nm - friction_nm;
                let flow = if brake_nm >= 0.0 {
                    mapped_g_s(flow_g_s, speed_rad_s, brake_nm)
                } else {
                    mapped_g_s(flow_g_s, speed_rad_s, 0.0) * (indicated_nm / friction_nm)
                };
                (flow, low_load)
            }
        };
        flow * low_load.factor(indicated_kw)
    }
}

/// Flow of a map at a brake torque that is not negative, g/s.
fn mapped_g_s(flow_g_s: &Grid, speed_rad_s: f64, brake_nm: f64) -> f64 {
    let (speeds, torques) = (flow_g_s.x(), flow_g_s.y());
    let within = speed_rad_s.clamp(speeds[0], speeds[speeds.len() - 1]);
    let flow = match *torques {
        [.., before, last] if brake_nm > last => {
            let at_last = flow_g_s.at(within, last);
            let slope = (at_last - flow_g_s.at(within, before)) / (last - before);
            at_last + slope * (brake_nm - last)
        }
        _ => flow_g_s.at(within, brake_nm),
    };
    if within == speed_rad_s { flow } else { flow * (speed_rad_s / within) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    /// A made-up engine: flow = w (40 + T) 5e-5, so bilinear in w and T; friction 100 Nm.
    fn model(low_load: LowLoadFuel) -> FuelModel {
        let (w, t) = (vec![60.0, 120.0, 200.0], vec![0.0, 500.0, 2_000.0]);
        let z = w.iter().flat_map(|w| t.iter().map(move |t| w * (40.0 + t) * 5e-5)).collect();
        FuelModel::Map {
            flow_g_s: Grid::new("flow", w, t, z).unwrap(),
            friction_nm: Curve::constant(100.0),
            low_load,
        }
    }

    #[test]
    fn a_map_gives_its_law_inside_and_beyond_its_grid() {
        let m = model(LowLoadFuel::default());
        for (w, brake) in
            [(60.0, 0.0), (90.0, 250.0), (200.0, 2_000.0), (150.0, 2_600.0), (30.0, 300.0)]
        {
            let want = w * (40.0 + brake) * 5e-5;
            let got = m.rate_g_s(w, brake + 100.0);
            assert!((got - want).abs() < 1e-9, "{w} rad/s {brake} Nm: {got} for {want}");
        }
    }

    #[test]
    fn flow_is_continuous_and_rises_from_cut_off_over_idling_to_load() {
        let m = model(LowLoadFuel::default());
        assert_eq!(m.rate_g_s(120.0, 0.0), 0.0);
        assert_eq!(m.rate_g_s(120.0, -50.0), 0.0);
        let mut last = 0.0;
        for i in 1..4_000 {
            let flow = m.rate_g_s(120.0, 0.5 * f64::from(i));
            assert!(flow > last && flow - last < 0.5 * 120.0 * 5.1e-5, "at {i}");
            last = flow;
        }
    }

    #[test]
    fn the_low_load_extra_acts_on_map_and_line_alike() {
        let extra = LowLoadFuel { extra_frac: 0.2, fades_out_kw: 50.0 };
        let line = |low_load| FuelModel::Willans {
            constant_g_s: 0.05,
            per_rpm_g_s: 1e-4,
            per_kw_g_s: 0.05,
            low_load,
        };
        for (with, without) in [
            (model(extra), model(LowLoadFuel::default())),
            (line(extra), line(LowLoadFuel::default())),
        ] {
            let ratio = |nm| with.rate_g_s(100.0, nm) / without.rate_g_s(100.0, nm);
            assert!((ratio(250.0) - 1.1).abs() < 1e-12, "25 of 50 kW is half the extra");
            assert!((ratio(500.0) - 1.0).abs() < 1e-12);
            assert!((ratio(900.0) - 1.0).abs() < 1e-12);
        }
    }
}
