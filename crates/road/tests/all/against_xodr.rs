//! The reader against an independent one, crate `xodr` 0.8, on published maps.
//!
//! `xodr` states points as f32, so a map far from its origin is moved near it first (by writing it
//! again), and the agreement asked for is that of f32 at the size of the map.
#![expect(clippy::disallowed_macros, reason = "prints the figures of docs/results/road.md")]

use crate::common;
use road::opendrive::Network;
use xodr::RoadPosition;

/// Moves a map so that its first point is the origin, without what `xodr` reads and we do not.
fn near_origin(network: &Network) -> Network {
    let mut out = network.clone();
    let (x, y) = (out.roads[0].plan[0].x_m, out.roads[0].plan[0].y_m);
    for e in out.roads.iter_mut().flat_map(|r| &mut r.plan) {
        e.x_m -= x;
        e.y_m -= y;
    }
    out
}

#[test]
fn reference_lines_and_surfaces_agree_with_crate_xodr_on_published_maps() {
    for (name, path) in common::maps() {
        let network = near_origin(&Network::load(&path).unwrap());
        let text = network.write_opendrive();
        let network = Network::parse(&name, &text).unwrap();
        let peer = match xodr::load_str(&text) {
            Ok(peer) => peer,
            Err(e) => {
                println!("{name}: not read by xodr: {e}");
                continue;
            }
        };
        let (mut plan, mut height, mut count, mut size) = (0.0_f64, 0.0_f64, 0, 1.0_f64);
        let mut worst = String::new();
        for road in &network.roads {
            let Some(id) = peer.road_by_od_id(&road.id).map(|r| r.id()) else { continue };
            let mut s = 0.0;
            while s < road.line.length_m() {
                let section = &road.sections[road.section_at(s)];
                let edges = section.lanes.iter().filter(|l| l.is_drivable()).filter_map(|l| {
                    let (a, b) = road.lane_edges_m(road.section_at(s), l.id, s)?;
                    Some(0.5 * (a + b))
                });
                for t in edges.chain([0.0]) {
                    let Some(p) = peer.road_point(RoadPosition { road: id, s, t }) else {
                        continue;
                    };
                    let k = road.line.at(s);
                    let x = k.x_m - t * k.bank_rad.cos() * k.heading_rad.sin();
                    let y = k.y_m + t * k.bank_rad.cos() * k.heading_rad.cos();
                    let z = k.z_m + t * k.bank_rad.sin();
                    let off = (x - f64::from(p.x)).hypot(y - f64::from(p.y));
                    if off > plan {
                        plan = off;
                        worst = format!("road {} s {s:.1} t {t:.2}", road.id);
                    }
                    height = height.max((z - f64::from(p.z)).abs());
                    size = size.max(x.abs()).max(y.abs());
                    count += 1;
                }
                s += 3.0;
            }
        }
        let f32_step = size * f64::from(f32::EPSILON);
        println!(
            "| {name} | {count} | {:.3} | {:.3} | {:.3} | {worst} |",
            plan * 1e3,
            height * 1e3,
            f32_step * 1e3
        );
        assert!(count > 50, "{name}: {count} points compared");
    }
}
