//! Damaged maps and profiles: whatever comes in, an answer or an error comes out.

use std::sync::LazyLock;

use proptest::prelude::*;
use road::Road;
use road::opendrive::Network;

const FIXTURES: [&str; 3] = [
    include_str!("../fixtures/all_records.xodr"),
    include_str!("../fixtures/common_junction.xodr"),
    include_str!("../fixtures/direct_junction.xodr"),
];
/// What a damaged number may become.
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1e9",
    "-1e9",
    "1e-300",
    "1e300",
    "NaN",
    "inf",
    "",
    "0x1",
    "1e6",
    "-0",
    "abc",
    "4294967296",
];

/// Byte ranges of all attribute values.
fn values(text: &str) -> Vec<(usize, usize)> {
    let mut quotes = text.match_indices('"').map(|(i, _)| i);
    let mut out = Vec::new();
    while let (Some(a), Some(b)) = (quotes.next(), quotes.next()) {
        out.push((a + 1, b));
    }
    out
}

static VALUES: LazyLock<Vec<Vec<(usize, usize)>>> =
    LazyLock::new(|| FIXTURES.iter().map(|t| values(t)).collect());

/// Reads the map and, if it is one, uses all of it.
fn use_all_of(text: &str) {
    let Ok(network) = Network::parse("fuzz.xodr", text) else { return };
    let report = network.check();
    assert!(report.jumps.len() <= 100);
    let again = Network::parse("again.xodr", &network.write_opendrive());
    assert!(again.is_ok(), "what was read can be written and read: {again:?}");
    let _ = network.nearest_lane(100.0, 50.0);
    if let Ok(road) = network.longest_route() {
        let step = road.length_m() / 40.0;
        for i in 0..=40 {
            let s = f64::from(i) * step;
            let p = road.at(s, -2.0);
            let _ = road.project(p.x_m, p.y_m, Some(s));
            let _ = road.project(p.x_m, p.y_m, None);
            let lane = road.lane_at(s, -2.0);
            let _ = lane.map(|l| {
                (road.left_of(l, s), road.right_of(l, s), road.lane_speed_limit_m_s(l, s))
            });
        }
        let _ = road.write_opendrive();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn attribute_values_may_be_anything(
        which in 0..3_usize,
        hits in prop::collection::vec((any::<prop::sample::Index>(), 0..NUMBERS.len()), 1..4),
    ) {
        let mut text = FIXTURES[which].to_string();
        let mut places: Vec<_> =
            hits.iter().map(|(i, n)| (*i.get(&VALUES[which]), NUMBERS[*n])).collect();
        places.sort_unstable();
        places.dedup_by_key(|p| p.0);
        for ((a, b), number) in places.into_iter().rev() {
            text.replace_range(a..b, number);
        }
        use_all_of(&text);
    }

    #[test]
    fn numbers_may_be_any_number(
        which in 0..3_usize,
        hit in any::<prop::sample::Index>(),
        value in prop_oneof![-1e3..1e3_f64, any::<f64>()],
    ) {
        let (a, b) = *hit.get(&VALUES[which]);
        let mut text = FIXTURES[which].to_string();
        text.replace_range(a..b, &value.to_string());
        use_all_of(&text);
    }

    #[test]
    fn bytes_may_be_damaged_and_the_end_may_be_missing(
        which in 0..3_usize,
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
        keep in any::<prop::sample::Index>(),
        cut in any::<bool>(),
    ) {
        let mut bytes = FIXTURES[which].as_bytes().to_vec();
        for (at, byte) in hits {
            let i = at.index(bytes.len());
            bytes[i] = byte;
        }
        if cut {
            bytes.truncate(keep.index(bytes.len()));
        }
        use_all_of(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn lines_may_be_lost_doubled_or_swapped(
        which in 0..3_usize,
        moves in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0..3_u8), 1..4),
    ) {
        let mut lines: Vec<&str> = FIXTURES[which].lines().collect();
        for (a, b, what) in moves {
            let (a, b) = (a.index(lines.len()), b.index(lines.len()));
            match what {
                0 => drop(lines.remove(a)),
                1 => lines.insert(b, lines[a]),
                _ => lines.swap(a, b),
            }
        }
        use_all_of(&lines.join("\n"));
    }

    #[test]
    fn a_profile_may_hold_anything(rows in prop::collection::vec(prop::collection::vec(prop_oneof![
        any::<f64>().prop_map(|v| v.to_string()),
        (-1e3..1e3_f64).prop_map(|v| v.to_string()),
        "[ -~]{0,6}",
    ], 2..5), 0..8)) {
        let folder = std::env::temp_dir().join(format!("road-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("fuzz.csv");
        let body: String = rows.iter().map(|r| r.join(",") + "\n").collect();
        std::fs::write(&path, format!("s_m,z_m,x_m,y_m\n{body}")).unwrap();
        if let Ok(road) = Road::load(&path.to_string_lossy()) {
            let p = road.at(0.5 * road.length_m(), 0.0);
            assert!(p.z_m.is_finite());
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

#[test]
fn deep_nesting_is_an_error_and_not_a_stack_overflow() {
    let text = format!("<OpenDRIVE>{}", "<a>".repeat(200_000));
    assert!(Network::parse("deep.xodr", &text).is_err());
    let closed =
        format!("<OpenDRIVE>{}{}</OpenDRIVE>", "<a>".repeat(200_000), "</a>".repeat(200_000));
    assert!(Network::parse("deep.xodr", &closed).is_err());
}

#[test]
fn entities_do_not_blow_up() {
    let text = "<!DOCTYPE a [<!ENTITY x \"xxxxxxxxxx\"><!ENTITY y \"&x;&x;&x;\">]><OpenDRIVE>&y;</OpenDRIVE>";
    assert!(Network::parse("bomb.xodr", text).unwrap_err().to_string().contains("bomb.xodr: line"));
}

#[test]
fn a_chain_of_many_roads_is_no_deep_recursion() {
    let mut text = String::from("<OpenDRIVE><header revMajor=\"1\" revMinor=\"4\"/>");
    for i in 0..20_000 {
        text += &format!(
            "<road id=\"{i}\" length=\"10\"><link><successor elementType=\"road\" elementId=\"{}\" contactPoint=\"start\"/></link><planView><geometry s=\"0\" x=\"{}\" y=\"0\" hdg=\"0\" length=\"10\"><line/></geometry></planView><lanes><laneSection s=\"0\"><center/><right><lane id=\"-1\" type=\"driving\"><link><successor id=\"-1\"/></link><width sOffset=\"0\" a=\"3.5\" b=\"0\" c=\"0\" d=\"0\"/></lane></right></laneSection></lanes></road>",
            i + 1,
            i * 10
        );
    }
    let road =
        Network::parse("chain.xodr", &(text + "</OpenDRIVE>")).unwrap().longest_route().unwrap();
    assert!((road.length_m() - 200_000.0).abs() < 1e-6);
    assert_eq!(road.lanes().len(), 1);
}
