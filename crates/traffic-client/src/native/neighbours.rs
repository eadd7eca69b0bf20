//! Who is ahead and who is behind, in the own lane and in both neighbour lanes: two sweeps over
//! the sorted fleet, each vehicle touched once.

use std::ops::Range;

use super::ego::EgoSpans;
use super::fleet::Fleet;
use super::lanes::{LaneMap, NO_LANE};
use super::workers::{Workers, in_pieces, ranges};

/// Own lane, left lane, right lane.
pub(crate) const OWN: usize = 0;
pub(crate) const LEFT: usize = 1;
pub(crate) const RIGHT: usize = 2;

/// Nobody there.
pub(crate) const NOBODY: u32 = u32::MAX;
/// The ego.
pub(crate) const EGO: u32 = u32::MAX - 1;

/// Neighbours of a vehicle: own lane, left lane, right lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sides {
    /// Lane tracks ([`NO_LANE`] if there is none here).
    pub(crate) lanes: [u16; 3],
    /// Nearest vehicle whose front is ahead, by index into the fleet.
    pub(crate) leader: [u32; 3],
    /// Nearest vehicle whose front is behind.
    pub(crate) follower: [u32; 3],
}

/// Neighbours of every vehicle that acts. Scratch: not part of the state.
#[derive(Debug, Default)]
pub(crate) struct Neighbourhood {
    pub(crate) sides: Vec<Sides>,
    /// Nearest ahead and behind in each lane: memory of a sweep.
    ahead: Vec<u32>,
    behind: Vec<u32>,
}

/// What a sweep goes over.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub(super) fleet: &'a Fleet,
    pub(super) map: &'a LaneMap,
    pub(super) ego: &'a EgoSpans,
}

impl Neighbourhood {
    /// Finds the neighbours of those who act: in the own lane, and in the lanes beside of those who
    /// `look_aside` (the others get [`NO_LANE`] there). `over` are those who are looked at, who act
    /// among them. Of more than one piece, each first tells who is nearest to its ends, so that the
    /// sweep over the next one can begin with them.
    pub(super) fn find(
        &mut self,
        seen: Seen<'_>,
        over: &Range<usize>,
        act: &Range<usize>,
        workers: &dyn Workers,
        piece: usize,
        look_aside: impl Fn(usize) -> bool + Sync,
    ) {
        let nobody = Sides { lanes: [NO_LANE; 3], leader: [NOBODY; 3], follower: [NOBODY; 3] };
        seen.fleet.fit(&mut self.sides, nobody);
        // NO_LANE looks at the spare last entry, which stays NOBODY.
        let tracks = seen.map.lanes.len() + 1;
        for nearest in [&mut self.ahead, &mut self.behind] {
            nearest.clear();
            nearest.resize(tracks, NOBODY);
        }
        seen.visit_front_first(act.end..over.end, &mut self.ahead, |_, _, _, _| {});
        seen.visit_back_first(over.start..act.start, &mut self.behind, |_, _, _, _| {});
        let (first, n) = (act.start, act.len());
        let sides = &mut self.sides[act.clone()];
        if n <= piece {
            seen.sweep(first, sides, &mut self.ahead, &mut self.behind, &look_aside);
            return;
        }
        let nobody = vec![NOBODY; tracks];
        let ends = in_pieces(workers, ranges(act.clone(), piece), |_, range| {
            let (mut ahead, mut behind) = (nobody.clone(), nobody.clone());
            seen.visit_front_first(range.clone(), &mut ahead, |_, _, _, _| {});
            seen.visit_back_first(range, &mut behind, |_, _, _, _| {});
            (ahead, behind)
        });
        let pieces = n.div_ceil(piece);
        let mut ahead = vec![self.ahead.clone(); pieces];
        let mut behind = vec![self.behind.clone(); pieces];
        for k in (1..pieces).rev() {
            ahead[k - 1] = nearer(&ahead[k], &ends[k].0);
        }
        for k in 1..pieces {
            behind[k] = nearer(&behind[k - 1], &ends[k - 1].1);
        }
        let items = sides.chunks_mut(piece).zip(ahead.into_iter().zip(behind));
        in_pieces(workers, items, |k, (sides, (mut ahead, mut behind))| {
            seen.sweep(first + k * piece, sides, &mut ahead, &mut behind, &look_aside);
        });
    }
}

/// The nearest of two that are known, where those of `near` are nearer.
fn nearer(far: &[u32], near: &[u32]) -> Vec<u32> {
    far.iter().zip(near).map(|(&f, &n)| if n == NOBODY { f } else { n }).collect()
}

fn look(own: u16, left: u16, right: u16, nearest: &[u32]) -> [u32; 3] {
    let spare = nearest.len() - 1;
    let own = nearest[own as usize];
    if left == NO_LANE && right == NO_LANE {
        return [own, NOBODY, NOBODY];
    }
    let at = |lane: u16| nearest[(lane as usize).min(spare)];
    [own, at(left), at(right)]
}

impl Seen<'_> {
    /// Finds the neighbours of those from an index on; `ahead` and `behind` begin with who is
    /// nearest there.
    fn sweep(
        &self,
        from: usize,
        sides: &mut [Sides],
        ahead: &mut [u32],
        behind: &mut [u32],
        look_aside: &impl Fn(usize) -> bool,
    ) {
        let range = from..from + sides.len();
        // From the front: the last one seen in a lane is the leader of the next one.
        self.visit_front_first(range.clone(), ahead, |i, lane, s_m, nearest| {
            let (left, right) =
                if look_aside(i) { self.map.beside(lane, s_m) } else { (NO_LANE, NO_LANE) };
            let sides = &mut sides[i - from];
            sides.lanes = [lane, left, right];
            sides.leader = look(lane, left, right, nearest);
        });
        self.visit_back_first(range, behind, |i, _, _, nearest| {
            let sides = &mut sides[i - from];
            let [own, left, right] = sides.lanes;
            sides.follower = look(own, left, right, nearest);
        });
    }

    /// Visits a range from its front (index, lane, station m), with the nearest one ahead in each
    /// lane; `nearest` begins with those ahead of the range.
    fn visit_front_first(
        &self,
        range: Range<usize>,
        nearest: &mut [u32],
        mut visit: impl FnMut(usize, u16, f64, &[u32]),
    ) {
        let next_m = self.fleet.s_m.get(range.end).copied().unwrap_or(f64::INFINITY);
        let mut spans = self.ego.spans().iter().rev().skip_while(|e| e.front_m > next_m);
        let mut next = spans.next();
        let from = range.start;
        let (s_m, lane, target) = self.of(range);
        for k in (0..s_m.len()).rev() {
            let (i, lane, target, s_m) = (from + k, lane[k], target[k], s_m[k]);
            while let Some(span) = next.filter(|e| e.front_m > s_m) {
                nearest[span.lane as usize] = EGO;
                next = spans.next();
            }
            visit(i, lane, s_m, nearest);
            mark(i, lane, target, nearest);
        }
    }

    /// The same from its back.
    fn visit_back_first(
        &self,
        range: Range<usize>,
        nearest: &mut [u32],
        mut visit: impl FnMut(usize, u16, f64, &[u32]),
    ) {
        let last_m = range.start.checked_sub(1).and_then(|k| self.fleet.s_m.get(k));
        let last_m = last_m.copied().unwrap_or(f64::NEG_INFINITY);
        let mut spans = self.ego.spans().iter().skip_while(|e| e.front_m <= last_m);
        let mut next = spans.next();
        let from = range.start;
        let (s_m, lane, target) = self.of(range);
        for k in 0..s_m.len() {
            let (i, lane, target, s_m) = (from + k, lane[k], target[k], s_m[k]);
            while let Some(span) = next.filter(|e| e.front_m <= s_m) {
                nearest[span.lane as usize] = EGO;
                next = spans.next();
            }
            visit(i, lane, s_m, nearest);
            mark(i, lane, target, nearest);
        }
    }

    /// Stations, lanes and targets of those in a range, all as long.
    fn of(&self, range: Range<usize>) -> (&[f64], &[u16], &[u16]) {
        let Fleet { s_m, lane, target, .. } = self.fleet;
        let (s_m, n) = (&s_m[range.clone()], range.len());
        (&s_m[..n], &lane[range.clone()][..n], &target[range][..n])
    }
}

fn mark(i: usize, lane: u16, target: u16, nearest: &mut [u32]) {
    nearest[lane as usize] = i as u32;
    if target != NO_LANE {
        nearest[target as usize] = i as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::TrafficConfig;
    use super::super::driver::Driver;
    use super::super::workers::InTurn;
    use super::*;

    #[test]
    fn those_who_act_find_whom_they_find_where_all_act() {
        let map = LaneMap::straight(3, 5_000.0, 3.75, 30.0);
        let config = TrafficConfig::default();
        let mut fleet = Fleet::default();
        for k in 0..60_u64 {
            let driver = Driver::draw(&config, 0.2, k, std::iter::empty());
            fleet.insert(40.0 * k as f64, 20.0, (k * k % 3) as u16, k, driver);
        }
        (fleet.target[20], fleet.target[31]) = (1, 1);
        let ego = EgoSpans::default();
        let seen = Seen { fleet: &fleet, map: &map, ego: &ego };
        let found = |act: &Range<usize>, piece: usize| {
            let mut near = Neighbourhood::default();
            near.find(seen, &(0..60), act, &InTurn, piece, |i| i % 4 != 0);
            near.sides[act.clone()].to_vec()
        };
        let all = found(&(0..60), 100);
        assert!(all.iter().any(|s| s.leader[LEFT] == 31 || s.leader[RIGHT] == 31));
        for act in [0..60, 0..7, 18..33, 25..26, 50..60] {
            for piece in [100, 4] {
                assert_eq!(found(&act, piece), all[act.clone()], "{act:?}, pieces of {piece}");
            }
        }
    }
}
