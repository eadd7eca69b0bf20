//! From the state of a tick to the scene at any instant of it.
//!
//! Between ticks a vehicle moves with constant acceleration (stopping at zero speed), so a scene
//! at 100 Hz is exact, not interpolated. Across the lane it follows the quintic
//! `10 p³ - 15 p⁴ + 6 p⁵` of the elapsed fraction p, which starts and ends without lateral speed
//! or acceleration.

use driver_models::ballistic;
use road::Road;
use tractrix_core::{Neighbour, Scene};

use super::engine::Engine;
use super::lanes::NO_LANE;

/// Share of a lane change done after the fraction `p` of its duration, and its derivative.
pub(crate) fn quintic(p: f64) -> (f64, f64) {
    let p = p.clamp(0.0, 1.0);
    let (p2, q) = (p * p, 1.0 - p);
    (p2 * p * (10.0 + p * (6.0 * p - 15.0)), 30.0 * p2 * q * q)
}

/// Fraction of the duration after which this share of a lane change is done: the inverse of
/// [`quintic`], by bisection.
pub(crate) fn progress_of(done: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if quintic(middle).0 < done { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// A lane change at an instant.
struct Shift {
    /// Share that is done.
    done: f64,
    /// From lane to lane, to the left, m.
    way_m: f64,
    /// What the lane that is left has on each side of the vehicle, m.
    beside_m: f64,
}

impl Shift {
    /// How far a body of this length may be turned out of the road's direction, rad: its ends stay
    /// on the way from lane to lane, and beside it no further out than in their lane. Who changes
    /// lanes at a crawl is faster across the road than along it, and its course is no measure of
    /// where its body points: a long truck would swing its tail across the lane beside it.
    fn most_turned_rad(&self, length_m: f64) -> f64 {
        let room_m = self.done.min(1.0 - self.done) * self.way_m.abs() + self.beside_m;
        libm::asin((room_m / (0.5 * length_m)).min(1.0))
    }
}

/// Writes the vehicles within the scene's radius of `ego_s_m` into the scene, `tau_s` after the
/// tick. Those whose front is within `poses_within_m` of it have poses on the road; NaN without.
pub(crate) fn publish(
    engine: &Engine,
    road: &Road,
    poses_within_m: f64,
    ego_s_m: f64,
    tau_s: f64,
    scene: &mut Scene,
) {
    let (fleet, map) = (&engine.state.fleet, &engine.map);
    let radius_m = engine.config.scene_radius_m;
    let near = engine.present();
    let behind = |&s: &f64| s < ego_s_m - radius_m;
    let first = near.start + fleet.s_m[near.clone()].partition_point(behind);
    scene.neighbours.clear();
    for i in first..near.end {
        let driver = &fleet.driver[i];
        if fleet.s_m[i] - driver.length_m > ego_s_m + radius_m {
            break;
        }
        let (speed_m_s, distance_m) = ballistic(fleet.v_m_s[i], fleet.a_m_s2[i], tau_s);
        let front_s_m = fleet.s_m[i] + distance_m;
        let rear_s_m = front_s_m - driver.length_m;
        let middle_m = 0.5 * (front_s_m + rear_s_m);
        let lane = &map.lanes[fleet.lane[i] as usize];
        let (mut d_m, slope) = lane.center_and_slope(middle_m);
        let mut lateral_speed_m_s = slope * speed_m_s;
        let target = fleet.target[i];
        let mut shift = None;
        if target != NO_LANE {
            let (done, rate) = quintic((fleet.clock_s[i] + tau_s) / driver.lane_change_s);
            let way_m = map.lanes[target as usize].center_d_m(middle_m) - d_m;
            let width_m = lane.center_and_width_m(middle_m).1;
            let beside_m = (0.5 * (width_m - engine.config.class(driver.class).width_m)).max(0.0);
            shift = Some(Shift { done, way_m, beside_m });
            d_m += done * way_m;
            lateral_speed_m_s += rate * way_m / driver.lane_change_s;
        }
        let (x_m, y_m, yaw_rad) = if (front_s_m - ego_s_m).abs() <= poses_within_m {
            let at = road.at(middle_m, d_m);
            let turned_rad = libm::atan2(lateral_speed_m_s, speed_m_s.max(1.0));
            let most_rad = shift.map_or(f64::INFINITY, |s| s.most_turned_rad(driver.length_m));
            (at.x_m, at.y_m, at.heading_rad + turned_rad.clamp(-most_rad, most_rad))
        } else {
            (f64::NAN, f64::NAN, f64::NAN)
        };
        scene.neighbours.push(Neighbour {
            id: fleet.id[i],
            class: driver.class,
            front_s_m,
            rear_s_m,
            d_m,
            width_m: engine.config.class(driver.class).width_m,
            speed_m_s,
            lateral_speed_m_s,
            accel_m_s2: if speed_m_s > 0.0 { fleet.a_m_s2[i] } else { 0.0 },
            lane: fleet.lane[i],
            target_lane: (target != NO_LANE).then_some(target),
            x_m,
            y_m,
            yaw_rad,
        });
    }
    scene
        .neighbours
        .sort_unstable_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m).then(a.id.cmp(&b.id)));
    let schedule = &engine.config.schedule;
    engine.state.plot.stage().show(schedule, road, ego_s_m, radius_m, scene);
}

/// A neighbour `tau_s` later, carried on with its speed and acceleration in the direction of its
/// body.
pub(crate) fn carry_on(n: &Neighbour, tau_s: f64) -> Neighbour {
    let (speed_m_s, distance_m) = ballistic(n.speed_m_s, n.accel_m_s2, tau_s);
    let (sin, cos) = (libm::sin(n.yaw_rad), libm::cos(n.yaw_rad));
    Neighbour {
        front_s_m: n.front_s_m + distance_m,
        rear_s_m: n.rear_s_m + distance_m,
        d_m: n.d_m + n.lateral_speed_m_s * tau_s,
        x_m: n.x_m + distance_m * cos,
        y_m: n.y_m + distance_m * sin,
        speed_m_s,
        ..*n
    }
}

#[cfg(test)]
mod tests {
    use super::{Shift, progress_of, quintic};

    /// A truck that changed lanes at 1.3 m/s was shown 38 degrees across its lane, and its tail hit
    /// who stood on its other side.
    #[test]
    fn a_long_truck_that_changes_lanes_at_a_crawl_does_not_swing_into_a_third_lane() {
        for (length_m, p) in
            [17.2, 12.0, 4.5].into_iter().flat_map(|l| [0.1, 0.5, 0.8].map(|p| (l, p)))
        {
            let beside_m = 0.6;
            let (done, rate) = quintic(p);
            let shift = Shift { done, way_m: -3.75, beside_m };
            let most_rad = shift.most_turned_rad(length_m);
            let end_m = 0.5 * length_m * most_rad.sin();
            let (first_m, last_m) = (shift.done * 3.75 - end_m, shift.done * 3.75 + end_m);
            assert!(first_m >= -beside_m - 1e-9 && last_m <= 3.75 + beside_m + 1e-9, "{p}");
            // On the move, a body points where it goes.
            let course_rad = libm::atan2(rate * 3.75 / 5.0, 8.0);
            assert!(course_rad < most_rad, "{length_m} m, {p}: {course_rad} {most_rad}");
        }
    }

    #[test]
    fn the_progress_of_a_share_gives_the_share_again() {
        for done in [0.0, 0.01, 0.3, 0.5, 0.99, 1.0] {
            assert!((quintic(progress_of(done)).0 - done).abs() < 1e-9, "{done}");
        }
    }

    #[test]
    fn a_lane_change_starts_and_ends_without_lateral_speed() {
        assert_eq!(quintic(0.0), (0.0, 0.0));
        assert_eq!(quintic(1.0), (1.0, 0.0));
        assert_eq!(quintic(0.5).0, 0.5);
        for p in [0.1, 0.4, 0.8] {
            let numeric = (quintic(p + 1e-6).0 - quintic(p - 1e-6).0) / 2e-6;
            assert!((quintic(p).1 - numeric).abs() < 1e-6);
        }
    }
}
