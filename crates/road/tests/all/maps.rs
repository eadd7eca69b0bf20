//! Real and published maps, where the working copy has them beside it.
#![expect(clippy::disallowed_macros, reason = "prints the figures of docs/results/road.md")]

use crate::common;
use road::Road;
use road::opendrive::{JumpKind, Network};

#[test]
fn every_map_is_read_checked_and_becomes_a_smooth_road() {
    for (name, path) in common::maps() {
        let network = Network::load(&path).unwrap();
        let report = network.check();
        let road = Road::load(&path).unwrap();
        let jump = |k: JumpKind| report.largest_jump.get(&k).copied().unwrap_or(0.0);
        println!(
            "| {name} | {} | {:.2} | {:.2} | {} | {:.3} | {:.3} |",
            report.roads,
            report.length_m / 1e3,
            road.length_m() / 1e3,
            road.lanes().len(),
            jump(JumpKind::PositionM),
            jump(JumpKind::HeadingRad),
        );
        assert!(road.length_m() > 200.0);
        let mut before = road.at(0.0, 0.0);
        let mut s = 0.5;
        while s < road.length_m() {
            let p = road.at(s, 0.0);
            let step = (p.x_m - before.x_m).hypot(p.y_m - before.y_m);
            assert!(step < 0.6, "{name}: the reference line jumps by {step} m at {s}");
            assert!(
                [p.z_m, p.heading_rad, p.curvature_1_m, p.grade_rad].iter().all(|v| v.is_finite())
            );
            let back = road.project(p.x_m, p.y_m, Some(s - 1.0)).unwrap();
            assert!((back.s_m - s).abs() < 1e-2 && back.d_m.abs() < 1e-2, "{name} {s} {back:?}");
            before = p;
            s += 0.5;
        }
    }
}
