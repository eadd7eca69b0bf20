//! The layouts of an observation, each with the one line that its hash is made of.

use super::frame::{Observer, SIZE, scaled};
use serde::{Deserialize, Serialize};
use tractrix_core::Maneuver;

/// Numbers that [`ObservationSpec::Tractrix1`] adds to the paper's.
pub const OWN: usize = 21;
/// Times of the profile of the reference speed, s from now.
pub const PROFILE_S: [f64; 3] = [1.0, 2.0, 3.0];
/// A vehicle further ahead than this is not seen, m.
const AHEAD_M: f64 = 200.0;

/// Which numbers a decider sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObservationSpec {
    /// The paper's 216.
    Paper216,
    /// The paper's 216 and what they leave out: what the truck is doing, whether the gate would
    /// pass a change, who is ahead beyond 100 m, what the truck wishes and can.
    #[default]
    Tractrix1,
}

/// A vehicle ahead in a lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Gap from the ego's front to its rear, m.
    pub gap_m: f64,
    /// Its speed, m/s.
    pub speed_m_s: f64,
}

/// What an observation is made of. [`crate::Tactics::observed`] fills it.
#[derive(Debug, Clone, Copy)]
pub struct Observed<'a> {
    /// The frames of the last three seconds.
    pub frames: &'a Observer,
    /// What is being driven.
    pub maneuver: Maneuver,
    /// The part of a change or of its way back that is driven, 0 to 1.
    pub progress_frac: f64,
    /// Through lanes to the right of the truck's and to its left.
    pub lanes: [u16; 2],
    /// Own speed, m/s.
    pub speed_m_s: f64,
    /// Own acceleration, m/s².
    pub accel_m_s2: f64,
    /// The safety gate would pass a change to the left, to the right.
    pub passes: [bool; 2],
    /// Who is ahead in the own lane, in the one on the left, in the one on the right.
    pub ahead: [Option<Seen>; 3],
    /// The speed that the truck would drive without others, m/s.
    pub wish_speed_m_s: f64,
    /// Mass of the combination, kg.
    pub mass_kg: f64,
    /// Largest engine power less what the present speed takes on the present grade, W.
    pub power_reserve_w: f64,
    /// The reference speed at [`PROFILE_S`] for a truck that drives at it, m/s.
    pub profile_m_s: [f64; 3],
}

impl ObservationSpec {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Paper216, Self::Tractrix1];

    /// Numbers in an observation.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::Paper216 => SIZE,
            Self::Tractrix1 => SIZE + OWN,
        }
    }

    /// The layout in one line; changing the layout means changing this line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Paper216 => {
                "tractrix-observation-1: 4 frames (0,1,2,3 s ago) x 9 rows (ego, 2 behind <= 50 m, \
6 ahead <= 100 m, nearest first) x 6 columns (presence, dx/100 m, right/8 m, v/40 m/s, \
v_right/40 m/s, v_ref(s + v i 3/8 s)/40 m/s), clipped to -1..1"
            }
            Self::Tractrix1 => {
                "tractrix-observation-2: the 216 of tractrix-observation-1, then change left, right, \
abort, its part; through lanes right/3, left/3; a/3 m/s2; gate passes left, right; ahead in the \
own, left, right lane gap/200 m (1: nobody), (v - own)/40 m/s; wish/40 m/s; mass/80 t; power \
reserve/500 kW; v_ref in 1, 2, 3 s/40 m/s, clipped to -1..1"
            }
        }
    }

    /// Hash of the layout: FNV-1a, 64 bit, of [`Self::text`]. It guards against mistakes, not
    /// against attack.
    #[must_use]
    pub const fn hash(self) -> u64 {
        let bytes = self.text().as_bytes();
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut i = 0;
        while i < bytes.len() {
            hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0100_0000_01b3);
            i += 1;
        }
        hash
    }

    /// Writes an observation into the first [`Self::size`] numbers of `out`.
    ///
    /// # Panics
    /// If `out` is shorter.
    pub fn write(self, observed: &Observed<'_>, out: &mut [f32]) {
        let (frames, own) = out[..self.size()].split_at_mut(SIZE);
        observed.frames.write(frames);
        if self == Self::Tractrix1 {
            own.copy_from_slice(&observed.own());
        }
    }
}

impl Observed<'_> {
    /// What [`ObservationSpec::Tractrix1`] adds.
    fn own(&self) -> [f32; OWN] {
        let is = |maneuver: Maneuver| scaled(f64::from(u8::from(self.maneuver == maneuver)), 1.0);
        let flag = |set: bool| scaled(f64::from(u8::from(set)), 1.0);
        let seen = |ahead: Option<Seen>| {
            let ahead = ahead.filter(|n| n.gap_m < AHEAD_M);
            ahead.map_or((1.0, 0.0), |n| {
                (scaled(n.gap_m, AHEAD_M), scaled(n.speed_m_s - self.speed_m_s, 40.0))
            })
        };
        let [own, left, right] = self.ahead.map(seen);
        let profile = self.profile_m_s.map(|v| scaled(v, 40.0));
        [
            is(Maneuver::ChangeLeft),
            is(Maneuver::ChangeRight),
            is(Maneuver::AbortChange),
            scaled(self.progress_frac, 1.0),
            scaled(f64::from(self.lanes[0]), 3.0),
            scaled(f64::from(self.lanes[1]), 3.0),
            scaled(self.accel_m_s2, 3.0),
            flag(self.passes[0]),
            flag(self.passes[1]),
            own.0,
            own.1,
            left.0,
            left.1,
            right.0,
            right.1,
            scaled(self.wish_speed_m_s, 40.0),
            scaled(self.mass_kg, 80_000.0),
            scaled(self.power_reserve_w, 500_000.0),
            profile[0],
            profile[1],
            profile[2],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::FRAME;
    use super::*;

    #[test]
    fn the_papers_layout_keeps_the_hash_that_its_weights_carry() {
        assert_eq!(ObservationSpec::Paper216.hash(), 0xcdfb_7080_9ae9_0be6);
        assert_eq!(ObservationSpec::Paper216.size(), 216);
        assert_ne!(ObservationSpec::Tractrix1.hash(), ObservationSpec::Paper216.hash());
    }

    #[test]
    fn our_layout_equals_numbers_by_hand() {
        let mut frames = Observer::new(1.0);
        frames.push([0.25; FRAME]);
        let observed = Observed {
            frames: &frames,
            maneuver: Maneuver::ChangeRight,
            progress_frac: 0.25,
            lanes: [1, 2],
            speed_m_s: 20.0,
            accel_m_s2: -0.75,
            passes: [true, false],
            ahead: [
                Some(Seen { gap_m: 50.0, speed_m_s: 16.0 }),
                Some(Seen { gap_m: 210.0, speed_m_s: 30.0 }),
                None,
            ],
            wish_speed_m_s: 22.0,
            mass_kg: 40_000.0,
            power_reserve_w: -125_000.0,
            profile_m_s: [20.0, 19.0, 18.0],
        };
        let mut x = [f32::NAN; SIZE + OWN];
        ObservationSpec::Tractrix1.write(&observed, &mut x);
        let third = 1.0_f64 / 3.0;
        let by_hand = [
            0.0,
            1.0,
            0.0,
            0.25,
            third,
            2.0 * third,
            -0.25,
            1.0,
            0.0,
            0.25,
            -0.1,
            1.0,
            0.0,
            1.0,
            0.0,
            0.55,
            0.5,
            -0.25,
            0.5,
            0.475,
            0.45,
        ];
        for (i, (is, hand)) in x[SIZE..].iter().zip(by_hand).enumerate() {
            assert!((f64::from(*is) - hand).abs() < 1e-6, "number {i}: {is}, by hand {hand}");
        }
        let mut paper = [f32::NAN; SIZE];
        ObservationSpec::Paper216.write(&observed, &mut paper);
        assert_eq!(paper, x[..SIZE]);
        assert_eq!((paper[0], paper[FRAME]), (0.25, 0.0));
    }
}
