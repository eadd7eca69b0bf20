//! Who is ahead and who is behind, in the own lane and in both neighbour lanes: two sweeps over
//! the sorted fleet, each vehicle touched once.

use super::ego::EgoSpans;
use super::fleet::Fleet;
use super::lanes::{LaneMap, NO_LANE};

/// Own lane, left lane, right lane.
pub(crate) const OWN: usize = 0;
pub(crate) const LEFT: usize = 1;
pub(crate) const RIGHT: usize = 2;

/// Nobody there.
pub(crate) const NOBODY: u32 = u32::MAX;
/// The ego.
pub(crate) const EGO: u32 = u32::MAX - 1;

/// Neighbours of every vehicle, by index into the fleet. Scratch: not part of the state.
#[derive(Debug, Default, Clone)]
pub(crate) struct Neighbourhood {
    /// Lane tracks: own, left, right ([`NO_LANE`] if there is none here).
    pub(crate) lanes: Vec<[u16; 3]>,
    /// Nearest vehicle whose front is ahead.
    pub(crate) leader: Vec<[u32; 3]>,
    /// Nearest vehicle whose front is behind.
    pub(crate) follower: Vec<[u32; 3]>,
    nearest: Vec<u32>,
}

impl Neighbourhood {
    /// Finds the neighbours in the own lane, and in the lanes beside of those who `look_aside`
    /// (the others get [`NO_LANE`] there); the fleet is sorted.
    pub(crate) fn find(
        &mut self,
        fleet: &Fleet,
        map: &LaneMap,
        ego: &EgoSpans,
        look_aside: impl Fn(usize) -> bool,
    ) {
        let n = fleet.len();
        self.lanes.resize(n, [NO_LANE; 3]);
        self.leader.resize(n, [NOBODY; 3]);
        self.follower.resize(n, [NOBODY; 3]);
        for i in 0..n {
            let lane = fleet.lane[i];
            let aside = look_aside(i);
            let (left, right) =
                if aside { map.beside(lane, fleet.s_m[i]) } else { (NO_LANE, NO_LANE) };
            self.lanes[i] = [lane, left, right];
        }
        // From the front: the last one seen in a lane is the leader of the next one.
        self.reset(map.lanes.len());
        let mut spans = ego.spans().iter().rev().peekable();
        for i in (0..n).rev() {
            while let Some(span) = spans.next_if(|e| e.front_m > fleet.s_m[i]) {
                self.nearest[span.lane as usize] = EGO;
            }
            self.leader[i] = self.look(i);
            self.mark(fleet, i);
        }
        self.reset(map.lanes.len());
        let mut spans = ego.spans().iter().peekable();
        for i in 0..n {
            while let Some(span) = spans.next_if(|e| e.front_m <= fleet.s_m[i]) {
                self.nearest[span.lane as usize] = EGO;
            }
            self.follower[i] = self.look(i);
            self.mark(fleet, i);
        }
    }

    fn reset(&mut self, lanes: usize) {
        self.nearest.clear();
        self.nearest.resize(lanes + 1, NOBODY);
    }

    fn look(&self, i: usize) -> [u32; 3] {
        // NO_LANE maps to the spare last entry, which stays NOBODY.
        let spare = self.nearest.len() - 1;
        let [own, left, right] = self.lanes[i];
        let own = self.nearest[own as usize];
        if left == NO_LANE && right == NO_LANE {
            return [own, NOBODY, NOBODY];
        }
        let at = |lane: u16| self.nearest[(lane as usize).min(spare)];
        [own, at(left), at(right)]
    }

    fn mark(&mut self, fleet: &Fleet, i: usize) {
        self.nearest[fleet.lane[i] as usize] = i as u32;
        if fleet.is_changing(i) {
            self.nearest[fleet.target[i] as usize] = i as u32;
        }
    }
}
