//! The road view that plant, planner and traffic use: inverse queries, continuity, look-ahead.

#![expect(clippy::unwrap_used, reason = "a test may fail")]

use std::sync::LazyLock;

use proptest::prelude::*;
use road::opendrive::{Heading, Network, RouteChoice};
use road::{LaneKind, ProfilePoint, Road, builtin};

static ROADS: LazyLock<Vec<Road>> = LazyLock::new(|| {
    let junction = include_str!("../fixtures/common_junction.xodr");
    let network = Network::parse("common_junction.xodr", junction).unwrap();
    let ramp = RouteChoice {
        start: Some(("1".into(), Heading::Forward)),
        via: vec!["4".into(), "6".into()],
    };
    let of = |c: &RouteChoice| network.route(c).unwrap();
    vec![
        builtin::highway(),
        builtin::test_site(),
        builtin::flat(5_000.0),
        of(&RouteChoice::default()),
        of(&ramp),
    ]
});

proptest! {
    #![proptest_config(ProptestConfig { cases: 3_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn project_inverts_at(which in 0..5_usize, f in 0.0..1.0_f64, d in -25.0..25.0_f64, off in -80.0..80.0_f64) {
        let road = &ROADS[which];
        let s = f * road.length_m();
        let p = road.at(s, d);
        for hint in [None, Some(s), Some(s + off)] {
            let back = road.project(p.x_m, p.y_m, hint).unwrap();
            prop_assert!((back.s_m - s).abs() < 1e-7, "s {} instead of {s}", back.s_m);
            prop_assert!((back.d_m - d).abs() < 1e-7, "d {} instead of {d}", back.d_m);
        }
    }

    #[test]
    fn heading_grade_and_curvature_are_derivatives_of_the_surface(which in 0..4_usize, f in 0.001..0.999_f64) {
        let road = &ROADS[which];
        let (s, h) = (f * road.length_m(), 1e-3);
        let (a, p, b) = (road.at(s - h, 0.0), road.at(s, 0.0), road.at(s + h, 0.0));
        let (dx, dy) = (b.x_m - a.x_m, b.y_m - a.y_m);
        prop_assert!((dx.hypot(dy) - 2.0 * h).abs() < 1e-9, "s is arc length");
        prop_assert!((dy * p.heading_rad.cos() - dx * p.heading_rad.sin()).abs() < 1e-8);
        // A kink of the slope's own slope or of the curvature's may lie within h.
        prop_assert!(((b.z_m - a.z_m) / (2.0 * h) - p.grade_rad.tan()).abs() < 1e-6);
        prop_assert!(((b.heading_rad - a.heading_rad) / (2.0 * h) - p.curvature_1_m).abs() < 1e-7);
    }

    #[test]
    fn a_lane_holds_its_centre_and_its_neighbours_lie_beside_it(which in 0..5_usize, f in 0.0..1.0_f64) {
        let road = &ROADS[which];
        let s = f * road.length_m();
        let lanes: Vec<_> = road.lanes_at(s).collect();
        prop_assert!(!lanes.is_empty());
        for w in lanes.windows(2) {
            prop_assert!(w[0].center_d_m(s) < w[1].center_d_m(s), "right to left");
        }
        for lane in lanes {
            prop_assert!(lane.exists_at(s));
            prop_assert_eq!(&road.lanes()[usize::from(lane.id)], lane);
            prop_assert_eq!(road.lane_at(s, lane.center_d_m(s)), Some(lane.id));
            if let Some(left) = road.left_of(lane.id, s) {
                prop_assert_eq!(road.right_of(left, s), Some(lane.id));
                let gap = road.lanes()[usize::from(left)].right_edge_d_m(s) - lane.left_edge_d_m(s);
                prop_assert!(gap.abs() <= 0.5);
            }
        }
    }

    #[test]
    fn the_look_ahead_profile_is_the_road_at_its_stations(which in 0..5_usize, f in 0.0..1.0_f64, step in 0.1..300.0_f64) {
        let road = &ROADS[which];
        let s0 = f * road.length_m();
        let mut out = [ProfilePoint::default(); 50];
        road.profile(s0, step, &mut out);
        for (i, p) in out.iter().enumerate() {
            let s = (s0 + i as f64 * step).min(road.length_m());
            let at = road.at(s, 0.0);
            prop_assert_eq!(p.s_m, s);
            prop_assert_eq!((p.z_m, p.grade_rad, p.bank_rad), (at.z_m, at.grade_rad, at.bank_rad));
            prop_assert_eq!(p.curvature_1_m, at.curvature_1_m);
            prop_assert_eq!(p.speed_limit_m_s, road.speed_limit_m_s(s));
        }
    }
}

#[test]
fn bounds_of_a_stretch_hold_at_every_point_of_it_and_are_near_to_it() {
    for road in ROADS.iter() {
        let line = road.line();
        let (mut known, mut stretches) = (0, 0);
        for from_m in (0..).map(|i| 83.7 * f64::from(i)).take_while(|&s| s < road.length_m()) {
            let to_m = from_m + 600.0;
            let points = (0..=6_000).map(|k| from_m + 0.1 * f64::from(k));
            let most_1_m =
                points.clone().map(|s| line.curvature_1_m(s).1.abs()).fold(0.0, f64::max);
            let bound_1_m = line.curved_at_most_1_m(from_m, to_m);
            assert!(most_1_m <= bound_1_m, "{most_1_m} above {bound_1_m} from {from_m} m");
            stretches += 1;
            // The cells at both ends reach 25 m beyond the stretch.
            let beyond = (-250..=6_250).map(|k| from_m + 0.1 * f64::from(k));
            let near_1_m = beyond.map(|s| line.curvature_1_m(s).1.abs()).fold(1e-6, f64::max);
            known += u32::from(bound_1_m < 1.5 * near_1_m);
            for lane in 0..road.lanes().len() as u16 {
                let even = road.even_lane_speed_limit_m_s(lane, from_m, to_m);
                let limits = points.clone().step_by(7).map(|s| road.lane_speed_limit_m_s(lane, s));
                let first_m_s = road.lane_speed_limit_m_s(lane, from_m);
                let is_even = limits.clone().all(|limit| limit == first_m_s);
                assert!(even.is_none_or(|m_s| m_s == first_m_s && is_even), "lane {lane}");
            }
        }
        assert!(2 * known > stretches, "{}: near for {known} of {stretches}", road.name());
    }
}

#[test]
fn stations_beyond_the_ends_are_clamped_and_far_points_have_no_position() {
    let road = builtin::flat(1_000.0);
    assert_eq!(road.at(-50.0, 1.0), road.at(0.0, 1.0));
    assert_eq!(road.at(1e9, 1.0), road.at(1_000.0, 1.0));
    let before = road.project(-20.0, 3.0, Some(0.0)).unwrap();
    assert_eq!((before.s_m, before.d_m), (0.0, 3.0));
    assert_eq!(road.project(500.0, 300.0, None), None);
    assert_eq!(road.project(-300.0, 0.0, None), None);
    assert_eq!(road.project(f64::NAN, 0.0, Some(1.0)), None);
    assert!(road.project(700.0, 2.0, Some(f64::NAN)).is_some());
}

#[test]
fn a_wrong_hint_does_not_lead_to_a_wrong_place() {
    // The highway turns back on itself little enough for one nearest point.
    let road = builtin::highway();
    let p = road.at(9_500.0, 2.0);
    for hint in [0.0, 4_000.0, 9_300.0, 15_000.0] {
        let back = road.project(p.x_m, p.y_m, Some(hint)).unwrap();
        assert!((back.s_m - 9_500.0).abs() < 1e-7, "from {hint}: {}", back.s_m);
    }
}

#[test]
fn the_highway_has_the_lanes_limits_and_curves_that_its_description_names() {
    let road = builtin::highway();
    let kinds = |s: f64| road.lanes_at(s).map(|l| l.kind).collect::<Vec<_>>();
    assert_eq!(kinds(100.0), [LaneKind::Driving; 2]);
    assert_eq!(kinds(7_000.0), [LaneKind::Driving; 3]);
    assert!(kinds(3_000.0).contains(&LaneKind::Entry));
    assert!(kinds(11_200.0).contains(&LaneKind::Exit));
    let limits: Vec<f64> = (0..15).map(|km| road.speed_limit_m_s(f64::from(km) * 1e3)).collect();
    assert!(limits.contains(&25.0) && limits.iter().any(|v| *v < 23.0));
    // Bank lifts the outer side of a curve.
    for s in (0..15_000).map(f64::from) {
        let p = road.at(s, 0.0);
        assert!(p.bank_rad * p.curvature_1_m <= 0.0 && p.grade_rad.abs() < 0.06);
    }
}

#[test]
fn a_part_of_the_view_is_the_same_bits_as_the_whole() {
    for road in
        [builtin::highway(), builtin::highway_sag(), builtin::test_site(), builtin::flat(3e3)]
    {
        for s_m in (-20..).map(|i| 7.3 * f64::from(i)).take_while(|s| *s < road.length_m() + 50.0) {
            let (at, line) = (road.at(s_m, 3.1), road.line());
            assert_eq!(line.heading_rad(s_m).to_bits(), at.heading_rad.to_bits());
            assert_eq!(line.curvature_1_m(s_m).1.to_bits(), at.curvature_1_m.to_bits());
            let surface = road.surface(s_m, 3.1);
            let is = [surface.z_m, surface.grade_rad, surface.bank_rad].map(f64::to_bits);
            assert_eq!(is, [at.z_m, at.grade_rad, at.bank_rad].map(f64::to_bits), "{s_m} m");
            assert!(at.curvature_1_m.abs() <= line.curved_anywhere_at_most_1_m());
        }
    }
}

#[test]
fn what_is_paved_throughout_is_paved_everywhere() {
    // Two lanes of 3.75 m from end to end, on the highway with others beside them in places.
    for road in [builtin::highway(), builtin::flat(3e3)] {
        let (right_m, left_m) = road.paved_throughout_m().unwrap();
        assert!((left_m - right_m - 7.5).abs() < 1e-9, "{right_m} {left_m}");
        for s_m in (0..).map(|i| 7.3 * f64::from(i)).take_while(|s| *s < road.length_m()) {
            for k in 0..=20 {
                let d_m = right_m + f64::from(k) / 20.0 * (left_m - right_m);
                assert!(road.is_paved(s_m, d_m), "{s_m} m, {d_m} m");
            }
        }
    }
}
