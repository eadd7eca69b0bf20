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

/// Neighbours of every vehicle, by index into the fleet. Scratch: not part of the state.
#[derive(Debug, Default)]
pub(crate) struct Neighbourhood {
    /// Lane tracks: own, left, right ([`NO_LANE`] if there is none here).
    pub(crate) lanes: Vec<[u16; 3]>,
    /// Nearest vehicle whose front is ahead.
    pub(crate) leader: Vec<[u32; 3]>,
    /// Nearest vehicle whose front is behind.
    pub(crate) follower: Vec<[u32; 3]>,
    /// Nearest ahead and behind in each lane: memory of a sweep.
    ahead: Vec<u32>,
    behind: Vec<u32>,
}

/// What a sweep over a piece finds.
struct Found<'a> {
    lanes: &'a mut [[u16; 3]],
    leader: &'a mut [[u32; 3]],
    follower: &'a mut [[u32; 3]],
}

/// What a sweep goes over.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub(super) fleet: &'a Fleet,
    pub(super) map: &'a LaneMap,
    pub(super) ego: &'a EgoSpans,
}

impl Neighbourhood {
    /// Finds the neighbours in the own lane, and in the lanes beside of those who `look_aside`
    /// (the others get [`NO_LANE`] there), over a range of the sorted fleet. Of more than one piece,
    /// each first tells who is nearest to its ends, so that the sweep over the next one can begin with them.
    pub(super) fn find(
        &mut self,
        seen: Seen<'_>,
        over: Range<usize>,
        workers: &dyn Workers,
        piece: usize,
        look_aside: impl Fn(usize) -> bool + Sync,
    ) {
        seen.fleet.fit(&mut self.lanes, [NO_LANE; 3]);
        seen.fleet.fit(&mut self.leader, [NOBODY; 3]);
        seen.fleet.fit(&mut self.follower, [NOBODY; 3]);
        let (first, n) = (over.start, over.len());
        // NO_LANE looks at the spare last entry, which stays NOBODY.
        let tracks = seen.map.lanes.len() + 1;
        if n <= piece {
            for nearest in [&mut self.ahead, &mut self.behind] {
                nearest.clear();
                nearest.resize(tracks, NOBODY);
            }
            let found = Found {
                lanes: &mut self.lanes[over.clone()],
                leader: &mut self.leader[over.clone()],
                follower: &mut self.follower[over],
            };
            seen.sweep(first, found, &mut self.ahead, &mut self.behind, &look_aside);
            return;
        }
        let nobody = vec![NOBODY; tracks];
        let ends = in_pieces(workers, ranges(over.clone(), piece), |_, range| {
            let (mut ahead, mut behind) = (nobody.clone(), nobody.clone());
            seen.visit_front_first(range.clone(), &mut ahead, |_, _, _, _| {});
            seen.visit_back_first(range, &mut behind, |_, _, _, _| {});
            (ahead, behind)
        });
        let pieces = n.div_ceil(piece);
        let (mut ahead, mut behind) = (vec![nobody.clone(); pieces], vec![nobody; pieces]);
        for k in (1..pieces).rev() {
            ahead[k - 1] = nearer(&ahead[k], &ends[k].0);
        }
        for k in 1..pieces {
            behind[k] = nearer(&behind[k - 1], &ends[k - 1].1);
        }
        let lanes = self.lanes[over.clone()].chunks_mut(piece);
        let leader = self.leader[over.clone()].chunks_mut(piece);
        let found = leader.zip(self.follower[over].chunks_mut(piece));
        let items = lanes.zip(found).zip(ahead.into_iter().zip(behind));
        in_pieces(workers, items, |k, ((lanes, (leader, follower)), (mut ahead, mut behind))| {
            let found = Found { lanes, leader, follower };
            seen.sweep(first + k * piece, found, &mut ahead, &mut behind, &look_aside);
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
        found: Found<'_>,
        ahead: &mut [u32],
        behind: &mut [u32],
        look_aside: &impl Fn(usize) -> bool,
    ) {
        let Found { lanes, leader, follower } = found;
        let range = from..from + lanes.len();
        // From the front: the last one seen in a lane is the leader of the next one.
        let mut found = lanes.iter_mut().zip(leader).rev();
        self.visit_front_first(range.clone(), ahead, |i, lane, s_m, nearest| {
            let beside =
                if look_aside(i) { self.map.beside(lane, s_m) } else { (NO_LANE, NO_LANE) };
            if let Some((lanes, leader)) = found.next() {
                *lanes = [lane, beside.0, beside.1];
                // Not read back, which would wait for the three to be stored.
                *leader = look(lane, beside.0, beside.1, nearest);
            }
        });
        let mut found = lanes.iter().zip(follower);
        self.visit_back_first(range, behind, |_, _, _, nearest| {
            if let Some((lanes, follower)) = found.next() {
                *follower = look(lanes[OWN], lanes[LEFT], lanes[RIGHT], nearest);
            }
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
        for (i, lane, target, s_m) in self.each(range).rev() {
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
        for (i, lane, target, s_m) in self.each(range) {
            while let Some(span) = next.filter(|e| e.front_m <= s_m) {
                nearest[span.lane as usize] = EGO;
                next = spans.next();
            }
            visit(i, lane, s_m, nearest);
            mark(i, lane, target, nearest);
        }
    }

    /// Index, lane, target and station of those in a range.
    fn each(
        &self,
        range: Range<usize>,
    ) -> impl DoubleEndedIterator<Item = (usize, u16, u16, f64)> + ExactSizeIterator {
        let Fleet { s_m, lane, target, .. } = self.fleet;
        let lanes = lane[range.clone()].iter().zip(&target[range.clone()]);
        let there = range.clone().zip(lanes.zip(&s_m[range]));
        there.map(|(i, ((&lane, &target), &s_m))| (i, lane, target, s_m))
    }
}

fn mark(i: usize, lane: u16, target: u16, nearest: &mut [u32]) {
    nearest[lane as usize] = i as u32;
    if target != NO_LANE {
        nearest[target as usize] = i as u32;
    }
}
