//! Forces that resist motion: rolling, air, grade, curve.
//!
//! ```text
//! F_roll  = m g cos(grade) (f0 + f1 v) k(T)            k: tyre warm-up, 1 when warm
//! F_air   = 1/2 rho CdA (1 + k_y |beta|) V^2 cos(beta)  V, beta: air flow relative to the truck
//! F_side  = 1/2 rho A_side c_side beta V^2              crosswind, a share of it on the tractor, the
//!                                                        rest on the trailer at a point of its own
//! F_grade = m g sin(grade)
//! F_curve = k_c (m a_y)^2 / C                            induced drag of the side forces, C: sum
//! ```
//! Sources: VECTO air drag model (yaw dependence), ISO 28580 (rolling), Hyttinen 2022 (warm-up).

use serde::{Deserialize, Serialize};
use tractrix_core::road_load::{air_drag_n, air_yaw_rad};
pub use tractrix_core::road_load::{area_at_yaw_m2, drag_n, on_course};
use tractrix_core::{GAS_CONSTANT_AIR_J_KG_K, GRAVITY_M_S2};

use crate::bounds::Bounds;
use crate::lateral::BodyForce;

/// The resistance block of a truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResistanceParameters {
    /// Where the figures come from.
    pub source: String,
    /// Rolling resistance coefficient f0, warm tyres.
    pub rolling_coeff: f64,
    /// Growth of the coefficient with speed f1, s/m.
    #[serde(default)]
    pub rolling_per_speed_s_m: f64,
    /// Extra rolling resistance of cold tyres at the start, relative.
    #[serde(default)]
    pub cold_tyre_extra_frac: f64,
    /// Time constant of the tyres' warm-up, s.
    #[serde(default = "warmup_s")]
    pub tyre_warmup_s: f64,
    /// Constant extra force (a dragging brake), N.
    #[serde(default)]
    pub parasitic_force_n: f64,
    /// Factor on the induced drag of the side forces in curves, 1 = as the tyres' slip angles give.
    #[serde(default = "one")]
    pub curve_drag_coeff: f64,
    /// Drag area CdA, m².
    pub drag_area_m2: f64,
    /// Growth of CdA per radian of air yaw, 1/rad.
    pub drag_yaw_1_rad: f64,
    /// Side area times side-force slope, m²/rad.
    pub side_force_area_m2_rad: f64,
    /// Share of the side force that acts on the tractor.
    pub side_force_tractor_frac: f64,
    /// How far behind the trailer's centre of gravity its part of the side force acts, m (a box whose
    /// front edges suck has it further forward than its middle; a payload moves the centre of gravity,
    /// not the box).
    #[serde(default)]
    pub side_force_trailer_behind_cg_m: f64,
    /// Head wind that blows against the truck wherever it goes, m/s (a fault of the map of wind).
    #[serde(default)]
    pub headwind_m_s: f64,
    /// Wind across the truck wherever it goes, m/s, positive blows to the left.
    #[serde(default)]
    pub crosswind_to_left_m_s: f64,
    /// Earth-fixed wind on top of the weather's, blowing towards map x, m/s.
    #[serde(default)]
    pub wind_to_x_m_s: f64,
    /// Earth-fixed wind on top of the weather's, blowing towards map y, m/s.
    #[serde(default)]
    pub wind_to_y_m_s: f64,
}

fn one() -> f64 {
    1.0
}
fn warmup_s() -> f64 {
    1_800.0
}

/// Air flow as the truck feels it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AirFlow {
    /// Component against the direction of travel, m/s.
    pub head_m_s: f64,
    /// Component across, m/s; positive blows to the left.
    pub cross_m_s: f64,
    /// Density, kg/m³.
    pub density_kg_m3: f64,
}

impl AirFlow {
    /// Flow of a wind (map frame, blowing towards) over a truck that drives along `yaw_rad`, plus
    /// a wind that turns with the truck: against it and to its left.
    #[must_use]
    pub fn over(
        speed_m_s: f64,
        yaw_rad: f64,
        wind_m_s: (f64, f64),
        density_kg_m3: f64,
        (headwind_m_s, crosswind_m_s): (f64, f64),
    ) -> Self {
        let (along, across) = if wind_m_s == (0.0, 0.0) {
            (0.0, 0.0)
        } else {
            on_course(wind_m_s, libm::sincos(yaw_rad))
        };
        Self {
            head_m_s: speed_m_s - along + headwind_m_s,
            cross_m_s: across + crosswind_m_s,
            density_kg_m3,
        }
    }

    fn yaw_rad(&self) -> f64 {
        air_yaw_rad(self.head_m_s, self.cross_m_s)
    }

    fn squared(&self) -> f64 {
        self.head_m_s * self.head_m_s + self.cross_m_s * self.cross_m_s
    }
}

/// Density of dry air, kg/m³ (ideal gas).
#[must_use]
pub fn air_density_kg_m3(pressure_pa: f64, temperature_k: f64) -> f64 {
    pressure_pa / (GAS_CONSTANT_AIR_J_KG_K * temperature_k)
}

/// Fall of the standard atmosphere's temperature with altitude, K/m (ISO 2533).
const TEMPERATURE_LAPSE_K_M: f64 = 6.5e-3;
/// Least ratio of temperatures that a climb can lead to: no road reaches it.
const LEAST_RATIO: f64 = 0.5;

/// Temperature, K, and pressure, Pa, of air `climbed_m` above where they are `(temperature_k,
/// pressure_pa)`: the layer of constant lapse of the standard atmosphere (ISO 2533, equation 12).
#[must_use]
pub fn air_above((temperature_k, pressure_pa): (f64, f64), climbed_m: f64) -> (f64, f64) {
    let ratio = (1.0 - TEMPERATURE_LAPSE_K_M * climbed_m / temperature_k).max(LEAST_RATIO);
    let exponent = GRAVITY_M_S2 / (GAS_CONSTANT_AIR_J_KG_K * TEMPERATURE_LAPSE_K_M);
    (temperature_k * ratio, pressure_pa * libm::pow(ratio, exponent))
}

/// Side force of the air, N, positive to the left.
#[inline]
#[must_use]
pub fn side_n(density_kg_m3: f64, area_m2_rad: f64, yaw_rad: f64, flow_m2_s2: f64) -> f64 {
    0.5 * density_kg_m3 * area_m2_rad * yaw_rad * flow_m2_s2
}

/// Rolling resistance, N.
#[inline]
#[must_use]
pub fn rolling_n(mass_kg: f64, cos_grade: f64, coeff: f64, cold: f64) -> f64 {
    mass_kg * GRAVITY_M_S2 * cos_grade * coeff * cold
}

/// Factor on the rolling resistance of tyres of which a share is still cold.
#[inline]
#[must_use]
pub fn cold_factor(extra_frac: f64, cold_frac: f64) -> f64 {
    1.0 + extra_frac * cold_frac
}

/// Component of the weight along the road, N, positive uphill.
#[inline]
#[must_use]
pub fn grade_n(mass_kg: f64, sin_grade: f64) -> f64 {
    mass_kg * GRAVITY_M_S2 * sin_grade
}

impl ResistanceParameters {
    pub(crate) fn violations(&self) -> Vec<String> {
        let mut b = Bounds::of("resistance");
        b.within("rolling_coeff", self.rolling_coeff, 0.0, 0.05);
        b.within("rolling_per_speed_s_m", self.rolling_per_speed_s_m, 0.0, 1e-3);
        b.within("cold_tyre_extra_frac", self.cold_tyre_extra_frac, 0.0, 2.0);
        b.within("tyre_warmup_s", self.tyre_warmup_s, 10.0, 20_000.0);
        b.within("parasitic_force_n", self.parasitic_force_n, 0.0, 50_000.0);
        b.within("curve_drag_coeff", self.curve_drag_coeff, 0.0, 10.0);
        b.within("drag_area_m2", self.drag_area_m2, 0.0, 20.0);
        b.within("drag_yaw_1_rad", self.drag_yaw_1_rad, 0.0, 10.0);
        b.within("side_force_area_m2_rad", self.side_force_area_m2_rad, 0.0, 500.0);
        b.within("side_force_tractor_frac", self.side_force_tractor_frac, 0.0, 1.0);
        let behind_m = self.side_force_trailer_behind_cg_m;
        b.within("side_force_trailer_behind_cg_m", behind_m, -8.0, 8.0);
        b.within("headwind_m_s", self.headwind_m_s, -30.0, 30.0);
        b.within("crosswind_to_left_m_s", self.crosswind_to_left_m_s, -30.0, 30.0);
        b.within("wind_to_x_m_s", self.wind_to_x_m_s, -30.0, 30.0);
        b.within("wind_to_y_m_s", self.wind_to_y_m_s, -30.0, 30.0);
        b.violations
    }

    /// Rolling resistance plus the parasitic force, N, positive; acts against the motion.
    /// `warmth` runs from 0 (cold) to 1 (warm).
    #[must_use]
    pub fn rolling_n(&self, mass_kg: f64, speed_m_s: f64, cos_grade: f64, warmth: f64) -> f64 {
        let coeff = self.rolling_coeff_at(speed_m_s);
        let cold = cold_factor(self.cold_tyre_extra_frac, 1.0 - warmth);
        rolling_n(mass_kg, cos_grade, coeff, cold) + self.parasitic_force_n
    }

    /// Rolling resistance coefficient of warm tyres at a speed.
    #[inline]
    #[must_use]
    pub fn rolling_coeff_at(&self, speed_m_s: f64) -> f64 {
        self.rolling_coeff + self.rolling_per_speed_s_m * speed_m_s.abs()
    }

    /// Induced drag, N, of the side force `m a_y` (lateral acceleration, m/s²) on tyres whose
    /// cornering stiffnesses add up to `stiffness_n_rad`.
    #[must_use]
    pub fn curve_n(&self, mass_kg: f64, lateral_m_s2: f64, stiffness_n_rad: f64) -> f64 {
        let side_n = mass_kg * lateral_m_s2;
        self.curve_drag_1_n(stiffness_n_rad) * side_n * side_n
    }

    /// Induced drag per side force squared, 1/N.
    #[must_use]
    pub fn curve_drag_1_n(&self, stiffness_n_rad: f64) -> f64 {
        self.curve_drag_coeff / stiffness_n_rad.max(1.0)
    }

    /// Air drag, N; positive against forward motion.
    #[must_use]
    pub fn drag_n(&self, air: &AirFlow) -> f64 {
        let flow = (air.head_m_s, air.cross_m_s);
        air_drag_n(air.density_kg_m3, self.drag_area_m2, self.drag_yaw_1_rad, flow)
    }

    /// Side forces of the wind on (tractor, trailer), and their moments about the bodies' centres of
    /// gravity.
    #[must_use]
    pub fn side(&self, air: &AirFlow) -> (BodyForce, BodyForce) {
        let total =
            side_n(air.density_kg_m3, self.side_force_area_m2_rad, air.yaw_rad(), air.squared());
        let (tractor, trailer) =
            (total * self.side_force_tractor_frac, total * (1.0 - self.side_force_tractor_frac));
        let yaw_moment_nm = -self.side_force_trailer_behind_cg_m * trailer;
        (
            BodyForce { side_n: tractor, yaw_moment_nm: 0.0 },
            BodyForce { side_n: trailer, yaw_moment_nm },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A force to the left that acts behind the centre of gravity turns the trailer to the right.
    #[test]
    fn the_trailers_side_force_acts_where_the_file_says() {
        let text = "source = \"a test\"\nrolling_coeff = 0.006\ndrag_area_m2 = 6.0\ndrag_yaw_1_rad = 1.0\n\
            side_force_area_m2_rad = 40.0\nside_force_tractor_frac = 0.25\n";
        let mut r: ResistanceParameters = toml::from_str(text).unwrap();
        let air = AirFlow { head_m_s: 20.0, cross_m_s: 4.0, density_kg_m3: 1.2 };
        let at_cg = r.side(&air);
        r.side_force_trailer_behind_cg_m = 1.5;
        let (tractor, trailer) = r.side(&air);
        assert_eq!((at_cg.0, at_cg.1.yaw_moment_nm), (tractor, 0.0));
        assert_eq!(trailer.side_n, at_cg.1.side_n);
        assert_eq!(trailer.yaw_moment_nm, -1.5 * trailer.side_n);
        assert!(trailer.side_n > 0.0);
    }

    /// Table of ISO 2533: 275.15 K and 79,495 Pa at 2 km, 255.65 K and 54,020 Pa at 5 km.
    #[test]
    fn air_above_sea_level_is_the_standard_atmosphere() {
        for (climbed_m, temperature_k, pressure_pa) in
            [(0.0, 288.15, 101_325.0), (2000.0, 275.15, 79_495.0), (5000.0, 255.65, 54_020.0)]
        {
            let (t, p) = air_above((288.15, 101_325.0), climbed_m);
            assert!((t - temperature_k).abs() < 1e-9, "{t} K at {climbed_m} m");
            assert!((p - pressure_pa).abs() < 5.0, "{p} Pa at {climbed_m} m");
        }
        let (start, end) = ((283.0, 97_000.0), air_above((283.0, 97_000.0), 800.0));
        let back = air_above(end, -800.0);
        assert!((back.0 - start.0).abs() < 1e-9 && (back.1 - start.1).abs() < 1e-6);
    }
}
