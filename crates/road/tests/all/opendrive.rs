//! The OpenDRIVE reader on hand-made maps: every record, junctions, routes, errors, writing.
#![expect(clippy::unwrap_used, reason = "a test may fail")]

use road::opendrive::{Heading, JumpKind, Network, RouteChoice};
use road::{LaneEnd, LaneKind, Road, builtin};

const ALL: &str = include_str!("../fixtures/all_records.xodr");
const COMMON: &str = include_str!("../fixtures/common_junction.xodr");
const DIRECT: &str = include_str!("../fixtures/direct_junction.xodr");

fn read(text: &str) -> Network {
    Network::parse("map.xodr", text).unwrap()
}

fn near(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b}");
}

#[test]
fn heights_bank_offsets_and_widths_are_those_of_the_records() {
    let network = read(ALL);
    let road = &network.roads[0];
    assert_eq!((road.name.as_str(), road.id.as_str()), ("everything & more", "7"));
    assert!(network.header.geo_reference.projection.starts_with("+proj=tmerc"));
    let k = road.line.at(300.0);
    near(k.z_m, 104.0 + 2.0 - 1.0, 1e-12);
    near(k.slope, 0.0, 1e-12);
    near(road.line.at(200.0).bank_rad, -0.02, 1e-12);
    near(road.line.at(260.0).bank_rad, -0.03, 1e-12);
    // Width of lane -2: 3.75 (3 u² - 2 u³), half open at 50 m.
    let (inner, outer) = road.lane_edges_m(0, -2, 50.0).unwrap();
    near(inner, -3.75, 1e-12);
    near(outer, -3.75 - 1.875, 1e-12);
    // Lane offset 0.0003 u² - 0.000002 u³ at u = 50, borders beside it.
    let offset = 0.0003 * 2_500.0 - 0.000_002 * 125_000.0;
    assert_eq!(road.lane_edges_m(1, -2, 350.0).unwrap(), (offset - 3.75, offset - 7.5));
    assert_eq!(road.lane_edges_m(1, 1, 450.0).unwrap(), (1.0, 4.5));
}

#[test]
fn the_place_on_the_earth_goes_with_the_route_and_through_writing() {
    let text = ALL.replace(
        "</geoReference>",
        "</geoReference><offset x=\"4e5\" y=\"-2\" z=\"7\" hdg=\"0.5\"/>",
    );
    let network = read(&text);
    assert!(!network.ignored.contains_key("offset"));
    let route = network.longest_route().unwrap();
    let geo = route.geo_reference().unwrap();
    assert_eq!(geo, &network.header.geo_reference);
    let [x, y, z] = geo.projected_m(10.0, 20.0, 1.0);
    let (sin, cos) = 0.5_f64.sin_cos();
    near(x, 4e5 + 10.0 * cos - 20.0 * sin, 1e-9);
    near(y, -2.0 + 10.0 * sin + 20.0 * cos, 1e-12);
    near(z, 8.0, 1e-12);
    assert_eq!(&read(&network.write_opendrive()).header.geo_reference, geo);
    assert_eq!(read(COMMON).longest_route().unwrap().geo_reference(), None);
    let bad = ALL
        .replace("</geoReference>", "</geoReference><offset x=\"a\" y=\"0\" z=\"0\" hdg=\"0\"/>");
    let error = Network::parse("map.xodr", &bad).unwrap_err().to_string();
    assert!(error.contains("<offset>") && error.contains("x = \"a\""), "{error}");
}

#[test]
fn speed_records_are_read_with_their_units_and_the_lanes_win_over_the_roads() {
    let network = read(ALL);
    let road = &network.roads[0];
    near(road.road_limit_m_s(10.0).unwrap(), 120.0 / 3.6, 1e-12);
    near(road.road_limit_m_s(450.0).unwrap(), 50.0 * 0.447_04, 1e-12);
    assert_eq!(road.road_limit_m_s(650.0), Some(f64::INFINITY));
    let route = network.longest_route().unwrap();
    let left = route.lane_at(50.0, -1.8).unwrap();
    near(route.lane_speed_limit_m_s(left, 50.0), 80.0 / 3.6, 1e-12);
    near(route.lane_speed_limit_m_s(left, 200.0), 30.0, 1e-12);
    near(route.lane_speed_limit_m_s(left, 350.0), 120.0 / 3.6, 1e-12);
    near(route.lane_speed_limit_m_s(left, 450.0), 22.352, 1e-12);
}

#[test]
fn what_is_not_read_is_counted_by_name() {
    let network = read(ALL);
    assert_eq!(network.unsupported["shape"], (1, 28));
    assert_eq!(network.unsupported["height"].0, 1);
    assert_eq!(network.objects["object:tree"], 2);
    assert_eq!(network.objects["signal:274"], 1);
    let route = network.longest_route().unwrap();
    assert!(route.in_tunnel(500.0) && !route.in_tunnel(440.0) && !route.in_tunnel(580.0));
}

#[test]
fn driving_a_road_against_its_s_turns_everything_round() {
    let network = read(ALL);
    let choice = RouteChoice { start: Some(("7".into(), Heading::Backward)), via: Vec::new() };
    let (back, there) = (network.route(&choice).unwrap(), &network.roads[0].line);
    near(back.length_m(), there.length_m(), 1e-9);
    for s in [10.0, 150.0, 333.0, 460.0, 655.0] {
        let (p, k) = (back.at(back.length_m() - s, 0.0), there.at(s));
        near(p.x_m, k.x_m, 1e-8);
        near(p.y_m, k.y_m, 1e-8);
        near(p.z_m, k.z_m, 1e-9);
        near(p.curvature_1_m, -k.curvature_1_m, 1e-7);
        near(libm::tan(p.grade_rad), -k.slope, 1e-9);
        near(p.bank_rad, -k.bank_rad, 1e-9);
        near(libm::cos(p.heading_rad - k.heading_rad), -1.0, 1e-12);
    }
    // Lane 1 lies left of the reference line along s, so right of it as driven.
    let lane = back.lane_at(back.length_m() - 100.0, -1.75).unwrap();
    near(back.lanes()[usize::from(lane)].center_d_m(back.length_m() - 100.0), -1.75, 1e-9);
    assert_eq!(back.lanes().len(), 1);
}

#[test]
fn the_through_way_of_a_common_junction_keeps_its_lanes() {
    let network = read(COMMON);
    let road = network.longest_route().unwrap();
    near(road.length_m(), 1_500.0, 1e-6);
    // The road after the junction is drawn backwards.
    let p = road.at(1_400.0, -1.75);
    near(p.x_m, 1_400.0, 1e-6);
    near(libm::cos(p.heading_rad), 1.0, 1e-12);
    near(p.z_m, 9.0 - 1.0, 1e-6);
    near(libm::tan(p.grade_rad), 0.01, 1e-9);
    let through: Vec<_> =
        road.lanes().iter().filter(|l| l.s_start_m == 0.0 && l.s_end_m > 1_499.0).collect();
    assert_eq!(through.len(), 2, "both lanes run through: {:?}", road.lanes());
    assert!(through.iter().all(|l| l.kind == LaneKind::Driving && l.end == LaneEnd::Continues));
    let exit = road.lanes().iter().find(|l| l.kind == LaneKind::Exit).unwrap();
    assert_eq!((exit.s_end_m, exit.end), (500.0, LaneEnd::Leaves));
}

#[test]
fn an_exit_through_a_junction_is_one_continuous_road() {
    for (text, ramp, end, length) in
        [(COMMON, "4", "6", 500.0 + 200.0 + 50.0), (DIRECT, "3", "3", 300.0 + 150.0)]
    {
        let network = read(text);
        let choice = RouteChoice {
            start: Some(("1".into(), Heading::Forward)),
            via: vec![ramp.into(), end.into()],
        };
        let road = network.route(&choice).unwrap();
        let lane = road.lane_at(10.0, -8.75).unwrap();
        let track = &road.lanes()[usize::from(lane)];
        assert_eq!(track.sources.last().unwrap().road, end);
        near(track.s_end_m, road.length_m(), 1e-9);
        // The reference line leaves the ramp's line by 7 m: longer outside the right-hand curve.
        assert!(road.length_m() > length && road.length_m() < length + 7.0 * 0.9);
        let mut before = road.at(0.0, track.center_d_m(0.0));
        let mut s = 0.25;
        while s < road.length_m() {
            let p = road.at(s, track.center_d_m(s));
            let step = (p.x_m - before.x_m).hypot(p.y_m - before.y_m);
            assert!(step < 0.26, "jump of {step} m at {s}");
            assert!((p.heading_rad - before.heading_rad).abs() < 0.01);
            before = p;
            s += 0.25;
        }
        // The ramp's lane centre lies on the ramp, 1.75 m right of the ramp's own line.
        let own = network.road(end).unwrap().line.at(40.0);
        let (x, y) =
            (own.x_m + 1.75 * own.heading_rad.sin(), own.y_m - 1.75 * own.heading_rad.cos());
        let at = road.project(x, y, None).unwrap();
        near(at.d_m, track.center_d_m(at.s_m), 1e-6);
    }
}

#[test]
fn the_through_way_of_a_direct_junction_drops_the_exit_lane() {
    let road = read(DIRECT).longest_route().unwrap();
    near(road.length_m(), 700.0, 1e-6);
    assert_eq!(road.lanes().len(), 3);
    assert_eq!(road.lanes()[0].end, LaneEnd::Leaves);
    assert_eq!(road.lanes_at(299.0).count(), 3);
    assert_eq!(road.lanes_at(301.0).count(), 2);
    assert_eq!(road.right_of(1, 200.0), Some(0));
    assert_eq!(road.right_of(1, 301.0), None);
    assert_eq!(road.left_of(1, 301.0), Some(2));
}

#[test]
fn the_nearest_lane_is_found_over_the_whole_network() {
    let network = read(COMMON);
    let at = network.nearest_lane(550.0, -5.0).unwrap();
    assert_eq!((network.roads[at.road].id.as_str(), at.lane, at.outside_m), ("3", -1, 0.0));
    let at = network.nearest_lane(1_000.0, -1.0).unwrap();
    assert_eq!((network.roads[at.road].id.as_str(), at.lane), ("5", 1));
    // Lane 2 of road 5 is driven against s: lane 1 is on its left.
    let right = network.nearest_lane(1_000.0, -8.0);
    assert!(right.is_some());
    assert_eq!(network.neighbours(&at).0, None);
    assert!(network.nearest_lane(5_000.0, 5_000.0).is_none());
}

#[test]
fn jumps_in_a_map_are_reported_with_place_and_size() {
    let clean = read(DIRECT).check();
    assert!(clean.jumps.is_empty(), "{:?}", clean.jumps);
    assert_eq!(clean.broken_links, Vec::<String>::new());
    let shifted = DIRECT.replace("x=\"300\" y=\"0\"", "x=\"300\" y=\"0.5\"");
    let report = read(&shifted).check();
    assert_eq!(report.jump_counts[&JumpKind::PositionM], 2);
    near(report.largest_jump[&JumpKind::PositionM], 0.5, 1e-9);
    assert_eq!(report.jumps[0].to_road.as_deref(), Some("2"));
    let broken = DIRECT.replace("linkedRoad=\"3\"", "linkedRoad=\"33\"");
    assert!(read(&broken).check().broken_links[0].contains("33"));
}

#[test]
fn a_bad_element_is_named_with_file_line_and_value() {
    let cases = [
        ("curvature=\"0.002\"", "curvature=\"NaN\"", "<arc>: curvature = \"NaN\""),
        ("curvature=\"0.002\"", "curv=\"1\"", "<arc>: curvature is missing"),
        ("<line/>", "<circle/>", "<geometry>: needs one of"),
        ("unit=\"mph\"", "unit=\"knots\"", "<speed>: unit = \"knots\""),
        ("<lane id=\"-3\"", "<lane id=\"-2\"", "<lane>: id = -2 is used twice"),
        ("<lane id=\"1\"", "<lane id=\"-1\"", "<lane>: id = -1 under <left>"),
        ("revMajor=\"1\"", "revMajor=\"2\"", "<header>: revision 2.7"),
        ("pRange=\"normalized\"", "pRange=\"half\"", "<paramPoly3>: pRange"),
        ("length=\"700\"", "length=\"-700\"", "<road>: length = -700 is negative"),
        ("</lateralProfile>", "</lateral>", "<xml>"),
    ];
    for (from, to, expected) in cases {
        let text = ALL.replacen(from, to, 1);
        let error = Network::parse("a.xodr", &text).unwrap_err().to_string();
        let line = ALL[..ALL.find(from).unwrap()].lines().count();
        assert!(error.starts_with(&format!("a.xodr: line {line}: {expected}")), "{error}");
    }
    let error = Network::load("/nowhere/a.xodr").unwrap_err().to_string();
    assert!(error.starts_with("/nowhere/a.xodr: "), "{error}");
}

#[test]
fn a_licence_comment_before_the_declaration_is_tolerated_and_lines_keep_their_numbers() {
    let text = format!("<!-- licence\n -->\n{ALL}");
    assert!(Network::parse("a.xodr", &text).is_ok());
    let error = Network::parse("a.xodr", &text.replace("<line/>", "")).unwrap_err().to_string();
    assert!(error.contains("line 14: <geometry>"), "{error}");
}

#[test]
fn a_network_written_and_read_again_is_the_same() {
    for text in [ALL, COMMON, DIRECT] {
        let network = read(text);
        let again = read(&network.write_opendrive());
        assert_eq!(again.roads.len(), network.roads.len());
        assert_eq!(again.junctions.len(), network.junctions.len());
        for (a, b) in network.roads.iter().zip(&again.roads) {
            assert_eq!((&a.plan, &a.line, &a.lane_offset), (&b.plan, &b.line, &b.lane_offset));
            assert_eq!((&a.predecessor, &a.successor), (&b.predecessor, &b.successor));
            for (a, b) in a.sections.iter().zip(&b.sections) {
                for (l, m) in a.lanes.iter().zip(&b.lanes) {
                    assert_eq!((l.id, &l.kind, &l.outline), (m.id, &m.kind, &m.outline));
                }
            }
        }
        let (a, b) = (network.longest_route().unwrap(), again.longest_route().unwrap());
        same_road(&a, &b);
    }
}

#[test]
fn a_built_in_road_written_as_opendrive_and_read_again_is_the_same() {
    for road in [builtin::highway(), builtin::test_site(), builtin::flat(3_000.0)] {
        let again = read(&road.write_opendrive()).longest_route().unwrap();
        same_road(&road, &again);
        assert!(road.geo_reference().is_some() && road.geo_reference() == again.geo_reference());
    }
}

fn same_road(a: &Road, b: &Road) {
    near(a.length_m(), b.length_m(), 1e-6);
    let mut s = 0.0;
    while s < a.length_m() {
        let (p, q) = (a.at(s, -5.0), b.at(s, -5.0));
        near(p.x_m, q.x_m, 1e-6);
        near(p.y_m, q.y_m, 1e-6);
        near(p.z_m, q.z_m, 1e-6);
        near(p.curvature_1_m, q.curvature_1_m, 1e-7);
        let lanes = |r: &Road| -> Vec<(f64, f64, LaneKind, f64)> {
            r.lanes_at(s)
                .map(|l| {
                    let limit = r.lane_speed_limit_m_s(l.id, s);
                    (l.center_d_m(s), l.width_m(s), l.kind, limit)
                })
                .collect()
        };
        let (here, there) = (lanes(a), lanes(b));
        assert_eq!(here.len(), there.len(), "lanes at {s}");
        for (l, m) in here.iter().zip(&there) {
            near(l.0, m.0, 1e-6);
            near(l.1, m.1, 1e-6);
            assert_eq!((l.2, l.3), (m.2, m.3), "at {s}");
        }
        s += 7.3;
    }
}
