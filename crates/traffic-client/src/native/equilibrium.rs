//! What a driver keeps in steady traffic, and the most that a lane of such drivers carries.
//!
//! At a common speed v a driver of length l keeps the gap s(v) at which they neither accelerate nor
//! brake; the flow of a lane is `v / mean(l + s(v))`. It has one maximum, the capacity in
//! equilibrium, between free traffic (faster) and congestion (slower): Treiber & Kesting 2013,
//! ch. 4 and 11.4. Real lanes carry less, as drivers hinder each other.

use driver_models::Idm;

use super::config::{ClassConfig, TrafficConfig};

/// Gaps beyond this are a free road, m.
const FREE_M: f64 = 2000.0;
/// Halvings of an interval: as fine as the numbers allow.
const HALVINGS: u32 = 40;
/// Cuts of an interval at the golden section.
const CUTS: u32 = 40;
/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Acceleration behind a leader, m/s², as the engine drives.
pub(crate) fn follows_m_s2(idm: &Idm, v_m_s: f64, limit_m_s: f64, gap_m: f64, dv_m_s: f64) -> f64 {
    let taken = idm.interaction_m_s2(v_m_s, gap_m, dv_m_s);
    idm.lesser_m_s2(idm.free_m_s2(v_m_s, limit_m_s), taken)
}

/// The greatest speed up to `wish_m_s` at which a driver does not brake behind a leader, m/s.
pub(crate) fn easy_speed_m_s(idm: &Idm, wish_m_s: f64, gap_m: f64, leader_m_s: f64) -> f64 {
    let easy = |v: f64| follows_m_s2(idm, v, wish_m_s, gap_m, v - leader_m_s) >= 0.0;
    if easy(wish_m_s) {
        return wish_m_s;
    }
    let (mut low, mut high) = (0.0, wish_m_s);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if easy(middle) { low = middle } else { high = middle }
    }
    low
}

/// The gap that a driver keeps behind a leader of the same speed, m; [`FREE_M`] at most.
pub(crate) fn kept_gap_m(idm: &Idm, v_m_s: f64, limit_m_s: f64) -> f64 {
    // What [`follows_m_s2`] works out anew for each gap is the same for all of them.
    let (wanted_m, free_m_s2) = (idm.wanted_gap_m(v_m_s, 0.0), idm.free_m_s2(v_m_s, limit_m_s));
    if free_m_s2 < 0.0 {
        return FREE_M;
    }
    let (mut low, mut high) = (0.0, FREE_M);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if idm.accel_m_s2 + idm.hindrance_m_s2(wanted_m, middle) < 0.0 {
            low = middle
        } else {
            high = middle
        }
    }
    high
}

/// The speed at which a flow is greatest, m/s, searched up to `top_m_s`; `flow` has one maximum.
fn best_speed_m_s(top_m_s: f64, flow: impl Fn(f64) -> f64) -> f64 {
    let (low, high) = best_speed_between_m_s(top_m_s, flow, |_, _| false);
    0.5 * (low + high)
}

/// The interval around [`best_speed_m_s`] down to which the search gets, or the first that is narrow
/// `enough`.
fn best_speed_between_m_s(
    top_m_s: f64,
    flow: impl Fn(f64) -> f64,
    enough: impl Fn(f64, f64) -> bool,
) -> (f64, f64) {
    let (mut low, mut high) = (0.0, top_m_s);
    let mut inner = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let mut flows = (flow(inner.0), flow(inner.1));
    for _ in 0..CUTS {
        if enough(low, high) {
            break;
        }
        if flows.0 > flows.1 {
            high = inner.1;
            inner = (high - GOLDEN * (high - low), inner.0);
            flows = (flow(inner.0), flows.0);
        } else {
            low = inner.0;
            inner = (inner.1, low + GOLDEN * (high - low));
            flows = (flows.1, flow(inner.1));
        }
    }
    (low, high)
}

/// Whether a speed, m/s, is at least the one at which a lane of drivers like this one carries most.
pub(crate) fn is_critical_speed(idm: &Idm, limit_m_s: f64, length_m: f64, v_m_s: f64) -> bool {
    let top_m_s = idm.desired_speed_m_s.min(limit_m_s);
    let flow = |v: f64| v / (length_m + kept_gap_m(idm, v, limit_m_s));
    // The search ends once it is known on which side of the best speed this one is.
    let (low, high) =
        best_speed_between_m_s(top_m_s, flow, |low, high| v_m_s >= high || v_m_s < low);
    v_m_s >= 0.5 * (low + high)
}

/// The most that a lane carries in equilibrium, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capacity {
    /// Flow, vehicles per hour and lane.
    pub flow_veh_h_lane: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Density, vehicles per km and lane.
    pub density_1_km: f64,
}

impl TrafficConfig {
    /// The most that these drivers carry in equilibrium: class means, mixed by their shares, all
    /// at one speed on a level road without other limits than `max_speed_m_s`.
    #[must_use]
    pub fn capacity(&self) -> Capacity {
        let cars = (1.0 - self.truck_share_frac - self.van_share_frac).max(0.0);
        let mix = [
            (cars, &self.car),
            (self.van_share_frac, &self.van),
            (self.truck_share_frac, &self.truck),
        ];
        let mix = mix.into_iter().filter(|(share, _)| *share > 0.0);
        let mix: Vec<(f64, f64, Idm)> =
            mix.map(|(share, c)| (share, c.length_m, self.mean(c))).collect();
        let slowest = mix.iter().map(|(.., idm)| idm.desired_speed_m_s);
        let top_m_s = slowest.fold(self.max_speed_m_s, f64::min);
        let room = |v: f64| -> f64 {
            let each =
                mix.iter().map(|(share, l, idm)| share * (l + kept_gap_m(idm, v, f64::INFINITY)));
            each.sum()
        };
        let speed_m_s = best_speed_m_s(top_m_s, |v| v / room(v));
        let room_m = room(speed_m_s);
        Capacity {
            flow_veh_h_lane: 3600.0 * speed_m_s / room_m,
            speed_m_s,
            density_1_km: 1000.0 / room_m,
        }
    }

    /// Flow that is asked for at the start of a lane, vehicles per hour.
    #[must_use]
    pub fn asked_veh_h_lane(&self) -> f64 {
        3600.0 * self.spawn_probability / self.spawn_interval_s
    }

    /// The mean driver of a class.
    fn mean(&self, c: &ClassConfig) -> Idm {
        let desired_m_s = self.max_speed_m_s * c.speed_factor_frac;
        Idm::new(
            desired_m_s,
            c.headway_s,
            c.min_gap_m,
            c.accel_m_s2,
            c.decel_m_s2,
            c.max_decel_m_s2,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> Idm {
        Idm::new(33.3, 1.6, 2.0, 0.73, 1.67, 9.0)
    }

    fn critical_speed_m_s(idm: &Idm, limit_m_s: f64, length_m: f64) -> f64 {
        let top_m_s = idm.desired_speed_m_s.min(limit_m_s);
        best_speed_m_s(top_m_s, |v| v / (length_m + kept_gap_m(idm, v, limit_m_s)))
    }

    #[test]
    fn the_kept_gap_is_where_the_law_neither_accelerates_nor_brakes() {
        for v in [1.0, 10.0, 25.0, 33.0] {
            let gap = kept_gap_m(&car(), v, 33.2);
            assert!(follows_m_s2(&car(), v, 33.2, gap, 0.0).abs() < 1e-6, "{v}: {gap}");
            let again = easy_speed_m_s(&car(), 33.2, gap, v);
            assert!((again - v).abs() < 1e-3, "{v}: {again}");
        }
        assert_eq!(easy_speed_m_s(&car(), 30.0, 1e6, 33.0), 30.0);
    }

    #[test]
    fn no_speed_carries_more_than_the_critical_one() {
        let flow = |v: f64| v / (4.6 + kept_gap_m(&car(), v, 99.0));
        let critical_m_s = critical_speed_m_s(&car(), 99.0, 4.6);
        let best = flow(critical_m_s);
        assert!(is_critical_speed(&car(), 99.0, 4.6, critical_m_s * (1.0 + 1e-6)));
        assert!(!is_critical_speed(&car(), 99.0, 4.6, critical_m_s * (1.0 - 1e-6)));
        for k in 1..=333 {
            assert!(flow(0.1 * f64::from(k)) <= best * (1.0 + 1e-9), "{k}");
        }
    }

    #[test]
    fn a_mix_of_one_class_has_the_capacity_of_that_class_and_trucks_cost_some() {
        let cars = TrafficConfig {
            truck_share_frac: 0.0,
            van_share_frac: 0.0,
            max_speed_m_s: 30.0,
            ..TrafficConfig::default()
        };
        let idm = cars.mean(&cars.car);
        let v = critical_speed_m_s(&idm, f64::INFINITY, cars.car.length_m);
        let alone = 3600.0 * v / (cars.car.length_m + kept_gap_m(&idm, v, f64::INFINITY));
        let capacity = cars.capacity();
        assert!((capacity.flow_veh_h_lane / alone - 1.0).abs() < 1e-9, "{capacity:?} {alone}");
        let product = capacity.density_1_km * capacity.speed_m_s * 3.6;
        assert!((product / capacity.flow_veh_h_lane - 1.0).abs() < 1e-12);
        let mixed = TrafficConfig { truck_share_frac: 0.2, ..cars.clone() };
        assert!(mixed.capacity().flow_veh_h_lane < 0.9 * capacity.flow_veh_h_lane);
    }
}
