//! What a level road of two lanes carries: vehicles are offered at rising rates, and those that
//! pass 2 km on are counted. `capacity [MAX_SPEED_M_S] [SEEDS]`, on stdout a table of Markdown.
#![allow(clippy::print_stdout, clippy::disallowed_macros, reason = "an example")]

use traffic_client::TrafficError;
use traffic_client::native::{Density, TrafficConfig};
use traffic_client::serve::serve;

fn main() -> Result<(), TrafficError> {
    let mut args = std::env::args().skip(1).filter_map(|a| a.parse::<f64>().ok());
    let max_speed_m_s = args.next().unwrap_or(25.0);
    let seeds = args.next().unwrap_or(2.0) as u64;
    let motorway = |truck_share_frac, van_share_frac| TrafficConfig {
        max_speed_m_s,
        truck_share_frac,
        van_share_frac,
        ..TrafficConfig::default()
    };
    let cases =
        [("cars".to_owned(), motorway(0.0, 0.0)), ("20 % trucks".to_owned(), motorway(0.2, 0.0))];
    let families = Density::ALL.into_iter().flat_map(|density| {
        [12.5, 15.0]
            .map(|v| (format!("{density:?}, {v} m/s"), TrafficConfig::family(density, v, 1)))
    });
    println!("| drivers | asked | served | waiting | speed | first 200 m | equilibrium |");
    println!("|---|---|---|---|---|---|---|");
    for (name, config) in cases {
        for asked in [1400.0, 1600.0, 1800.0, 2000.0, 2200.0, 2400.0] {
            let spawn_probability = asked / 3600.0 * config.spawn_interval_s;
            row(&name, &TrafficConfig { spawn_probability, ..config.clone() }, seeds)?;
        }
    }
    for (name, config) in families {
        row(&name, &config, seeds)?;
    }
    Ok(())
}

fn row(name: &str, config: &TrafficConfig, seeds: u64) -> Result<(), TrafficError> {
    let mut sum = [0.0; 4];
    for seed in 1..=seeds {
        let served = serve(&TrafficConfig { seed, ..config.clone() })?;
        let values = [
            served.flow_veh_h_lane,
            served.waiting as f64,
            served.speed_m_s,
            served.entry_speed_m_s,
        ];
        sum.iter_mut().zip(values).for_each(|(sum, x)| *sum += x / seeds as f64);
    }
    let [flow, waiting, speed, entry] = sum;
    let (asked, most) = (config.asked_veh_h_lane(), config.capacity().flow_veh_h_lane);
    println!(
        "| {name} | {asked:.0} | {flow:.0} | {waiting:.0} | {speed:.1} | {entry:.1} | {most:.0} |"
    );
    Ok(())
}
