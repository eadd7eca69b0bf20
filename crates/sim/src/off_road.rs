//! Whether a wheel has left the paved lanes.
//!
//! Paved is every lane of any kind, hard shoulders included ([`Road::is_paved`]); a wheel is where
//! its centre line (of twins: the pair's) is. Axles lie where the truck file has them, all wheels of
//! a group are looked at. The wheels' offsets are taken across the road at the axle group's centre:
//! a group is a few metres long, over which no highway's lane bends away by a centimetre.

use dynamics::TruckModel;
use road::Road;
use tractrix_core::{EgoState, Geometry};

/// An axle group: half its track and half its length, m.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Group {
    half_track_m: f64,
    half_spread_m: f64,
}

/// What the bound of where the wheels are leaves for rounding and bank, m.
const MARGIN_M: f64 = 0.1;

/// Watches the wheels of a truck and counts how often and how long one is off the road.
#[derive(Debug, Clone)]
pub struct OffRoad {
    geometry: Geometry,
    groups: [Group; 3],
    off: bool,
    events: u32,
    time_s: f64,
}

impl OffRoad {
    /// Watches the wheels of this truck.
    #[must_use]
    pub fn new(model: &TruckModel) -> Self {
        let lateral = &model.parameters().lateral;
        let spreads =
            [0.0, lateral.tractor.drive_half_spread_m, lateral.trailer.axle_half_spread_m];
        let tracks = lateral.load_transfer.track_m;
        let group = |i: usize| Group { half_track_m: 0.5 * tracks[i], half_spread_m: spreads[i] };
        Self {
            geometry: model.geometry(),
            groups: [group(0), group(1), group(2)],
            off: false,
            events: 0,
            time_s: 0.0,
        }
    }

    /// Looks at the wheels; `dt_s` is the time since the last look. Whether one is off the road.
    /// Station and offset are those of the place on the map, zero where there are none.
    pub fn watch(&mut self, ego: &EgoState, road: &Road, dt_s: f64) -> bool {
        let before = self.off;
        self.off = !self.is_surely_on(ego, road) && self.is_off(ego, road);
        if self.off {
            self.time_s += if before { dt_s } else { 0.0 };
            self.events += u32::from(!before);
        }
        self.off
    }

    /// Times that a wheel has left the road.
    #[must_use]
    pub const fn events(&self) -> u32 {
        self.events
    }

    /// Time with a wheel off the road, s.
    #[must_use]
    pub const fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Whether a wheel is off the road now.
    #[must_use]
    pub const fn is_off_now(&self) -> bool {
        self.off
    }

    /// Whether a bound of how far aside the wheels are says that all are on lanes that run along the
    /// whole road: nearly always, at a part of the cost of looking at each axle group.
    fn is_surely_on(&self, ego: &EgoState, road: &Road) -> bool {
        let Some((right_m, left_m)) = road.paved_throughout_m() else { return false };
        let (g, line) = (&self.geometry, road.line());
        let to_hitch_m = g.hitch_ahead_m.abs();
        let behind_m = to_hitch_m + g.hitch_to_trailer_axle_m;
        let widest_m = right_m.abs().max(left_m.abs());
        // The road turns by no more than this per metre driven, however far aside.
        let bend_1_m = 1.2 * line.curved_anywhere_at_most_1_m();
        let is_inside = ego.s_m > behind_m && ego.s_m + g.wheelbase_m < road.length_m();
        if !(is_inside && bend_1_m * widest_m < 0.1) {
            return false;
        }
        let tractor_rad = (ego.yaw_rad - line.heading_rad(ego.s_m)).abs();
        let trailer_rad = tractor_rad + ego.trailer.articulation_rad.abs();
        // From the reference point each metre leads aside by the angle to the road that is there.
        let aside_m =
            |length_m: f64, turned_rad: f64| length_m * (turned_rad + bend_1_m * length_m);
        let off_m = [
            aside_m(g.wheelbase_m, tractor_rad),
            0.0,
            aside_m(to_hitch_m, tractor_rad) + aside_m(behind_m, trailer_rad),
        ];
        let groups = self.groups.iter().zip(off_m).zip([tractor_rad, tractor_rad, trailer_rad]);
        groups.into_iter().all(|((group, off_m), turned_rad)| {
            let turned_rad = turned_rad + bend_1_m * (behind_m + g.wheelbase_m);
            let half_m = group.half_track_m + group.half_spread_m * turned_rad;
            let reach_m = off_m + half_m + MARGIN_M;
            ego.d_m - reach_m > right_m && ego.d_m + reach_m < left_m
        })
    }

    fn is_off(&self, ego: &EgoState, road: &Road) -> bool {
        let g = &self.geometry;
        let (sin, cos) = libm::sincos(ego.yaw_rad);
        let trailer_yaw_rad = ego.yaw_rad + ego.trailer.articulation_rad;
        let (sin_t, cos_t) = libm::sincos(trailer_yaw_rad);
        let centres = [
            (g.wheelbase_m * cos, g.wheelbase_m * sin, ego.yaw_rad, g.wheelbase_m),
            (0.0, 0.0, ego.yaw_rad, 0.0),
            (
                g.hitch_ahead_m * cos - g.hitch_to_trailer_axle_m * cos_t,
                g.hitch_ahead_m * sin - g.hitch_to_trailer_axle_m * sin_t,
                trailer_yaw_rad,
                g.hitch_ahead_m - g.hitch_to_trailer_axle_m,
            ),
        ];
        self.groups.iter().zip(centres).any(|(group, (x, y, yaw_rad, ahead_m))| {
            let at = road.project(ego.x_m + x, ego.y_m + y, Some(ego.s_m + ahead_m));
            // Further from the road than can be projected.
            let Some(at) = at else { return true };
            let (sin, cos) = libm::sincos(yaw_rad - road.line().heading_rad(at.s_m));
            let half_m = group.half_track_m * cos.abs() + group.half_spread_m * sin.abs();
            !road.is_paved(at.s_m, at.d_m + half_m) || !road.is_paved(at.s_m, at.d_m - half_m)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynamics::TruckParameters;

    fn watched() -> (OffRoad, Road) {
        let model = TruckModel::new(TruckParameters::load("sinotruk").unwrap(), 0.0).unwrap();
        (OffRoad::new(&model), road::builtin::flat(2_000.0))
    }

    /// Straight along the flat road, which lies on the x axis: two lanes of 3.75 m.
    fn ego(d_m: f64, yaw_rad: f64, articulation_rad: f64) -> EgoState {
        let mut ego =
            EgoState { x_m: 500.0, y_m: d_m, s_m: 500.0, d_m, yaw_rad, ..EgoState::default() };
        ego.trailer.articulation_rad = articulation_rad;
        ego
    }

    #[test]
    fn the_steer_axle_with_its_wider_track_leaves_first() {
        let (mut wheels, road) = watched();
        // The left border is at 3.75 m, the steer axle's wheels 1.02 m from the middle.
        assert!(!wheels.watch(&ego(2.72, 0.0, 0.0), &road, 0.01));
        assert!(wheels.watch(&ego(2.74, 0.0, 0.0), &road, 0.01));
        assert!(wheels.watch(&ego(-2.74, 0.0, 0.0), &road, 0.01));
    }

    #[test]
    fn the_bound_says_yes_only_where_a_look_at_each_axle_group_does() {
        let (wheels, _) = watched();
        let road = road::builtin::highway();
        let (mut sure, mut off) = (0, 0);
        for i in 0..20_000 {
            // spread evenly and without a common period
            let unit = |k: f64| (f64::from(i) * k).fract();
            let (s_m, d_m) = (20.0 + 14_000.0 * unit(0.618_034), 8.0 * unit(0.754_878) - 4.0);
            let at = road.at(s_m, d_m);
            let mut ego = EgoState { s_m, d_m, x_m: at.x_m, y_m: at.y_m, ..EgoState::default() };
            ego.yaw_rad = at.heading_rad + 0.2 * (unit(0.569_840) - 0.5);
            ego.trailer.articulation_rad = 0.2 * (unit(0.854_102) - 0.5);
            let (is_sure, is_off) = (wheels.is_surely_on(&ego, &road), wheels.is_off(&ego, &road));
            assert!(!(is_sure && is_off), "{ego:?}");
            (sure, off) = (sure + u32::from(is_sure), off + u32::from(is_off));
        }
        assert!(sure > 2_000 && off > 2_000, "{sure} {off}");
    }

    #[test]
    fn a_trailer_that_swings_out_alone_counts() {
        let (mut wheels, road) = watched();
        let reach = wheels.geometry.hitch_to_trailer_axle_m;
        let angle = 1.5 / reach;
        // 2.0 m + 1.5 m + half the trailer's track of 1.83 m
        assert!(!wheels.watch(&ego(1.0, 0.0, 0.0), &road, 0.01));
        assert!(wheels.watch(&ego(2.0, 0.0, -angle), &road, 0.01));
    }

    #[test]
    fn an_excursion_is_one_event_and_its_time_is_added_up() {
        let (mut wheels, road) = watched();
        for (k, d_m) in [0.0, 3.0, 3.2, 3.0, 0.0, 0.0, 3.5, 0.0].into_iter().enumerate() {
            let off = wheels.watch(&ego(d_m, 0.0, 0.0), &road, 0.01);
            assert_eq!(off, d_m > 2.73, "{k}");
        }
        assert_eq!(wheels.events(), 2);
        assert!((wheels.time_s() - 0.02).abs() < 1e-12);
        // Far out in the fields there is no road to project to.
        let far = EgoState { y_m: 5e3, s_m: 0.0, ..ego(0.0, 0.0, 0.0) };
        assert!(wheels.watch(&far, &road, 0.01));
    }
}
