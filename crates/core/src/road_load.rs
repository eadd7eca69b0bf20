//! Forces that resist motion, as a planner knows them; the formulas are the plant's as well.
//!
//! ```text
//! F_grade = m g sin(grade)
//! F_roll  = m g cos(grade) (f0 + f1 v) + F_0
//! F_air   = 1/2 rho CdA (1 + k_y |beta|) V^2 cos(beta)   V, beta: air flow relative to the truck
//! F_curve = c (m v^2 kappa)^2                             induced drag of the side forces
//! ```
//! Sources: VECTO air drag model (growth with yaw), ISO 28580 (rolling), Pacejka (induced drag).

use serde::{Deserialize, Serialize};

use crate::GRAVITY_M_S2;

/// Forces that resist motion. What a data sheet does not name is absent (zero).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct RoadLoad {
    /// Total mass, kg (estimate on a real truck).
    pub mass_kg: f64,
    /// Drag area, m².
    pub cd_a_m2: f64,
    /// Air density, kg/m³.
    pub air_density_kg_m3: f64,
    /// Rolling resistance coefficient f0, dimensionless.
    pub rolling_coeff: f64,
    /// Growth of that coefficient with speed f1, s/m.
    #[serde(default)]
    pub rolling_per_speed_s_m: f64,
    /// Force F_0 that always acts against the motion (drag torques, a dragging brake), N.
    #[serde(default)]
    pub constant_drag_n: f64,
    /// Induced drag per side force squared c, 1/N.
    #[serde(default)]
    pub curve_drag_1_n: f64,
    /// Growth of the drag area per radian of air yaw k_y, 1/rad.
    #[serde(default)]
    pub drag_yaw_1_rad: f64,
    /// Wind.
    #[serde(default)]
    pub wind: Wind,
}

/// Wind that is expected: over the ground, and turning with the truck.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Wind {
    /// Blows towards map x, m/s.
    pub to_x_m_s: f64,
    /// Blows towards map y, m/s.
    pub to_y_m_s: f64,
    /// Blows against the truck wherever it goes, m/s.
    pub against_m_s: f64,
    /// Blows to the truck's left wherever it goes, m/s.
    pub to_left_m_s: f64,
}

impl Wind {
    /// Whether no air moves.
    #[must_use]
    pub fn is_calm(&self) -> bool {
        *self == Self::default()
    }

    /// Wind against a course and to its left, m/s.
    #[must_use]
    pub fn on_course(&self, heading_rad: f64) -> (f64, f64) {
        let (along, across) = on_course((self.to_x_m_s, self.to_y_m_s), libm::sincos(heading_rad));
        (self.against_m_s - along, self.to_left_m_s + across)
    }
}

/// A stretch of road as the load sees it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RoadPiece {
    /// Sine of the grade.
    pub sin_grade: f64,
    /// Cosine of the grade.
    pub cos_grade: f64,
    /// Mean square of the curvature, 1/m².
    pub curvature_squared_1_m2: f64,
    /// Wind against the truck, m/s.
    pub headwind_m_s: f64,
    /// Wind across it, m/s.
    pub crosswind_m_s: f64,
}

/// Components of a wind (map frame, blowing towards) along and to the left of a course, m/s, from
/// the course's sine and cosine.
#[inline]
#[must_use]
pub fn on_course(wind_m_s: (f64, f64), (sin, cos): (f64, f64)) -> (f64, f64) {
    (wind_m_s.0 * cos + wind_m_s.1 * sin, wind_m_s.1 * cos - wind_m_s.0 * sin)
}

/// Air yaw, rad, of a flow from ahead and from the side, m/s.
#[must_use]
pub fn air_yaw_rad(head_m_s: f64, cross_m_s: f64) -> f64 {
    if cross_m_s == 0.0 { 0.0 } else { libm::atan2(cross_m_s, head_m_s.abs()) }
}

/// Drag area at an air yaw, m²; `yaw_rad` is its magnitude.
#[inline]
#[must_use]
pub fn area_at_yaw_m2(area_m2: f64, growth_1_rad: f64, yaw_rad: f64) -> f64 {
    area_m2 * (1.0 + growth_1_rad * yaw_rad)
}

/// Air drag, N, of a flow whose speed squared is `flow_m2_s2`; `head` is the cosine of its
/// direction, 1 from ahead.
#[inline]
#[must_use]
pub fn drag_n(density_kg_m3: f64, area_m2: f64, flow_m2_s2: f64, head: f64) -> f64 {
    0.5 * density_kg_m3 * area_m2 * flow_m2_s2 * head
}

/// Air drag, N, positive against forward motion, of a flow from ahead and from the side, m/s.
#[must_use]
pub fn air_drag_n(
    density_kg_m3: f64,
    area_m2: f64,
    growth_1_rad: f64,
    (head_m_s, cross_m_s): (f64, f64),
) -> f64 {
    let beta = air_yaw_rad(head_m_s, cross_m_s);
    let cos_beta = if beta == 0.0 { 1.0 } else { libm::cos(beta) };
    let area = area_at_yaw_m2(area_m2, growth_1_rad, beta.abs());
    let head = if head_m_s < 0.0 { -cos_beta } else { cos_beta };
    drag_n(density_kg_m3, area, head_m_s * head_m_s + cross_m_s * cross_m_s, head)
}

impl RoadLoad {
    /// All forces that resist the motion at a speed, N.
    #[must_use]
    pub fn resistance_n(&self, speed_m_s: f64, road: &RoadPiece) -> f64 {
        self.weighing_n(speed_m_s, road) + self.bound_n(speed_m_s, road)
    }

    /// The part that grows with the mass, N: grade and rolling resistance.
    #[must_use]
    pub fn weighing_n(&self, speed_m_s: f64, road: &RoadPiece) -> f64 {
        let coeff = self.rolling_coeff + self.rolling_per_speed_s_m * speed_m_s.abs();
        self.mass_kg * GRAVITY_M_S2 * (road.sin_grade + coeff * road.cos_grade)
    }

    /// The rest, N: air, curve, and what always acts.
    #[must_use]
    pub fn bound_n(&self, speed_m_s: f64, road: &RoadPiece) -> f64 {
        let flow = (speed_m_s + road.headwind_m_s, road.crosswind_m_s);
        let side = self.mass_kg * speed_m_s * speed_m_s;
        air_drag_n(self.air_density_kg_m3, self.cd_a_m2, self.drag_yaw_1_rad, flow)
            + self.curve_drag_1_n * side * side * road.curvature_squared_1_m2
            + self.constant_drag_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOAD: RoadLoad = RoadLoad {
        mass_kg: 40_000.0,
        cd_a_m2: 6.0,
        air_density_kg_m3: 1.2,
        rolling_coeff: 0.006,
        rolling_per_speed_s_m: 0.0,
        constant_drag_n: 0.0,
        curve_drag_1_n: 0.0,
        drag_yaw_1_rad: 0.0,
        wind: Wind { to_x_m_s: 0.0, to_y_m_s: 0.0, against_m_s: 0.0, to_left_m_s: 0.0 },
    };
    const LEVEL: RoadPiece = RoadPiece {
        sin_grade: 0.0,
        cos_grade: 1.0,
        curvature_squared_1_m2: 0.0,
        headwind_m_s: 0.0,
        crosswind_m_s: 0.0,
    };

    #[test]
    fn each_effect_adds_its_closed_form() {
        let (v, m_g) = (20.0, 40_000.0 * GRAVITY_M_S2);
        let plain = LOAD.resistance_n(v, &LEVEL);
        assert!((plain - (0.006 * m_g + 0.5 * 1.2 * 6.0 * 400.0)).abs() < 1e-9);
        let more = |load: RoadLoad, road: RoadPiece| load.resistance_n(v, &road) - plain;
        let up = RoadPiece { sin_grade: 0.01, ..LEVEL };
        assert!((more(LOAD, up) - 0.01 * m_g).abs() < 1e-9);
        let rolls = RoadLoad { rolling_per_speed_s_m: 1e-5, ..LOAD };
        assert!((more(rolls, LEVEL) - 2e-4 * m_g).abs() < 1e-9);
        let drags = RoadLoad { constant_drag_n: 300.0, ..LOAD };
        assert!((more(drags, LEVEL) - 300.0).abs() < 1e-9);
        let curved = RoadLoad { curve_drag_1_n: 1e-6, ..LOAD };
        let bend = RoadPiece { curvature_squared_1_m2: 1.0 / 9e4, ..LEVEL };
        let side_n: f64 = 40_000.0 * 400.0 / 300.0;
        assert!((more(curved, bend) - 1e-6 * side_n * side_n).abs() < 1e-9);
        let against = RoadPiece { headwind_m_s: 5.0, ..LEVEL };
        assert!((more(LOAD, against) - 0.5 * 1.2 * 6.0 * 225.0).abs() < 1e-9);
    }

    #[test]
    fn a_wind_over_the_ground_turns_with_the_heading() {
        let wind = Wind { to_x_m_s: 3.0, against_m_s: 1.0, ..Wind::default() };
        let (head, cross) = wind.on_course(0.0);
        assert!((head + 2.0).abs() < 1e-12 && cross.abs() < 1e-12, "from behind");
        let (head, cross) = wind.on_course(core::f64::consts::FRAC_PI_2);
        assert!((head - 1.0).abs() < 1e-12 && (cross + 3.0).abs() < 1e-12, "to the right");
    }
}
