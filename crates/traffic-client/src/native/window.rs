//! Traffic that acts at its full rate around the ego alone ([`WindowConfig`]).
//!
//! Vehicles in the window act in every tick, as on the whole road. Those beyond it are the same
//! drivers with the same arrivals and departures, but they act once in [`FAR_TICKS`]: they look,
//! judge, decide and then move with that acceleration until they look again. So what reaches the
//! window has come about in traffic, congestion too, and nothing has to be put in at its edges.
//! A few vehicles next to the window are moved with it, so that those at its edge see whom they
//! follow. Who is in the window is settled whenever all act; it holds until then.
//!
//! On request those far away do not act at all ([`WindowConfig::awake_m`], [`super::asleep`]).

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::changes::DECISION_TICKS;
use super::engine::{Engine, TICK_S};

/// Vehicles beyond the window act once in so many ticks: as often as drivers think about lane
/// changes. (With twice as many a congested road lost 3 % of its speed.)
pub(super) const FAR_TICKS: u64 = DECISION_TICKS;

/// How far around the ego vehicles act in every tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindowConfig {
    /// So far behind the ego's reference point, m; at least the radius of scenes.
    pub behind_m: f64,
    /// So far ahead of it, m; at least the radius of scenes.
    pub ahead_m: f64,
    /// Farther than this from it, either way, vehicles drive on at the speed that they have, m; at
    /// least as far as the window. `None`: they act everywhere. Only on a road that is the same all
    /// along, and in free traffic: a queue does not go on growing there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub awake_m: Option<f64>,
}

impl Default for WindowConfig {
    /// The radius of scenes behind, and room for the leaders of those in it ahead.
    fn default() -> Self {
        Self { behind_m: 300.0, ahead_m: 400.0, awake_m: None }
    }
}

/// Who is near the ego, by index into the fleet, until all act again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Near {
    /// First and one past the last that acts.
    acts: (usize, usize),
    /// The same of those that are moved: a few more on both sides.
    moves: (usize, usize),
    /// The same of those that act at all.
    awake: (usize, usize),
    /// The tick in which all act again.
    until: u64,
}

/// How long a vehicle goes on until it acts again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stride {
    pub(super) step_s: f64,
    /// Every one judges anew, not only those whose turn it is.
    pub(super) is_far: bool,
}

impl Stride {
    pub(super) const TICK: Self = Self { step_s: TICK_S, is_far: false };
    pub(super) const FAR: Self = Self { step_s: TICK_S * FAR_TICKS as f64, is_far: true };
}

impl Engine {
    /// Those that act in this tick; settles who is near when all do.
    pub(super) fn settle(&mut self) -> Range<usize> {
        let all = 0..self.state.fleet.len();
        let (Some(window), Some(ego_s_m)) = (self.config.window, self.ego_s_m) else {
            return all;
        };
        if let Some(near) = self.state.near.filter(|near| self.state.tick < near.until) {
            return near.acts.0..near.acts.1;
        }
        let s_m = &self.state.fleet.s_m;
        let within = |behind_m: f64, ahead_m: f64| {
            let first = s_m.partition_point(|&s| s < ego_s_m - behind_m);
            first..s_m.partition_point(|&s| s <= ego_s_m + ahead_m)
        };
        let near = within(window.behind_m, window.ahead_m);
        let moves = self.and_a_few_more(near.clone());
        let awake = window.awake_m.map_or(all, |awake_m| {
            let awake = within(awake_m, awake_m);
            awake.start.min(moves.start)..awake.end.max(moves.end)
        });
        self.state.near = Some(Near {
            acts: (near.start, near.end),
            moves: (moves.start, moves.end),
            awake: (awake.start, awake.end),
            until: self.state.tick + FAR_TICKS,
        });
        awake
    }

    /// A range with those next to it, whom who is in it follows.
    fn and_a_few_more(&self, range: Range<usize>) -> Range<usize> {
        let more = (2 * self.map.lanes.len()).clamp(4, 12);
        range.start.saturating_sub(more)..(range.end + more).min(self.state.fleet.len())
    }

    /// Those that who acts looks at.
    pub(super) fn looked_at(&self, acting: &Range<usize>) -> Range<usize> {
        if *acting == self.near() { self.present() } else { self.and_a_few_more(acting.clone()) }
    }

    /// Those that act, some of them less often.
    pub(super) fn awake(&self) -> Range<usize> {
        self.state.near.map_or(0..self.state.fleet.len(), |near| near.awake.0..near.awake.1)
    }

    /// Those that act at the full rate.
    pub(super) fn near(&self) -> Range<usize> {
        self.state.near.map_or(0..self.state.fleet.len(), |near| near.acts.0..near.acts.1)
    }

    /// Those whose stations are those of this tick.
    pub(super) fn present(&self) -> Range<usize> {
        self.state.near.map_or(0..self.state.fleet.len(), |near| near.moves.0..near.moves.1)
    }

    /// Whether the coming tick is one for all.
    pub(super) fn is_for_all(&self) -> bool {
        self.state.near.is_none_or(|near| self.state.tick + 1 >= near.until)
    }
}
