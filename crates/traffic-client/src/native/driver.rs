//! One driver and vehicle, drawn from the class means.

use driver_models::Idm;
use tractrix_core::{GRAVITY_M_S2, VehicleClass};

use super::config::TrafficConfig;
use super::lanes::NO_LANE;
use crate::philox::{Draws, Stream};

/// What stays the same over a vehicle's life.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Driver {
    pub(crate) idm: Idm,
    /// Multiplies the speed limit, dimensionless.
    pub(crate) limit_factor: f64,
    pub(crate) length_m: f64,
    pub(crate) lane_change_s: f64,
    /// Wheel power over mass, W/kg.
    pub(crate) power_w_kg: f64,
    pub(crate) politeness_frac: f64,
    /// Off-ramp that the vehicle takes, or [`NO_LANE`].
    pub(crate) exit: u16,
    /// Station at which the vehicle leaves the road where no ramp is, m (measured traffic).
    pub(crate) leaves_s_m: f64,
    /// Station at which its front stops and stays, m; infinite: nowhere.
    pub(crate) stop_s_m: f64,
    pub(crate) class: VehicleClass,
}

/// Nobody follows closer than this of their own will, s.
const LEAST_HEADWAY_S: f64 = 0.4;

/// Log-normal with mean 1 and this standard deviation, of a draw with mean 0 and variance 1.
fn log_normal(sigma: f64, draw: f64) -> f64 {
    let variance = libm::log1p(sigma * sigma);
    libm::exp(libm::sqrt(variance) * draw - 0.5 * variance)
}

/// Speed that an emergency vehicle wishes where nobody says another, m/s, and its power, W/kg.
const EMERGENCY_M_S: f64 = 36.1;
const EMERGENCY_W_KG: f64 = 40.0;

impl Driver {
    /// The driver of vehicle number `index`: the same for the same seed, whoever asks and when, and
    /// the same share of trucks. `exits` are the off-ramps ahead, nearest first.
    pub(crate) fn draw(
        config: &TrafficConfig,
        truck_share_frac: f64,
        index: u64,
        exits: impl Iterator<Item = u16>,
    ) -> Self {
        let d = Draws::new(config.seed, Stream::Driver, index);
        let share = d.uniform(0);
        let class = if share < truck_share_frac {
            VehicleClass::Truck
        } else if share < truck_share_frac + config.van_share_frac {
            VehicleClass::Van
        } else {
            VehicleClass::Car
        };
        Self::of_class(config, index, class, exits)
    }

    /// As [`Driver::draw`], of a vehicle whose class is known.
    pub(crate) fn of_class(
        config: &TrafficConfig,
        index: u64,
        class: VehicleClass,
        exits: impl Iterator<Item = u16>,
    ) -> Self {
        let d = Draws::new(config.seed, Stream::Driver, index);
        let c = config.class(class);
        // Bounded by construction: bell() within ±3.47 and spread_frac at most 0.25.
        let about = |mean: f64, number: u32| mean * (1.0 + c.spread_frac * d.bell(number));
        let headway_s = c.headway_s * log_normal(c.headway_sigma_frac, d.bell(2));
        let factor = c.speed_factor_frac + c.speed_factor_sigma_frac * d.bell(1);
        let exit = exits
            .enumerate()
            .find(|(n, _)| d.uniform(100 + *n as u32) < config.exit_share_frac)
            .map_or(NO_LANE, |(_, lane)| lane);
        let mut driver = Self {
            idm: Idm::new(
                config.max_speed_m_s * factor,
                headway_s.max(LEAST_HEADWAY_S),
                about(c.min_gap_m, 3),
                about(c.accel_m_s2, 4),
                about(c.decel_m_s2, 5),
                c.max_decel_m_s2,
            ),
            limit_factor: factor,
            length_m: c.length_m + c.length_spread_m * (2.0 * d.uniform(2) - 1.0),
            lane_change_s: about(c.lane_change_s, 6),
            power_w_kg: about(c.power_w_kg, 7),
            politeness_frac: c.politeness_frac,
            exit,
            leaves_s_m: f64::INFINITY,
            stop_s_m: f64::INFINITY,
            class,
        };
        if class == VehicleClass::Emergency {
            driver.rushes(EMERGENCY_M_S);
        }
        driver
    }

    /// Makes it a driver with right of way: no limit but the speed wished (m/s), in a hurry.
    pub(crate) fn rushes(&mut self, speed_m_s: f64) {
        let idm = &self.idm;
        self.idm = Idm::new(speed_m_s, 1.0, idm.min_gap_m, 2.0, 3.0, idm.max_decel_m_s2);
        (self.limit_factor, self.politeness_frac) = (f64::INFINITY, 0.0);
        self.power_w_kg = self.power_w_kg.max(EMERGENCY_W_KG);
    }

    /// The acceleration that the engine allows, m/s²: `P/(m v) - g (sin θ + f cos θ) - k v²`. It is
    /// negative on a grade that the truck cannot hold. Below 5 m/s the power is not the limit.
    pub(crate) fn power_limit_m_s2(
        &self,
        speed_m_s: f64,
        sin_grade: f64,
        rolling_coeff: f64,
        drag_1_m: f64,
    ) -> f64 {
        self.power_w_kg / speed_m_s.max(5.0)
            - GRAVITY_M_S2 * (sin_grade + rolling_coeff)
            - drag_1_m * speed_m_s * speed_m_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_depends_on_seed_and_number_alone() {
        let c = TrafficConfig::default();
        let a: Vec<_> = (0..50).map(|i| Driver::draw(&c, 0.2, i, [3u16, 4].into_iter())).collect();
        let b: Vec<_> =
            (0..50).rev().map(|i| Driver::draw(&c, 0.2, i, [3u16, 4].into_iter())).collect();
        assert!(a.iter().eq(b.iter().rev()));
        let other = TrafficConfig { seed: 2, ..c };
        assert_ne!(a[0], Driver::draw(&other, 0.2, 0, [3u16, 4].into_iter()));
    }

    #[test]
    fn the_classes_have_their_shares() {
        let c = TrafficConfig::default();
        let n = 20_000;
        let trucks = (0..n)
            .filter(|&i| Driver::draw(&c, 0.2, i, std::iter::empty()).class == VehicleClass::Truck)
            .count();
        assert!((trucks as f64 / n as f64 - 0.2).abs() < 0.01);
    }
}
