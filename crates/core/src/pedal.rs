//! What a pedal asks of the engine: one reading for planner, bus and the truck behind the bus.

use crate::PowertrainLimits;

impl PowertrainLimits {
    /// Indicated torque that a pedal (0 to 1, clamped) asks for at an engine speed, rad/s, in Nm.
    #[must_use]
    pub fn pedal_torque_nm(&self, pedal_frac: f64, engine_speed_rad_s: f64) -> f64 {
        let pedal = pedal_frac.clamp(0.0, 1.0);
        match &self.pedal_map_nm {
            Some(map) => map.at(pedal, engine_speed_rad_s),
            None => pedal * self.most_indicated_nm(engine_speed_rad_s),
        }
    }

    /// The pedal, 0 to 1, that asks for an indicated torque, Nm, at an engine speed, rad/s: the
    /// inverse of [`Self::pedal_torque_nm`]; 0 or 1 where no pedal asks for so little or so much. Of
    /// several pedals that ask for the same it is the lowest.
    #[must_use]
    pub fn pedal_frac(&self, indicated_nm: f64, engine_speed_rad_s: f64) -> f64 {
        if !(indicated_nm > 0.0) {
            return 0.0;
        }
        let Some(map) = &self.pedal_map_nm else {
            let most_nm = self.most_indicated_nm(engine_speed_rad_s).max(1.0);
            return (indicated_nm / most_nm).clamp(0.0, 1.0);
        };
        // Torque is linear in the pedal between two knots of the map
        let mut below: Option<(f64, f64)> = None;
        for &pedal in map.x() {
            let torque_nm = map.at(pedal, engine_speed_rad_s);
            if torque_nm >= indicated_nm {
                return below.map_or(pedal, |(from, from_nm)| {
                    from + (pedal - from) * (indicated_nm - from_nm) / (torque_nm - from_nm)
                });
            }
            below = Some((pedal, torque_nm));
        }
        1.0
    }

    fn most_indicated_nm(&self, engine_speed_rad_s: f64) -> f64 {
        self.full_load_nm.at(engine_speed_rad_s) + self.friction_nm.at(engine_speed_rad_s)
    }
}
