//! What is searched, what is taken from the recordings as it is, and the traffic that both make.

use tractrix_core::VehicleClass;

use super::{Lesson, lanes_m};
use crate::native::{Boundary, ClassConfig, TrafficConfig};
use crate::stats::{Quantity, Samples};

/// Searched quantities with their bounds, in the order of [`Knobs`].
pub(super) const BOUNDS: [(&str, f64, f64); 14] = [
    ("max_speed_m_s", 5.0, 40.0),
    ("speed_factor_sigma_frac", 0.01, 0.24),
    ("headway_s", 0.5, 3.0),
    ("min_gap_m", 1.0, 6.0),
    ("accel_m_s2", 0.4, 3.0),
    ("decel_m_s2", 0.8, 4.0),
    ("politeness_frac", 0.0, 1.0),
    ("threshold_m_s2", 0.02, 1.5),
    ("right_bias_m_s2", -0.3, 0.5),
    ("inflow_speed_m_s", 1.0, 35.0),
    ("inflow_sigma_m_s", 0.0, 6.0),
    ("outflow_speed_m_s", 0.5, 35.0),
    ("outflow_sigma_m_s", 0.0, 8.0),
    ("outflow_period_s", 3.0, 25.0),
];
pub(super) type Knobs = [f64; BOUNDS.len()];
/// The last of them belong to the traffic before and beyond the stretch, the others to the drivers.
pub(super) const RIM: usize = 5;
/// The first of them say how somebody follows.
pub(super) const FOLLOWING: usize = 5;
pub(super) const DRIVERS: usize = BOUNDS.len() - RIM;

/// Inflow, density, classes and lengths as measured.
pub(super) fn with_measured_demand(
    base: &TrafficConfig,
    lessons: &[Lesson<'_>],
    measured: &Samples,
) -> TrafficConfig {
    let mut config = base.clone();
    let lanes_m =
        lessons.iter().map(|l| lanes_m(l.road)).sum::<f64>() / lessons.len().max(1) as f64;
    let density_1_km = measured.density_1_km(lanes_m);
    // Demand a little above the measured flow: the queue before the stretch is always there when
    // the flow is set by the congestion beyond it.
    let flow_1_s = 1.05 * measured.flow_1_h(lanes_m) / 3600.0;
    config.spawn_probability = (flow_1_s * config.spawn_interval_s).clamp(0.0, 1.0);
    config.initial_density_1_km = Some(density_1_km.min(120.0));
    // Long enough for the speed beyond the end to reach back over a stretch of a kilometre.
    config.warm_up_s = 150.0;
    let tracks = || lessons.iter().flat_map(|l| &l.recording.tracks);
    let share = |class| {
        tracks().filter(|t| t.class == class).count() as f64 / tracks().count().max(1) as f64
    };
    config.truck_share_frac = share(VehicleClass::Truck);
    config.van_share_frac = share(VehicleClass::Van).min(1.0 - config.truck_share_frac);
    for (class, own) in [
        (VehicleClass::Car, &mut config.car),
        (VehicleClass::Van, &mut config.van),
        (VehicleClass::Truck, &mut config.truck),
    ] {
        let lengths: Vec<f64> = tracks().filter(|t| t.class == class).map(|t| t.length_m).collect();
        if let Some(m) = crate::stats::moments(&lengths) {
            own.length_m = m.mean.clamp(1.0, 40.0);
            own.length_spread_m = (1.7 * m.sigma).min(0.4 * own.length_m);
        }
    }
    config
}

/// Where the search begins: what can be read off the samples.
pub(super) fn guess<'a>(
    start: &TrafficConfig,
    measured: &Samples,
    rims: impl Iterator<Item = &'a Boundary> + Clone,
) -> Knobs {
    let speed = crate::stats::moments(measured.of(Quantity::Speed)).unwrap_or_default();
    let wish = [1.2 * speed.p95, 0.12, start.car.headway_s, start.car.min_gap_m];
    let car = start.car;
    let follow = [car.accel_m_s2, car.decel_m_s2];
    let change = [car.politeness_frac, car.threshold_m_s2, car.right_bias_m_s2];
    let about = |speeds: Vec<f64>| crate::stats::moments(&speeds).unwrap_or(speed);
    let before = about(rims.clone().flat_map(Boundary::inflow_m_s).collect());
    let beyond = about(rims.flat_map(Boundary::outflow_m_s).collect());
    let beyond = [before.mean, before.sigma, beyond.mean, beyond.sigma, 12.0];
    let all: Vec<f64> = wish.into_iter().chain(follow).chain(change).chain(beyond).collect();
    std::array::from_fn(|k| {
        let (_, low, high) = BOUNDS[k];
        all.get(k).copied().unwrap_or(low).clamp(low, high)
    })
}

/// The traffic with these values. Vans and trucks keep their proportions to cars.
pub(super) fn turned(start: &TrafficConfig, knobs: &Knobs) -> TrafficConfig {
    let [max_speed, sigma, headway, gap, accel, decel, rest @ ..] = *knobs;
    let [politeness, threshold, bias, in_speed, in_sigma, out_speed, out_sigma, out_period] = rest;
    let mut config = start.clone();
    let car = start.car;
    let change = |c: &mut ClassConfig| {
        c.speed_factor_sigma_frac = sigma.min(0.24 * c.speed_factor_frac);
        c.headway_s = (c.headway_s * headway / car.headway_s).clamp(0.3, 10.0);
        c.min_gap_m = (c.min_gap_m * gap / car.min_gap_m).clamp(0.5, 20.0);
        c.accel_m_s2 = (c.accel_m_s2 * accel / car.accel_m_s2).clamp(0.1, 6.0);
        c.decel_m_s2 = (c.decel_m_s2 * decel / car.decel_m_s2).clamp(0.3, 5.0);
        (c.politeness_frac, c.threshold_m_s2, c.right_bias_m_s2) = (politeness, threshold, bias);
        c.safe_decel_m_s2 = c.safe_decel_m_s2.min(c.max_decel_m_s2);
    };
    for class in [&mut config.car, &mut config.van, &mut config.truck] {
        change(class);
    }
    config.max_speed_m_s = max_speed;
    config.inflow_speed_m_s = Some(in_speed);
    config.inflow_sigma_m_s = in_sigma;
    config.outflow_speed_m_s = Some(out_speed);
    (config.outflow_sigma_m_s, config.outflow_period_s) = (out_sigma, out_period);
    config
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_corner_of_the_search_is_a_valid_configuration() {
        let start = TrafficConfig::default();
        for high in [false, true] {
            let corner: Knobs =
                std::array::from_fn(|k| if high { BOUNDS[k].2 } else { BOUNDS[k].1 });
            turned(&start, &corner).validate().unwrap();
        }
    }
}
