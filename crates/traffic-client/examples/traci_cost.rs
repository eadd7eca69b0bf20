//! One measurement of the cost of TraCI: µs per step of 0.1 s, as one JSON line.
//!
//! `traci_cost FOLDER VEHICLES prepare` builds the network of the built-in highway and a demand of
//! that many vehicles into FOLDER (which exists). `traci_cost FOLDER VEHICLES CASE` drives it once:
//! `floor` is SUMO alone (one long step), `step` a step per message, `context` that and a context
//! subscription, `full` that and the moved ego; `native` is the native engine with as many vehicles.
//! Beside the wall time, each gives the processor time of SUMO and of this client (Linux).
//! `tools/sumo_bench.py` calls the cases in random order with libsumo and prints the table.
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "a measurement program")]

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use road::{Road, builtin};
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};
use traffic_client::native::{NativeTraffic, TrafficConfig};
use traffic_client::sumo::codec::Value;
use traffic_client::sumo::network::{Network, convert};
use traffic_client::sumo::session::{id, var};
use traffic_client::sumo::{Link, Programs, Timeouts};

const WARM_UP: usize = 100;
const STEPS: usize = 300;
/// The same for every case, in `tools/sumo_bench.py` too.
const OPTIONS: &str = "--step-length 0.1 --seed 1 --thread-rngs 64 --no-step-log \
     --duration-log.disable --no-warnings --xml-validation never --time-to-teleport -1 \
     --collision.action none --lanechange.duration 3";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, vehicles, case] = arguments.as_slice() else {
        return Err(
            "usage: traci_cost FOLDER VEHICLES prepare|floor|step|context|full|native".into()
        );
    };
    let (folder, vehicles) = (Path::new(folder), vehicles.parse::<usize>()?);
    let road = Arc::new(builtin::highway());
    let (net, routes) = (folder.join("road.net.xml"), folder.join("bench.rou.xml"));
    let case = match case.as_str() {
        "prepare" => {
            let network = convert(&Programs::find(None)?, &road, folder, &[], &[])?;
            return Ok(std::fs::write(&routes, demand(&network, vehicles))?);
        }
        "native" => {
            let (wall_us, vehicles) = native(&road, vehicles)?;
            println!("{{\"wall\": {wall_us:.3}, \"vehicles\": {vehicles}}}");
            return Ok(());
        }
        "floor" => Case::Floor,
        "step" => Case::Step,
        "context" => Case::Context,
        "full" => Case::Full,
        other => return Err(format!("no case {other}").into()),
    };
    let mut options = vec!["-n".to_owned(), net.display().to_string()];
    options.extend(["-r".to_owned(), routes.display().to_string()]);
    options.extend(OPTIONS.split_whitespace().map(str::to_owned));
    let [wall, sumo, client] = sumo(&options, &road, case)?;
    println!("{{\"wall\": {wall:.2}, \"sumo_cpu\": {sumo:.2}, \"client_cpu\": {client:.2}}}");
    Ok(())
}

/// Processor time that the first thread of a process has had, µs; 0 where the system does not say.
fn cpu_us(pid: &str) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/schedstat")).unwrap_or_default();
    text.split_whitespace().next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) * 1e-3
}

/// As many vehicles, evenly over the through route, half of them in each lane.
fn demand(network: &Network, vehicles: usize) -> String {
    let mut routes: Vec<Vec<String>> =
        network.entries().iter().flat_map(|entry| network.routes_from(entry)).collect();
    routes.sort_by(|a, b| network.route_length_m(b).total_cmp(&network.route_length_m(a)));
    let through = routes.first().cloned().unwrap_or_default();
    let spacing_m = 2.0 * (network.route_length_m(&through) - 1500.0) / vehicles as f64;
    let mut out = String::from(
        "<routes><vType id=\"car\" carFollowModel=\"IDM\" tau=\"1.4\" accel=\"1.4\" decel=\"2\" \
         speedFactor=\"normc(0.8,0.1,0.6,1)\"/><vType id=\"ego\" vClass=\"trailer\" length=\"16\" \
         maxSpeed=\"60\"/>\n",
    );
    let _ = writeln!(out, "<route id=\"through\" edges=\"{}\"/>", through.join(" "));
    let (mut begin_m, mut next_m, mut number) = (0.0, 20.0, 0);
    for (k, edge) in through.iter().enumerate() {
        let length_m = network.lanes_of(edge).next().map_or(0.0, |lane| lane.length_m);
        let rest = through.get(k..).unwrap_or_default().join(" ");
        while next_m < begin_m + length_m && number < vehicles {
            for lane in 0..2 {
                let _ = writeln!(
                    out,
                    "<vehicle id=\"v{number}\" type=\"car\" depart=\"0\" departLane=\"{lane}\" \
                     departPos=\"{:.1}\" departSpeed=\"15\" insertionChecks=\"none\">\
                     <route edges=\"{rest}\"/></vehicle>",
                    (next_m - begin_m).max(6.0)
                );
                number += 1;
            }
            next_m += spacing_m;
        }
        begin_m += length_m;
    }
    out.push_str("</routes>\n");
    out
}

#[derive(Clone, Copy, PartialEq)]
enum Case {
    Floor,
    Step,
    Context,
    Full,
}

/// Wall time, and processor time of SUMO and of this program, per step, µs.
fn sumo(options: &[String], road: &Road, case: Case) -> Result<[f64; 3], Box<dyn Error>> {
    let mut link = Link::start(&Programs::find(None)?, options, Timeouts::default())?;
    let pid = link.pid().unwrap_or_default().to_string();
    let cpu = || [cpu_us(&pid), cpu_us("self")];
    let place = |link: &mut Link, k: usize| {
        let s_m = 3000.0 + 2.0 * k as f64;
        let at = road.at(s_m, road.lanes().first().map_or(0.0, |lane| lane.center_d_m(s_m)));
        let angle_deg = 90.0 - at.heading_rad.to_degrees();
        link.session.move_to_xy("ego", at.x_m, at.y_m, angle_deg);
    };
    if case != Case::Step && case != Case::Floor {
        let texts = [
            "through", "ego", "now", "first", "base", "0", "current", "max", "current", "", "", "",
        ];
        let mut add: Vec<Value> = texts.iter().map(|t| Value::Text((*t).to_owned())).collect();
        add.extend([Value::Int(0), Value::Int(0)]);
        link.session.request().set(id::VEHICLE, var::ADD, "ego", &Value::Compound(add));
        place(&mut link, 0);
        link.session.step();
        link.exchange("add")?;
        link.session.request().subscribe_context(id::VEHICLE, "ego", 200.0);
        link.command("subscribe", "ego")?;
    }
    let (mut started, mut before) = (Instant::now(), cpu());
    if case == Case::Floor {
        link.session.request().step_to(0.1 * WARM_UP as f64);
        link.exchange("warm up")?;
        (started, before) = (Instant::now(), cpu());
        link.session.request().step_to(0.1 * (WARM_UP + STEPS) as f64);
        link.exchange("floor")?;
    } else {
        for k in 1..=WARM_UP + STEPS {
            if k == WARM_UP + 1 {
                (started, before) = (Instant::now(), cpu());
            }
            link.session.request();
            if case == Case::Full {
                place(&mut link, k);
            }
            link.session.step();
            link.exchange("step")?;
        }
    }
    let (wall_us, after) = (started.elapsed().as_secs_f64() * 1e6, cpu());
    Ok([wall_us, after[0] - before[0], after[1] - before[1]].map(|us| us / STEPS as f64))
}

fn native(road: &Arc<Road>, vehicles: usize) -> Result<(f64, usize), Box<dyn Error>> {
    let config = TrafficConfig {
        initial_density_1_km: Some(vehicles as f64 / 32.5),
        spawn_probability: 0.0,
        ramp_spawn_probability: 0.0,
        scene_radius_m: 200.0,
        ..TrafficConfig::default()
    };
    let geometry =
        Geometry { front_m: 4.8, trailer_rear_m: 11.5, width_m: 2.55, ..Geometry::default() };
    let mut traffic = NativeTraffic::new(road.clone(), geometry, config)?;
    let mut started = Instant::now();
    for k in 0..=WARM_UP + STEPS {
        if k == WARM_UP + 1 {
            started = Instant::now();
        }
        let s_m = 3000.0 + 2.0 * k as f64;
        let d_m = road.lanes().first().map_or(0.0, |lane| lane.center_d_m(s_m));
        let ego = EgoState { s_m, d_m, speed_m_s: 20.0, ..EgoState::default() };
        traffic.advance(Time(k as i64 * 100_000_000), &ego)?;
    }
    Ok((started.elapsed().as_secs_f64() * 1e6 / STEPS as f64, traffic.counts().vehicles))
}
