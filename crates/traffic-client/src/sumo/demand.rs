//! What drives in SUMO: vehicle types, routes, the first fill and the inflow, from the same
//! [`TrafficConfig`] as native traffic.
//!
//! Car following is SUMO's IDM, lane changing its LC2013 (SUMO has no MOBIL), with changes that take
//! time (`--lanechange.duration`). Trucks do not slow on grades in SUMO; that is a limit of SUMO.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use road::Road;
use tractrix_core::{Geometry, VehicleClass};

use super::config::SumoConfig;
use super::network::Network;
use super::odd::{Entries, Kept, closed_from_the_start, emergency_vehicles, stopped_vehicles};
use crate::native::{ClassConfig, TrafficConfig};
use crate::philox::{Draws, Stream};
use crate::replay::class_of_length;

/// Types of emergency vehicles begin with this.
pub(super) const EMERGENCY: &str = "emergency";
/// Id of the ego in SUMO, and of its type.
pub(crate) const EGO: &str = "ego";
/// Id of the vehicle that stands for the ego in a neighbour lane.
pub(crate) const GHOST: &str = "ego_ghost";
/// Id of the route of the ego.
pub(crate) const EGO_ROUTE: &str = "through";
/// Longest time that flows run, s.
const FOREVER_S: &str = "1000000";

const CLASSES: [(VehicleClass, &str, &str); 3] = [
    (VehicleClass::Car, "car", "passenger"),
    (VehicleClass::Van, "van", "delivery"),
    (VehicleClass::Truck, "truck", "trailer"),
];

/// Is this one of our vehicle types?
pub(crate) fn is_type(name: &str) -> bool {
    CLASSES.iter().any(|(_, known, _)| *known == name)
}

/// The class behind a type id: ours by its name, another by the vehicle's length.
pub(crate) fn class_of(type_id: &str, length_m: f64) -> VehicleClass {
    if type_id.starts_with(EMERGENCY) {
        return VehicleClass::Emergency;
    }
    CLASSES
        .iter()
        .find(|(_, name, _)| type_id.starts_with(name))
        .map_or_else(|| class_of_length(length_m), |(class, _, _)| *class)
}

/// The route file. `through` is the longest route; `free_m` the stretch of it that stays empty for
/// the ego.
pub(crate) fn route_file(
    sumo: &SumoConfig,
    network: &Network,
    road: &Road,
    geometry: &Geometry,
    free_m: std::ops::Range<f64>,
) -> String {
    let config = &sumo.traffic;
    let mut out = String::from("<routes>\n");
    let share = |class| match class {
        VehicleClass::Car => 1.0 - config.van_share_frac - config.truck_share_frac,
        VehicleClass::Van => config.van_share_frac,
        VehicleClass::Truck => config.truck_share_frac,
        _ => 0.0,
    };
    let _ = writeln!(out, "<vTypeDistribution id=\"mix\">");
    for (class, name, v_class) in CLASSES {
        let extra = sumo.type_attributes.get(name);
        vehicle_type(&mut out, name, v_class, config.class(class), share(class), extra);
    }
    let _ = writeln!(out, "</vTypeDistribution>");
    for (k, step) in config.schedule.demand.iter().enumerate() {
        let Some(trucks) = step.truck_share_frac else { continue };
        let vans = config.van_share_frac.min(1.0 - trucks);
        let _ = writeln!(
            out,
            "<vTypeDistribution id=\"mix{k}\" vTypes=\"car van truck\" \
             probabilities=\"{} {vans} {trucks}\"/>",
            (1.0 - trucks - vans).max(0.0)
        );
    }
    if config.sees_ego {
        let _ = writeln!(
            out,
            "<vType id=\"{EGO}\" vClass=\"trailer\" length=\"{:.2}\" width=\"{:.2}\" maxSpeed=\"60\" \
         minGap=\"0.5\" insertionChecks=\"none\"/>",
            geometry.length_m(),
            geometry.width_m
        );
    }
    let entries = network.entries();
    let mut routes: Vec<Vec<String>> =
        entries.iter().flat_map(|entry| network.routes_from(entry)).collect();
    routes.sort_by(|a, b| network.route_length_m(b).total_cmp(&network.route_length_m(a)));
    for (k, route) in routes.iter().enumerate() {
        let id = if k == 0 { EGO_ROUTE.to_owned() } else { format!("route{k}") };
        let _ = writeln!(out, "<route id=\"{id}\" edges=\"{}\"/>", route.join(" "));
    }
    // SUMO reads departures in order of their times.
    let mut entries = Entries::default();
    if let Some(through) = routes.first() {
        let mut kept = stopped_vehicles(&mut entries, config, network, road, through);
        kept.extend(closed_from_the_start(config, network, road));
        fill(&mut entries, config, network, through, &free_m, &kept);
        emergency_vehicles(&mut out, &mut entries, config, network, through);
    }
    flows(&mut entries, config, network, &routes);
    out.push_str(&entries.in_order());
    out.push_str("</routes>\n");
    out
}

fn vehicle_type(
    out: &mut String,
    name: &str,
    v_class: &str,
    c: &ClassConfig,
    share: f64,
    extra: Option<&BTreeMap<String, String>>,
) {
    let (mean, sigma) = (c.speed_factor_frac, c.speed_factor_sigma_frac);
    let factor = format!("normc({mean},{sigma},{},{})", mean - 3.0 * sigma, mean + 3.0 * sigma);
    let mut attributes: BTreeMap<&str, String> = [
        ("vClass", v_class.to_owned()),
        ("probability", share.to_string()),
        ("carFollowModel", "IDM".to_owned()),
        ("length", c.length_m.to_string()),
        ("width", c.width_m.to_string()),
        ("tau", c.headway_s.to_string()),
        ("minGap", c.min_gap_m.to_string()),
        ("accel", c.accel_m_s2.to_string()),
        ("decel", c.decel_m_s2.to_string()),
        ("emergencyDecel", c.max_decel_m_s2.to_string()),
        ("maxSpeed", "70".to_owned()),
        ("speedFactor", factor),
    ]
    .into();
    attributes
        .extend(extra.into_iter().flatten().map(|(key, value)| (key.as_str(), value.clone())));
    let _ = write!(out, "<vType id=\"{name}\"");
    for (key, value) in attributes {
        let _ = write!(out, " {key}=\"{value}\"");
    }
    let _ = writeln!(out, "/>");
}

/// Vehicles at the start, spaced as in native traffic, along the through route.
fn fill(
    entries: &mut Entries,
    config: &TrafficConfig,
    network: &Network,
    through: &[String],
    free_m: &std::ops::Range<f64>,
    kept: &[Kept],
) {
    let density = config.start_density_1_km();
    if density <= 0.0 {
        return;
    }
    let mut begin_m = 0.0;
    let mut number = 0u64;
    for (k, edge) in through.iter().enumerate() {
        let length_m = network.lanes_of(edge).next().map_or(0.0, |lane| lane.length_m);
        let rest = through.get(k..).unwrap_or_default().join(" ");
        for lane in network.lanes_of(edge) {
            let mut row = Vec::new();
            let mut at_m = 0.0;
            loop {
                let draws = Draws::new(config.seed, Stream::Fill, number);
                number += 1;
                let share = draws.uniform(1);
                let (class, name, _) = match share - config.truck_share_frac {
                    x if x < 0.0 => CLASSES[2],
                    x if x < config.van_share_frac => CLASSES[1],
                    _ => CLASSES[0],
                };
                let own = config.class(class);
                let spacing_m = (0.3 + 1.4 * draws.uniform(0)) * 1000.0 / density;
                at_m += spacing_m.max(own.length_m + 1.5 * own.min_gap_m);
                if at_m > length_m {
                    break;
                }
                let is_free = !kept.iter().any(|kept| kept.holds(&lane.id, at_m));
                if is_free && !free_m.contains(&(begin_m + at_m)) {
                    row.push((at_m, name, own, number));
                }
            }
            for (i, &(at_m, name, own, number)) in row.iter().enumerate() {
                // Nobody starts faster than their headway allows.
                let keeps_m_s = row.get(i + 1).map_or(f64::INFINITY, |&(ahead_m, _, ahead, _)| {
                    (ahead_m - ahead.length_m - at_m - own.min_gap_m) / own.headway_s
                });
                let wish_m_s = 0.9 * lane.speed_m_s.min(config.max_speed_m_s);
                let speed = wish_m_s.min(keeps_m_s).max(0.0);
                let text = format!(
                    "<vehicle id=\"fill{number}\" type=\"{name}\" depart=\"0\" departLane=\"{}\" \
                     departPos=\"{at_m:.2}\" departSpeed=\"{speed:.2}\" insertionChecks=\"none\">\
                     <route edges=\"{rest}\"/></vehicle>",
                    lane.index
                );
                entries.push(0.0, text);
            }
        }
        begin_m += length_m;
    }
}

/// Inflow at every entry, lane by lane and step of the demand by step, split over the routes that
/// begin there.
fn flows(entries: &mut Entries, config: &TrafficConfig, network: &Network, routes: &[Vec<String>]) {
    let through = routes.first().and_then(|route| route.first());
    let schedule = &config.schedule;
    let mut times_s: Vec<f64> = vec![0.0];
    times_s.extend(schedule.demand.iter().map(|step| step.from_s.max(0.0)));
    times_s.sort_by(f64::total_cmp);
    times_s.dedup();
    for (k, route) in routes.iter().enumerate() {
        let Some(entry) = route.first() else { continue };
        let siblings = routes.iter().filter(|r| r.first() == Some(entry)).count();
        let is_longest = routes.iter().position(|r| r.first() == Some(entry)) == Some(k);
        let out_share = config.exit_share_frac.min(1.0 / siblings as f64);
        let share = if is_longest { 1.0 - out_share * (siblings - 1) as f64 } else { out_share };
        let id = if k == 0 { EGO_ROUTE.to_owned() } else { format!("route{k}") };
        for lane in network.lanes_of(entry) {
            let track = lane.original.first().and_then(|id| id.parse().ok());
            for (step, &from_s) in times_s.iter().enumerate() {
                let (probability, flow) = if Some(entry) == through {
                    let flow = schedule.at(from_s, track, |step| step.flow_veh_h_lane);
                    (config.spawn_probability, flow)
                } else {
                    let flow = schedule.at(from_s, track, |step| step.ramp_flow_veh_h);
                    (config.ramp_spawn_probability, flow)
                };
                // Per second, as SUMO wants it.
                let usual = probability / config.spawn_interval_s;
                let per_s = (share * flow.map_or(usual, |veh_h| veh_h / 3600.0)).min(1.0);
                if per_s <= 0.0 {
                    continue;
                }
                let last = |s: &crate::schedule::DemandStep| s.from_s <= from_s;
                let with_trucks = |s: &crate::schedule::DemandStep| s.truck_share_frac.is_some();
                let mix = schedule.demand.iter().rposition(|s| last(s) && with_trucks(s));
                let mix = mix.map_or("mix".to_owned(), |k| format!("mix{k}"));
                let speed = schedule.at(from_s, track, |step| step.inflow_speed_m_s);
                let speed = speed.map_or("max".to_owned(), |v| format!("{v:.2}"));
                let end = times_s.get(step + 1).map_or(FOREVER_S.to_owned(), f64::to_string);
                let index = lane.index;
                entries.push(
                    from_s,
                    format!(
                        "<flow id=\"flow{k}_{index}_{step}\" type=\"{mix}\" route=\"{id}\" \
                         begin=\"{from_s}\" end=\"{end}\" probability=\"{per_s}\" \
                         departLane=\"{index}\" departSpeed=\"{speed}\"/>"
                    ),
                );
            }
        }
    }
}
