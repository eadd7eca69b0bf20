//! What holds the truck back on the ground: rolling, cold tyres, a brake that drags, the surface.

use rand_chacha::ChaCha8Rng;

use super::super::effects::Shape;
use super::super::sheet::{Figures, G};

use super::colour::{Colour, towards};
use super::faults::{Faults, Moment};

/// Length over which the surface changes, m, and how much it changes the rolling resistance.
const SURFACE_M: f64 = 350.0;
const SURFACE: f64 = 0.02;

/// Tyres and brakes of one drive.
pub(crate) struct Ground {
    surface: Colour,
    rolling: Option<(f64, Shape)>,
    cold: Option<(f64, Shape)>,
    dragging: Option<(f64, Shape)>,
    /// How warm the tyres are, 0 at the start and 1 in the long run at 20 m/s.
    warmth: f64,
    /// How hot the dragging brake is, 0 to 1.
    heat: f64,
    contact: Colour,
}

impl Ground {
    pub(crate) fn new(faults: &Faults, warm: bool, rng: &mut ChaCha8Rng) -> Self {
        Self {
            surface: Colour::new(SURFACE_M, rng),
            rolling: faults.get("rolling_resistance"),
            cold: faults.get("tyre_warmup").filter(|_| !warm),
            dragging: faults.get("dragging_brake"),
            warmth: 0.0,
            heat: 0.0,
            contact: Colour::new(90.0, rng),
        }
    }

    /// Force against the motion, N.
    pub(crate) fn act(&mut self, f: &Figures, now: &Moment, rng: &mut ChaCha8Rng, dt: f64) -> f64 {
        let v = now.speed;
        let mut c = f.rolling * (1.0 + SURFACE * self.surface.step(v * dt, rng));
        if let Some((x, shape)) = self.rolling {
            // Soft tyres: worse at speed and under load; plainly x at 20 m/s and 40 t.
            let fast = shape.at(0, 0.0, 0.3) * (v / 20.0 * (v / 20.0) - 1.0);
            let heavy = shape.at(1, -0.1, 0.3) * (now.mass_kg / 40e3 - 1.0);
            c += f.rolling * x * (1.0 + fast + heavy);
        }
        if let Some((x, shape)) = self.cold {
            // Heated by their own losses, cooled by the air: slow roads keep them cold.
            let tau = shape.at(0, 700.0, 1900.0);
            let goal = (v / 20.0).powf(shape.at(1, 0.4, 1.0)).min(1.2);
            towards(&mut self.warmth, goal, dt, tau);
            c += 0.0062 * x * (1.0 - self.warmth).max(0.0);
        }
        let mut drag = 0.0;
        if let Some((x, shape)) = self.dragging {
            // The lining expands as it heats, and touches now more, now less.
            towards(&mut self.heat, (v / 20.0).min(1.0), dt, shape.at(0, 200.0, 700.0));
            let grown = 1.0 + shape.at(1, 0.0, 0.3) * (self.heat - 0.6);
            drag = x * grown * (1.0 + 0.1 * self.contact.step(dt, rng));
        }
        let slope = 1.0 / (1.0 + now.grade * now.grade).sqrt();
        now.mass_kg * G * slope * if v > 0.05 { c } else { 0.0 } + drag
    }
}
