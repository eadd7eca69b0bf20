//! What is searched, what is known of it beforehand, and the traffic that it makes.

use tractrix_core::VehicleClass;

use super::{Lesson, MacroscopicState, lanes_m};
use crate::native::{Boundary, ClassConfig, TrafficConfig};
use crate::stats::moments;

/// A searched quantity with what published calibrations say of it.
#[derive(Clone, Copy)]
pub(super) struct Knob {
    /// Key in the configuration, of cars.
    pub(super) key: &'static str,
    /// Usual value.
    usual: f64,
    /// Standard deviation: of the logarithm where `is_ratio`, else of the value.
    sigma: f64,
    is_ratio: bool,
}

/// Free traffic begins with the measured density and settles for so long, s: longer, and it would
/// forget a jam that the stretch began with and that neither end shows.
const WARM_UP_S: f64 = 20.0;

/// Of the speed that vehicles on the stretch lack of that at both ends, on average, so much is made
/// up of those that stand, and the rest of those that brake and pull away. All of it leaves too many
/// standing.
const STANDS_FRAC: f64 = 0.7;

/// Slowest speed of these drivers behind another one, m/s: that of a car in first gear at idle, about
/// 5 km/h. With 1 or 2 m/s held-back recordings are nearly as close; creeping, they are not.
const CREEP_M_S: f64 = 1.5;

/// Search goes this many standard deviations to either side of the usual value.
const REACH: f64 = 3.0;

const fn ratio(key: &'static str, usual: f64, sigma: f64) -> Knob {
    Knob { key, usual, sigma, is_ratio: true }
}

const fn value(key: &'static str, usual: f64, sigma: f64) -> Knob {
    Knob { key, usual, sigma, is_ratio: false }
}

/// The drivers. Following: IDM calibrations to trajectories (Kesting & Treiber, Transp. Res. Record
/// 2088 (2008) 148: T 1.0 to 1.6 s, s0 1.5 to 3 m, a 0.8 to 2.4 m/s², b 0.7 to 1.9 m/s²; Punzo,
/// Montanino, Ciuffo, IEEE T-ITS 16 (2015) 184; Kurtc, Transp. Res. Record 2674 (2020) 813, highD).
/// Changing: Kesting, Treiber, Helbing (2007). Desired speeds: HCM 6th ed., free-flow speeds.
pub(super) const POPULATION: [Knob; 10] = [
    ratio("max_speed_m_s", 27.0, 0.25),
    ratio("speed_factor_sigma_frac", 0.1, 0.3),
    ratio("headway_s", 1.25, 0.25),
    ratio("headway_sigma_frac", 0.45, 0.2),
    ratio("min_gap_m", 2.0, 0.25),
    ratio("accel_m_s2", 1.2, 0.4),
    ratio("decel_m_s2", 1.7, 0.3),
    value("politeness_frac", 0.35, 0.1),
    ratio("threshold_m_s2", 0.15, 0.5),
    value("right_bias_m_s2", 0.1, 0.1),
];

/// How many of them say how somebody follows; they come first.
const FOLLOWING: usize = 7;

/// How measured flow and speeds at both ends become a boundary of free traffic.
const RIM: [Knob; 4] = [
    ratio("spawn_probability", 1.1, 0.1),
    ratio("inflow_sigma_m_s", 1.0, 0.3),
    ratio("outflow_sigma_m_s", 1.0, 0.3),
    ratio("outflow_period_s", 10.0, 0.3),
];

/// Free traffic: how its drivers follow, and its rim.
pub(super) const FREE: [Knob; FOLLOWING + RIM.len()] = {
    let [a, b, c, d, e, f, g, ..] = POPULATION;
    let [h, i, j, k] = RIM;
    [a, b, c, d, e, f, g, h, i, j, k]
};

impl Knob {
    /// Bounds of the search.
    pub(super) fn bounds(&self) -> (f64, f64) {
        if self.is_ratio {
            let factor = libm::exp(REACH * self.sigma);
            (self.usual / factor, self.usual * factor)
        } else {
            (self.usual - REACH * self.sigma, self.usual + REACH * self.sigma)
        }
    }

    /// How unusual a value is, in standard deviations.
    pub(super) fn unusual(&self, x: f64) -> f64 {
        let away = if self.is_ratio { libm::log(x / self.usual) } else { x - self.usual };
        away / self.sigma
    }
}

/// Bounds of knobs.
pub(super) fn bounds<const N: usize>(knobs: &[Knob; N]) -> [(f64, f64); N] {
    std::array::from_fn(|k| knobs[k].bounds())
}

/// Usual values of knobs.
pub(super) fn usual<const N: usize>(knobs: &[Knob; N]) -> [f64; N] {
    std::array::from_fn(|k| knobs[k].usual)
}

/// Mean square of how unusual values are.
pub(super) fn unusual<const N: usize>(knobs: &[Knob; N], values: &[f64; N]) -> f64 {
    let squares = knobs.iter().zip(values).map(|(k, &x)| k.unusual(x) * k.unusual(x));
    squares.sum::<f64>() / N as f64
}

/// Traffic with this population. Vans and trucks keep their proportions to cars.
pub(super) fn with_population(
    base: &TrafficConfig,
    values: &[f64; POPULATION.len()],
) -> TrafficConfig {
    let [max_speed, sigma, headway, headway_sigma, gap, accel, decel, rest @ ..] = *values;
    let [politeness, threshold, bias] = rest;
    let mut config = base.clone();
    let car = base.car;
    let change = |c: &mut ClassConfig| {
        c.speed_factor_sigma_frac = sigma.min(0.24 * c.speed_factor_frac);
        c.headway_s = (c.headway_s * headway / car.headway_s).clamp(0.3, 10.0);
        c.headway_sigma_frac = headway_sigma;
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
    config.human.creep_m_s = CREEP_M_S;
    config
}

/// Part of the vehicles that stand in a stretch with this mean speed between ends where they move on.
fn standing_frac(mean_m_s: f64, moving_m_s: f64) -> f64 {
    (STANDS_FRAC * (1.0 - mean_m_s / moving_m_s)).clamp(0.0, 0.9)
}

/// Inflow, density, classes, lengths, and the speeds at both ends as measured: all that a detector
/// before and one behind the stretch know.
pub(super) fn with_measured_demand(
    base: &TrafficConfig,
    lesson: &Lesson<'_>,
    boundary: &Boundary,
) -> TrafficConfig {
    let mut config = base.clone();
    let lanes_m = lanes_m(lesson.road);
    let measured = lesson.samples;
    let flow_1_s = measured.flow_1_h(lanes_m) / 3600.0;
    config.spawn_probability = (flow_1_s * config.spawn_interval_s).clamp(0.0, 1.0);
    config.initial_density_1_km = Some(measured.density_1_km(lanes_m).min(120.0));
    config.warm_up_s = WARM_UP_S;
    let tracks = &lesson.recording.tracks;
    let share = |class| {
        tracks.iter().filter(|t| t.class == class).count() as f64 / tracks.len().max(1) as f64
    };
    config.truck_share_frac = share(VehicleClass::Truck);
    config.van_share_frac = share(VehicleClass::Van).min(1.0 - config.truck_share_frac);
    for (class, own) in [
        (VehicleClass::Car, &mut config.car),
        (VehicleClass::Van, &mut config.van),
        (VehicleClass::Truck, &mut config.truck),
    ] {
        let of_class = tracks.iter().filter(|t| t.class == class);
        let lengths: Vec<f64> = of_class.map(|t| t.length_m).collect();
        if let Some(m) = moments(&lengths) {
            own.length_m = m.mean.clamp(1.0, 40.0);
            own.length_spread_m = (1.7 * m.sigma).min(0.4 * own.length_m);
        }
    }
    let before = moments(&boundary.inflow_m_s().collect::<Vec<_>>());
    let beyond = moments(&boundary.outflow_m_s().collect::<Vec<_>>());
    if let Some(before) = before {
        config.inflow_speed_m_s = Some(before.mean.max(1.0));
        config.inflow_sigma_m_s = before.sigma.min(30.0);
    }
    if let Some(beyond) = beyond {
        config.outflow_speed_m_s = Some(beyond.mean.max(0.0));
        config.outflow_sigma_m_s = beyond.sigma.min(30.0);
    }
    if let (Some(before), Some(beyond)) = (before, beyond) {
        let moving_m_s = 0.5 * (before.mean + beyond.mean).max(1.0);
        let mean_m_s = MacroscopicState::of(measured, lanes_m).mean_speed_m_s;
        config.initial_standing_frac = standing_frac(mean_m_s, moving_m_s);
    }
    config
}

/// Free traffic: the following of a population and the rim turned to these values.
pub(super) fn with_free(
    measured: &TrafficConfig,
    population: &[f64; POPULATION.len()],
    values: &[f64; FREE.len()],
) -> TrafficConfig {
    let mut people = *population;
    people[..FOLLOWING].copy_from_slice(&values[..FOLLOWING]);
    let [.., surplus, in_sigma, out_sigma, period_s] = *values;
    TrafficConfig {
        spawn_probability: (surplus * measured.spawn_probability).min(1.0),
        inflow_sigma_m_s: (in_sigma * measured.inflow_sigma_m_s).min(30.0),
        outflow_sigma_m_s: (out_sigma * measured.outflow_sigma_m_s).min(30.0),
        outflow_period_s: period_s,
        ..with_population(measured, &people)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_stand_where_a_stretch_is_slower_than_both_of_its_ends() {
        assert!((standing_frac(6.0, 10.0) - 0.28).abs() < 1e-12);
        assert_eq!(standing_frac(14.0, 12.0), 0.0);
    }

    #[test]
    fn every_corner_of_the_search_is_a_valid_configuration() {
        let start = TrafficConfig::default();
        for high in [false, true] {
            let corner = bounds(&POPULATION).map(|(a, b)| if high { b } else { a });
            with_population(&start, &corner).validate().unwrap();
            let free = bounds(&FREE).map(|(a, b)| if high { b } else { a });
            with_free(&start, &corner, &free).validate().unwrap();
        }
    }
}
