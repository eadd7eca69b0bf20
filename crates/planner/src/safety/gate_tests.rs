//! The gate's rear gap in closed form, and against followers that do not make room.

use super::{Gate, GateView, RssConfig, SafeGap, SpeedCourse};
use crate::steering::{LaneChangeConfig, LateralPath};
use crate::testing::{reference_geometry, reference_limits};
use road::{Road, builtin};
use tractrix_core::{EgoState, LaneChangeRefusal, Neighbour, Scene, VehicleClass};

const S_M: f64 = 1_000.0;
/// What a step of the simulation may be wrong by, m.
const LATE_M: f64 = 0.1;
/// Duration of the change, s.
const T_S: f64 = 6.0;

/// A truck at `v` that changes to the left in front of a follower.
#[derive(Debug, Clone, Copy)]
struct Case {
    class: VehicleClass,
    v: f64,
    follower_m_s: f64,
}

impl Case {
    /// What the gate says of a follower at a gap behind the trailer.
    fn verdict(&self, road: &Road, gap_m: f64) -> Result<(), LaneChangeRefusal> {
        let limits = reference_limits();
        let ego = EgoState {
            s_m: S_M,
            d_m: road.lanes()[0].center_d_m(S_M),
            speed_m_s: self.v,
            ..EgoState::default()
        };
        let front_s_m = S_M - limits.geometry.rear_m() - gap_m;
        let follower = Neighbour {
            class: self.class,
            front_s_m,
            rear_s_m: front_s_m - 5.0,
            d_m: road.lanes()[1].center_d_m(S_M),
            width_m: 2.0,
            speed_m_s: self.follower_m_s,
            lane: 1,
            ..Neighbour::default()
        };
        let scene = Scene { neighbours: [follower].into(), ..Scene::default() };
        let rss = RssConfig::default();
        let view =
            GateView { rss: &rss, ego: &ego, scene: &scene, road, limits: &limits, grade_rad: 0.0 };
        let keep = LateralPath::keep(0).at(road, S_M);
        let path = LateralPath::join(road, 1, keep, S_M, self.v * T_S);
        let course = SpeedCourse { start_m_s: self.v, end_m_s: self.v, duration_s: T_S };
        let strictness = LaneChangeConfig::default().entry(false, self.v);
        Gate::new(&view, 0, 1).check(&course, &path, road, S_M, &strictness)
    }

    /// The least gap that the gate passes, m.
    fn least_gap_m(&self, road: &Road) -> f64 {
        let (mut low, mut high) = (0.0, 400.0);
        assert!(self.verdict(road, high).is_ok() && self.verdict(road, low).is_err(), "{self:?}");
        while high - low > 1e-3 {
            let middle = 0.5 * (low + high);
            *(if self.verdict(road, middle).is_ok() { &mut high } else { &mut low }) = middle;
        }
        high
    }

    fn safe(&self) -> SafeGap {
        let rss = RssConfig::default();
        SafeGap::new(&rss.behind(self.class), rss.ego_brake_max_m_s2, 0.0)
    }

    /// When the tractor's front or axle group reaches into the lane, s, by the quintic itself.
    fn entry_s(&self, road: &Road) -> f64 {
        let (g, width_m) = (reference_geometry(), road.lanes()[1].width_m(S_M));
        let length_m = self.v * T_S;
        let reach_m = 0.5 * (width_m - g.width_m);
        let across = |u: f64| {
            let slope = 30.0 * u * u * (1.0 - u) * (1.0 - u) * width_m / length_m;
            let d_m = width_m * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            d_m.max(d_m + slope * g.front_m)
        };
        (0..).map(|i| 1e-3 * f64::from(i)).find(|t| across(t / T_S) > reach_m).unwrap()
    }
}

fn cases() -> impl Iterator<Item = Case> {
    [VehicleClass::Car, VehicleClass::Truck].into_iter().flat_map(|class| {
        [(20.0, 20.0), (20.0, 22.0), (20.0, 25.0), (23.0, 31.0), (12.0, 16.0), (16.0, 22.5)]
            .map(|(v, follower_m_s)| Case { class, v, follower_m_s })
    })
}

#[test]
fn the_rear_gap_is_that_of_the_entry_with_the_reaction_before_any_courtesy() {
    // With closing speed w, entry at t_e and reaction rho the gap that the safe one d has to be left
    // of is smallest when the follower begins to ease off, w (t_e + rho) from now: after that d
    // shrinks faster than the gap. The gate looks at steps of 0.5 s and may ask for up to three more.
    let road = builtin::flat(3_000.0);
    for case in cases() {
        let rss = RssConfig::default();
        let closing = case.follower_m_s - case.v;
        let safe_m = 1.05 * case.safe().gap_m(case.follower_m_s, case.v);
        let entry_s = case.entry_s(&road);
        let by_hand = closing * (entry_s + rss.behind(case.class).reaction_s) + safe_m;
        let asked = case.least_gap_m(&road);
        assert!(
            asked > by_hand - 0.01 && asked < by_hand + 1.5 * closing + 0.01,
            "{case:?}: {asked} m, by hand {by_hand}"
        );
        // Counted from now on, without courtesy, it was this and more.
        let before = closing * (T_S + 1.0) + safe_m;
        assert!(asked < before || closing == 0.0, "{case:?}: {asked} m, was {before}");
    }
}

/// Least gap behind a truck that enters at `entry_s` and brakes as hard as it can at `brakes_s`.
/// The follower does not ease off; once the safe gap is undershot it accelerates for its reaction
/// time, as the safe gap allows it to, and then brakes no harder than it assumes.
fn stubborn(case: &Case, gap_m: f64, entry_s: f64, brakes_s: f64) -> f64 {
    let rss = RssConfig::default();
    let response = rss.behind(case.class);
    let safe = case.safe();
    let (dt, mut gap, mut v, mut v_f) = (1e-3, gap_m, case.v, case.follower_m_s);
    let (mut least, mut undershot_s) = (f64::INFINITY, None);
    for i in 0..60_000 {
        let time_s = dt * f64::from(i);
        if time_s >= entry_s {
            least = least.min(gap);
            if gap < safe.gap_m(v_f, v) {
                undershot_s.get_or_insert(time_s);
            }
        }
        let answers = undershot_s.map_or(0.0, |since: f64| {
            let reacted = time_s - since >= response.reaction_s;
            if reacted { -response.brake_min_m_s2 } else { response.accel_max_m_s2 }
        });
        let a = if time_s >= brakes_s { -rss.ego_brake_max_m_s2 } else { 0.0 };
        let (next, next_f) = (f64::max(v + a * dt, 0.0), f64::max(v_f + answers * dt, 0.0));
        gap += 0.5 * (v + next - v_f - next_f) * dt;
        (v, v_f) = (next, next_f);
        if v_f == 0.0 {
            break;
        }
    }
    least
}

#[test]
fn a_follower_that_makes_no_room_at_all_still_stops_behind_the_truck() {
    let road = builtin::flat(3_000.0);
    let mut closer = 0;
    for case in cases() {
        let (gap_m, entry_s) = (case.least_gap_m(&road), case.entry_s(&road));
        for brakes_s in (0..40).map(|i| entry_s + 0.25 * f64::from(i)) {
            let least = stubborn(&case, gap_m, entry_s, brakes_s);
            // Seen and answered a millisecond late each, where the need grows by 25 m a second.
            assert!(least > -LATE_M, "{case:?}: {least} m, braking at {brakes_s} s");
            closer += u32::from(stubborn(&case, 0.6 * gap_m, entry_s, brakes_s) < -LATE_M);
        }
    }
    assert!(closer > 50, "at six tenths of the gap {closer} of {} collide", 12 * 40);
}

#[test]
fn who_is_alongside_or_brakes_ahead_is_not_entered_upon() {
    let road = builtin::flat(3_000.0);
    let case = Case { class: VehicleClass::Car, v: 20.0, follower_m_s: 20.0 };
    assert_eq!(case.verdict(&road, -5.0), Err(LaneChangeRefusal::Occupied));
    assert_eq!(case.verdict(&road, 10.0), Err(LaneChangeRefusal::UnsafeRear));
}
