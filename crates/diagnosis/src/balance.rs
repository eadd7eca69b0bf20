//! Energy balance of stretches of driving: what the wheels needed, against what an instrument says
//! that the engine gave.
//!
//! ```text
//! E_wheel = (m + m_rot) (v1² - v0²)/2 + m g dh + sum (F_roll + F_air) v dt + J (w1² - w0²)/2
//! ```
//! No acceleration and no grade is differentiated: only the ends of a window count. F_roll, F_air
//! are those of [`dynamics`]. Valid while the brakes are open; windows are chosen accordingly.

use dynamics::TruckParameters;
use dynamics::effects::resistance::{AirFlow, ResistanceParameters};
use tractrix_core::{GRAVITY_M_S2, RPM_PER_RAD_S};

/// A stretch of driving under power.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EnergyWindow {
    /// Begin, s.
    pub start_s: f64,
    /// Distance of samples, s.
    pub step_s: f64,
    /// Speed, m/s, first and last sample at the window's ends.
    pub speed_m_s: Vec<f64>,
    /// Gain of altitude, m.
    pub climb_m: f64,
    /// Engine speed at the begin and the end, rpm.
    pub engine_rpm: (f64, f64),
}

/// What moves: everything that the wheels' energy depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Mass-equivalent of the wheels, kg.
    pub rotating_mass_kg: f64,
    /// Inertia of the engine, kg m².
    pub engine_inertia_kg_m2: f64,
    /// Density of the air, kg/m³.
    pub density_kg_m3: f64,
    /// Rolling and air resistance.
    pub resistance: ResistanceParameters,
}

impl Body {
    /// The loaded truck of a truck file in air of a density, kg/m³.
    #[must_use]
    pub fn of(truck: &TruckParameters, density_kg_m3: f64) -> Self {
        Self {
            mass_kg: truck.lateral.total_mass_kg(),
            rotating_mass_kg: truck.driveline.rotating_mass_kg(0.0, 0),
            engine_inertia_kg_m2: truck.engine.inertia_kg_m2,
            density_kg_m3,
            resistance: truck.resistance.clone(),
        }
    }

    /// Rolling and air resistance, N, at a speed, m/s, against a head wind, m/s.
    #[must_use]
    pub fn resistance_n(&self, speed_m_s: f64, headwind_m_s: f64) -> f64 {
        let air = AirFlow {
            head_m_s: speed_m_s + headwind_m_s,
            cross_m_s: 0.0,
            density_kg_m3: self.density_kg_m3,
        };
        self.resistance.rolling_n(self.mass_kg, speed_m_s, 1.0, 1.0) + self.resistance.drag_n(&air)
    }
}

impl EnergyWindow {
    /// Duration, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.speed_m_s.len().saturating_sub(1) as f64 * self.step_s
    }

    /// Energy that the wheels needed, J, against a head wind, m/s.
    #[must_use]
    pub fn wheel_energy_j(&self, body: &Body, headwind_m_s: f64) -> f64 {
        let v = &self.speed_m_s;
        let (Some(v0), Some(v1)) = (v.first(), v.last()) else { return 0.0 };
        let power = |v: f64| v * body.resistance_n(v, headwind_m_s);
        let resisted: f64 =
            v.windows(2).map(|w| 0.5 * (power(w[0]) + power(w[1])) * self.step_s).sum();
        let spin = |rpm: f64| 0.5 * body.engine_inertia_kg_m2 * (rpm / RPM_PER_RAD_S).powi(2);
        0.5 * (body.mass_kg + body.rotating_mass_kg) * (v1 * v1 - v0 * v0)
            + body.mass_kg * GRAVITY_M_S2 * self.climb_m
            + resisted
            + spin(self.engine_rpm.1)
            - spin(self.engine_rpm.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_climb_at_constant_speed_needs_weight_times_height_and_the_resistances() {
        let truck = TruckParameters::load("reference").unwrap();
        let body = Body::of(&truck, 1.2);
        let window = EnergyWindow {
            step_s: 1.0,
            speed_m_s: vec![20.0; 31],
            climb_m: 18.0,
            engine_rpm: (1200.0, 1200.0),
            ..EnergyWindow::default()
        };
        let m = body.mass_kg;
        let force = m * GRAVITY_M_S2 * truck.resistance.rolling_coeff
            + 0.5 * 1.2 * truck.resistance.drag_area_m2 * 400.0;
        let expected = m * GRAVITY_M_S2 * 18.0 + 600.0 * force;
        assert!((window.wheel_energy_j(&body, 0.0) / expected - 1.0).abs() < 1e-9);
        assert_eq!(EnergyWindow::default().wheel_energy_j(&body, 0.0), 0.0);
    }
}
