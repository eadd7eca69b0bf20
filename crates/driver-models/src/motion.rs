//! Motion of a vehicle over one step.

/// Moves a vehicle by one step of constant acceleration that stops at zero speed: new speed (m/s)
/// and distance (m). The ballistic update (Treiber & Kanagaraj, Physica A 419 (2015) 183).
#[inline]
#[must_use]
pub fn ballistic(speed_m_s: f64, accel_m_s2: f64, dt_s: f64) -> (f64, f64) {
    let v = speed_m_s + accel_m_s2 * dt_s;
    if v < 0.0 {
        let distance =
            if accel_m_s2 < 0.0 { -0.5 * speed_m_s * speed_m_s / accel_m_s2 } else { 0.0 };
        return (0.0, distance);
    }
    (v, (speed_m_s + 0.5 * accel_m_s2 * dt_s) * dt_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_braking_vehicle_stops_where_energy_says_and_never_reverses() {
        let (v, x) = ballistic(1.0, -5.0, 1.0);
        assert_eq!((v, x), (0.0, 0.1));
        assert_eq!(ballistic(0.0, -1.0, 0.1), (0.0, 0.0));
        let (v, x) = ballistic(10.0, 1.0, 2.0);
        assert_eq!((v, x), (12.0, 22.0));
    }
}
