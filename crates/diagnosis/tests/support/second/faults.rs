//! What is hidden, by id.

use super::super::effects::{Effect, Shape};

/// The hidden causes with sizes and shapes.
pub(crate) struct Faults(Vec<(&'static str, f64, Shape)>);

impl Faults {
    pub(crate) fn of(hidden: &[Effect]) -> Self {
        let causes = hidden.iter().filter_map(|e| match e {
            Effect::Cause { id, size, shape } => Some((*id, *size, *shape)),
            Effect::Outside { .. } | Effect::SecondOutside { .. } => None,
        });
        Self(causes.collect())
    }

    /// Size and shape of a cause.
    pub(crate) fn get(&self, id: &str) -> Option<(f64, Shape)> {
        self.0.iter().find(|f| f.0 == id).map(|f| (f.1, f.2))
    }

    /// Size of a cause, 0 if it is not there.
    pub(crate) fn size(&self, id: &str) -> f64 {
        self.get(id).map_or(0.0, |f| f.0)
    }
}

/// The truck at one moment, for everything that follows signals.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moment {
    pub(crate) place_m: f64,
    pub(crate) speed: f64,
    pub(crate) grade: f64,
    pub(crate) rpm: f64,
    pub(crate) torque_nm: f64,
    pub(crate) gear: usize,
    pub(crate) pedal: f64,
    pub(crate) stage: f64,
    pub(crate) xbr: f64,
    pub(crate) yaw_rate: f64,
    pub(crate) air_degc: f64,
    pub(crate) altitude_m: f64,
    pub(crate) mass_kg: f64,
}
