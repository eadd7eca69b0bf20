//! Whom the truck touches, and whether it is the cause.

use tractrix_core::{EgoState, Geometry, Maneuver, Neighbour, Scene};

/// Who comes into the truck's way by a lane change of their own, nearer ahead than this, cuts in, m.
const CUT_IN_M: f64 = 60.0;
/// Who is in the truck's way is remembered from here on, m ahead.
const SEEN_M: f64 = 100.0;
/// From this speed across the road somebody changes lanes, m/s.
const ACROSS_M_S: f64 = 0.01;
/// More than fit into the truck's way.
const MOST: usize = 64;

/// Those in the truck's way, in road coordinates: as wide as the truck, from its rear to
/// [`SEEN_M`] ahead of its front.
#[derive(Debug)]
pub(super) struct Contacts {
    beside: Vec<Beside>,
}

impl Default for Contacts {
    fn default() -> Self {
        Self { beside: Vec::with_capacity(MOST) }
    }
}

/// A copy has the room too; `clone_from` copies into it.
impl Clone for Contacts {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        self.beside.clone_from(&from.beside);
    }
}

#[derive(Debug, Clone, Copy)]
struct Beside {
    id: u64,
    cut_in: bool,
    /// Still there.
    stays: bool,
}

impl Contacts {
    /// Forgets everybody.
    pub(super) fn clear(&mut self) {
        self.beside.clear();
    }

    /// Looks at the present scene: whether the truck touches somebody, and if so whether it is the
    /// cause. It is where it runs into somebody ahead who has neither cut in nor is about to, and
    /// where it touches somebody who keeps their lane during a change of its own. Others, above all
    /// those who run into it from behind, cause the rest.
    pub(super) fn watch(
        &mut self,
        ego: &EgoState,
        scene: &Scene,
        maneuver: Maneuver,
        geometry: &Geometry,
    ) -> Option<bool> {
        let (front_m, rear_m) = (ego.s_m + geometry.front_m, ego.s_m - geometry.rear_m());
        let mut caused = None;
        for kept in &mut self.beside {
            kept.stays = false;
        }
        for n in &scene.neighbours {
            if n.front_s_m <= rear_m || n.rear_s_m >= front_m + SEEN_M || !beside(n, ego, geometry)
            {
                continue;
            }
            let gap_m = n.rear_s_m - front_m;
            let moves = n.lateral_speed_m_s.abs() > ACROSS_M_S;
            let cut_in = self.remember(n.id, moves && gap_m < CUT_IN_M);
            if gap_m < 0.0 {
                let ran_into = n.front_s_m > front_m && !cut_in;
                let moved_into = maneuver != Maneuver::KeepLane;
                let is_cause = !moves && (ran_into || moved_into);
                caused = Some(caused.unwrap_or(false) || is_cause);
            }
        }
        self.beside.retain(|kept| kept.stays);
        caused
    }

    /// Whether this vehicle cut in when it came.
    fn remember(&mut self, id: u64, cuts_in: bool) -> bool {
        if let Some(kept) = self.beside.iter_mut().find(|kept| kept.id == id) {
            kept.stays = true;
            return kept.cut_in;
        }
        if self.beside.len() < MOST {
            self.beside.push(Beside { id, cut_in: cuts_in, stays: true });
        }
        cuts_in
    }
}

fn beside(n: &Neighbour, ego: &EgoState, geometry: &Geometry) -> bool {
    (n.d_m - ego.d_m).abs() < 0.5 * (n.width_m + geometry.width_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A car whose rear is so far ahead of the truck's front, m, so far to its left, moving across.
    fn car(gap_m: f64, d_m: f64, across_m_s: f64) -> Scene {
        let rear_s_m = 105.0 + gap_m;
        let n =
            Neighbour { id: 7, rear_s_m, front_s_m: rear_s_m + 4.5, d_m, ..Neighbour::default() };
        let n = Neighbour { width_m: 1.8, lateral_speed_m_s: across_m_s, ..n };
        Scene { neighbours: vec![n], ..Scene::default() }
    }

    fn watch(scenes: &[Scene], maneuver: Maneuver) -> Option<bool> {
        let mut contacts = Contacts::default();
        let ego = EgoState { s_m: 100.0, ..EgoState::default() };
        // from 88 m to 105 m
        let (front_m, trailer_rear_m) = (5.0, 12.0);
        let body = Geometry { front_m, trailer_rear_m, width_m: 2.5, ..Geometry::default() };
        let seen = scenes.iter().map(|scene| contacts.watch(&ego, scene, maneuver, &body));
        seen.last().flatten()
    }

    #[test]
    fn who_is_the_cause() {
        let keep = Maneuver::KeepLane;
        let near = [car(30.0, 0.0, 0.0), car(-0.1, 0.0, 0.0)];
        assert_eq!(watch(&near, keep), Some(true), "run into somebody ahead");
        assert_eq!(watch(&near[..1], keep), None);
        let cut_in = [car(10.0, 1.5, -1.0), car(5.0, 0.0, 0.0), car(-0.1, 0.0, 0.0)];
        assert_eq!(watch(&cut_in, keep), Some(false), "who had cut in at 10 m");
        let far = [car(80.0, 1.5, -1.0), car(5.0, 0.0, 0.0), car(-0.1, 0.0, 0.0)];
        assert_eq!(watch(&far, keep), Some(true), "who had come 80 m ahead");
        let behind = [car(-21.0, 0.0, 0.0)];
        assert_eq!(watch(&behind, keep), Some(false), "run into from behind");
        let left = [car(-10.0, 2.0, 0.0)];
        assert_eq!(watch(&left, Maneuver::ChangeLeft), Some(true), "changed into a car");
        let meets = [car(-10.0, 2.0, -1.0)];
        assert_eq!(watch(&meets, Maneuver::ChangeLeft), Some(false), "who changed too");
        assert_eq!(watch(&[car(-10.0, 3.0, 0.0)], Maneuver::ChangeLeft), None, "in the next lane");
    }
}
