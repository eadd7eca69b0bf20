//! Flow over density: the fundamental diagram of the native engine, and of SUMO where it is
//! installed, with the drivers of a scenario.
//!
//! A straight level road is filled with a density; after 20 s, vehicles on a window in its
//! middle are counted (Edie: flow = way / area, density = time / area) until whatever happens at
//! the ends of the road could reach the window. Densities up to where traffic stands.

use std::path::Path;
use std::sync::Arc;

use road::{Road, builtin};
use serde::Serialize;
use sim::{Scenario, Traffic, TrafficKind};
use tractrix_core::{Geometry, Time, TrafficSource};
use traffic_client::sumo::Programs;

use super::in_the_middle;
use super::plots::{Curve, Panel, html};
use crate::failure::Failure;
use crate::out_folder::OutFolder;
use crate::output;
use crate::provenance::Provenance;

/// Length of the road and its window, m.
const ROAD_M: f64 = 3500.0;
const WINDOW_M: std::ops::Range<f64> = 1800.0..2300.0;
/// Observed time, s.
const WATCHED_S: std::ops::Range<f64> = 20.0..70.0;
/// Densities, vehicles per km and lane.
const DENSITIES_1_KM: [f64; 10] = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 65.0, 80.0];

#[derive(Debug, Clone, Copy, Serialize)]
struct Point {
    density_per_lane_1_km: f64,
    flow_per_lane_1_h: f64,
    speed_m_s: f64,
}

#[derive(Debug, Serialize)]
struct Diagram {
    #[serde(flatten)]
    provenance: Provenance,
    scenario: String,
    native: Vec<Point>,
    sumo: Vec<Point>,
}

/// Writes diagram.json and diagram.html.
pub(super) fn draw(scenario: &Scenario, seed: u64, out: &OutFolder) -> Result<(), Failure> {
    let road = Arc::new(builtin::flat(ROAD_M));
    let curve = |source| -> Result<Vec<Point>, Failure> {
        DENSITIES_1_KM.iter().map(|&k| point(scenario, seed, &road, source, k)).collect()
    };
    let native = curve(TrafficKind::Native)?;
    let binary = scenario.traffic.sumo.binary.as_deref().map(Path::new);
    let sumo = match Programs::find(binary) {
        Ok(_) => curve(TrafficKind::Sumo)?,
        Err(e) => {
            output::note(&format!("the diagram is without SUMO: {e}"));
            Vec::new()
        }
    };
    let curves = |y: fn(&Point) -> f64| {
        let curve = |name, color, points: &[Point]| Curve {
            name,
            color,
            dots: true,
            x: points.iter().map(|p| p.density_per_lane_1_km).collect(),
            y: points.iter().map(y).collect(),
        };
        vec![curve("native", "#0a7cc4", &native), curve("SUMO", "#d1495b", &sumo)]
    };
    let abscissa = "vehicles per km and lane";
    let flow = curves(|p| p.flow_per_lane_1_h);
    let panels = [
        Panel { abscissa, ordinate: "vehicles per hour and lane", curves: flow },
        Panel { abscissa, ordinate: "speed, m/s", curves: curves(|p| p.speed_m_s) },
    ];
    let text = format!("Drivers of {}, a level road of two lanes.", scenario.name);
    out.write("diagram.html", html("Fundamental diagram", &text, &panels))?;
    let name = scenario.name.clone();
    let diagram = Diagram { provenance: Provenance::of_seed(seed), scenario: name, native, sumo };
    let json = serde_json::to_string_pretty(&diagram).map_err(Failure::work)?;
    out.write("diagram.json", json)
}

fn point(
    scenario: &Scenario,
    seed: u64,
    road: &Arc<Road>,
    source: TrafficKind,
    density_1_km: f64,
) -> Result<Point, Failure> {
    let mut scenario = scenario.clone();
    let traffic = &mut scenario.traffic;
    let demand = traffic.demand(seed);
    (traffic.source, traffic.family) = (source, None);
    traffic.native = traffic_client::native::TrafficConfig {
        initial_density_1_km: Some(density_1_km),
        warm_up_s: 0.0,
        outflow_speed_m_s: None,
        scene_radius_m: ROAD_M,
        // What flows in is about what the density carries; it does not reach the window.
        spawn_probability: (density_1_km * demand.max_speed_m_s * 1e-3 * demand.spawn_interval_s)
            .min(0.06),
        ..demand
    };
    let mut traffic =
        Traffic::new(&scenario, seed, road, Geometry::default(), None).map_err(Failure::input)?;
    let ego = in_the_middle(road);
    let lanes = traffic_client::calibrate::lanes_m(road) / ROAD_M;
    let (mut way_m, mut time_s) = (0.0, 0.0);
    let step_s = 0.5;
    for k in 0..=(WATCHED_S.end / step_s) as i64 {
        let now = Time::from_seconds(k as f64 * step_s);
        let scene = traffic.advance(now, &ego).map_err(Failure::work)?;
        if WATCHED_S.contains(&now.seconds()) {
            for n in scene.neighbours.iter().filter(|n| WINDOW_M.contains(&n.front_s_m)) {
                way_m += n.speed_m_s * step_s;
                time_s += step_s;
            }
        }
    }
    let area = lanes * (WINDOW_M.end - WINDOW_M.start) * (WATCHED_S.end - WATCHED_S.start);
    Ok(Point {
        density_per_lane_1_km: 1000.0 * time_s / area,
        flow_per_lane_1_h: 3600.0 * way_m / area,
        speed_m_s: way_m / f64::max(time_s, 1e-9),
    })
}
