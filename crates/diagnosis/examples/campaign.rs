//! Hides effects in generated drives and counts what the diagnosis makes of them:
//! `campaign KIND COUNT SEED [drives=N] [seconds=S] [without=channel,channel]
//! [only=cause] [from=CASE] [dump=DIR]`, KIND one of `clean`, `small`,
//! `medium`, `large`, `pairs`, `outside`, `deleted`. One line per case, then the table.
#![expect(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "an example prints and takes times"
)]

#[allow(dead_code, reason = "each user of the generator needs a part of it")]
#[path = "../tests/support/mod.rs"]
mod support;

use std::path::Path;

use diagnosis::{Channel, Diagnosis, Drive, DriveSet, Options, Plant, Serial, Verdict, diagnose};
use dynamics::TruckParameters;
use dynamics::catalogue::CATALOGUE;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::effects::{Effect, OUTSIDE};
use support::{Campaign, Magnitude, generate, hide};

#[derive(Default)]
struct Table {
    cases: usize,
    first: usize,
    exact: usize,
    any: usize,
    all: usize,
    silent: usize,
    wrong: usize,
    unknown: usize,
    signal: usize,
    unsure: usize,
    intervals: usize,
    covered: usize,
    worse: usize,
    seconds: Vec<f64>,
    kept: Vec<f64>,
}

/// Key and value in `diagnosis.json` of a size in the catalogue's unit; `None` where the hidden
/// shape has another parameter than the catalogue's.
fn expected(id: &str, size: f64) -> Option<(&'static str, f64)> {
    Some(match id {
        "rolling_resistance" => ("coefficient_scale", 1.0 + size),
        "air_drag" => ("cd_a_scale", 1.0 + size),
        "headwind" => ("headwind_m_s", size),
        "mass" => ("mass_scale", 1.0 + size),
        "grade_bias" => ("grade_frac", size),
        "map_shift" => ("shift_m", -size),
        "tyre_warmup" => ("cold_extra_frac", size),
        "driveline_loss" => ("extra_loss_frac", size * 0.0494 / 0.9506),
        "fan_load" => ("fan_power_kw", size * 1e-3),
        "dragging_brake" => ("force_n", size),
        "engine_friction" => ("friction_scale", 1.0 + size),
        "altitude_derate" => ("torque_loss_per_km", size * 1e3),
        "turbo_lag" => ("lag_s", size * 0.45),
        "pedal_delay" | "brake_delay" => ("delay_s", size),
        "shift_duration" => ("extra_time_s", size),
        "fuel_map_low_load" => ("extra_frac", size),
        "brake_gain" => ("gain_scale", 1.0 + size),
        "brake_fade" => ("loss_per_100_k", size * 1e2),
        "speed_scale" => ("scale", 1.0 + size),
        "yaw_rate_bias" => ("bias_rad_s", size),
        "steering_ratio" => ("ratio_scale", 1.0 + size),
        "steering_offset" => ("offset_rad", size),
        "steering_free_play" => ("free_play_rad", size),
        "steering_lag" => ("lag_s", size),
        "cornering_stiffness_front"
        | "cornering_stiffness_drive"
        | "cornering_stiffness_trailer" => ("stiffness_scale", 1.0 + size),
        "payload_position" => ("shift_rearward_m", size),
        "road_bank" => ("bank_rad", size),
        "crosswind" => ("wind_to_left_m_s", size),
        _ => return None,
    })
}

/// Writes drives as `diagnose` reads them.
fn dump(set: &DriveSet, folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let mut index = format!("schema = 1\ntruck = {:?}\n", set.truck);
    for d in &set.drives {
        let channels: Vec<(&str, &[f64])> =
            Channel::all().filter_map(|c| Some((c.name(), d.get(c)?))).collect();
        let head: Vec<&str> = channels.iter().map(|c| c.0).collect();
        let mut text = format!("time_s,{}\n", head.join(","));
        for i in 0..d.len {
            text += &format!("{:.2}", i as f64 * Drive::STEP_S);
            for (_, x) in &channels {
                text += &format!(",{}", x[i]);
            }
            text.push('\n');
        }
        std::fs::write(folder.join(format!("{}.csv", d.name)), text)?;
        index += &format!(
            "\n[[drive]]\nname = {0:?}\nfile = \"{0}.csv\"\nreported_mass_kg = {1:.1}\ntyres_warm_at_start = {2}\n",
            d.name,
            d.reported_mass_kg.unwrap_or(0.0),
            d.tyres_warm_at_start.unwrap_or(true),
        );
    }
    std::fs::write(folder.join("drives.toml"), index)
}

fn line(d: &Diagnosis) -> String {
    let causes: Vec<String> = d
        .causes
        .iter()
        .map(|c| {
            let p: Vec<String> = c
                .parameters
                .iter()
                .map(|(k, p)| format!("{k}={:.4}±{:.4}", p.value, p.sigma))
                .collect();
            let or: Vec<&str> = c.confused_with.iter().map(|x| x.id).collect();
            format!("{}[{}] {:.0} nats or {or:?}", c.id, p.join(" "), c.evidence)
        })
        .collect();
    let unknown = d.unknown.as_ref().map_or(String::new(), |u| {
        format!(" unknown: {} by {:?} {:.0} nats", u.quantity, u.signals, u.evidence)
    });
    format!("{:?} {}{unknown}", d.verdict, causes.join(" + "))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let usage = "usage: campaign KIND COUNT SEED [drives=N] [seconds=S] [without=channel,...] [only=cause] [from=CASE] [dump=DIR]";
    let kind = arguments.first().ok_or(usage)?.as_str();
    let count: usize = arguments.get(1).ok_or(usage)?.parse()?;
    let seed: u64 = arguments.get(2).ok_or(usage)?.parse()?;
    let option = |key: &str| arguments.iter().find_map(|a| a.strip_prefix(key));
    let mut campaign = Campaign::FULL;
    if let Some(n) = option("drives=") {
        campaign.drives = n.parse()?;
    }
    if let Some(s) = option("seconds=") {
        campaign.duration_s = s.parse()?;
    }
    let base = TruckParameters::load("reference")?;
    let plant = Plant::reference()?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let usual = Campaign { drives: 8, ..campaign };
    let clean = generate(&base, &[], &usual, seed.wrapping_mul(7919) + 1)?;
    let mut t = Table::default();
    for case in 0..count {
        let draw = |m: Magnitude, k: usize, rng: &mut ChaCha8Rng| {
            let id = option("only=").unwrap_or(CATALOGUE[k % 34].id);
            hide(id, m, rng).into_iter().collect::<Vec<Effect>>()
        };
        let hidden = match kind {
            "clean" => Vec::new(),
            "small" => draw(Magnitude::Small, case, &mut rng),
            "medium" | "deleted" => draw(Magnitude::Medium, case, &mut rng),
            "large" => draw(Magnitude::Large, case, &mut rng),
            "pairs" => {
                let a = rng.random_range(0..34);
                let b = (a + rng.random_range(1..34)) % 34;
                let mut v = draw(Magnitude::Medium, a, &mut rng);
                v.extend(hide(CATALOGUE[b].id, Magnitude::Medium, &mut rng));
                v
            }
            "outside" => {
                let o = &OUTSIDE[case % OUTSIDE.len()];
                let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
                let sign = if o.1 > 1.0 || o.2 == "shift_in_process" { 1.0 } else { sign };
                vec![Effect::Outside {
                    kind: o.0,
                    size: sign * o.1 * (0.7 + 0.6 * rng.random::<f64>()),
                }]
            }
            _ => return Err(usage.into()),
        };
        if option("from=").is_some_and(|n| n.parse::<usize>().is_ok_and(|n| case < n)) {
            continue;
        }
        let case_seed = seed.wrapping_mul(1_000_003) + case as u64;
        let mut set = generate(&base, &hidden, &campaign, case_seed)?;
        if let Some(without) = option("without=") {
            for name in without.split(',') {
                let channel = Channel::of(name).ok_or_else(|| format!("no channel {name}"))?;
                set.drives.iter_mut().for_each(|d| d.remove(channel));
            }
        }
        if let Some(folder) = option("dump=") {
            dump(&set, Path::new(folder))?;
        }
        let truth: Vec<&str> = hidden
            .iter()
            .filter_map(|e| if let Effect::Cause { id, .. } = e { Some(*id) } else { None })
            .collect();
        let mut options = Options::default();
        if kind == "deleted" {
            options.excluded = truth.iter().map(|s| (*s).to_owned()).collect();
        }
        let start = std::time::Instant::now();
        let d = diagnose(&plant, &set, Some(&clean), &options, &Serial, &mut |_| {})?;
        let seconds = start.elapsed().as_secs_f64();
        let named: Vec<&str> = d.causes.iter().map(|c| c.id).collect();
        let observable = |id: &&&str| !d.not_observable.iter().any(|n| n.id == **id);
        let visible: Vec<&&str> = truth.iter().filter(observable).collect();
        t.cases += 1;
        t.seconds.push(seconds);
        let hit = visible.iter().filter(|id| named.contains(**id)).count();
        let unseen = visible.is_empty() && named.is_empty();
        let first = named.first().is_some_and(|n| truth.contains(n)) || unseen;
        let all = hit == visible.len();
        let exact = all && named.len() == visible.len() && d.verdict != Verdict::Unknown;
        t.first += usize::from(first);
        t.all += usize::from(all);
        t.any += usize::from(hit > 0 || unseen);
        t.exact += usize::from(exact);
        t.silent += usize::from(named.is_empty() && d.verdict == Verdict::NothingToExplain);
        t.wrong += usize::from(
            d.verdict == Verdict::Explained && named.first().is_some_and(|n| !truth.contains(n)),
        );
        t.unknown += usize::from(d.verdict == Verdict::Unknown);
        t.unsure += usize::from(d.verdict != Verdict::Explained);
        if let Some(Effect::Outside { kind, .. }) = hidden.first()
            && let (Some(o), Some(u)) = (OUTSIDE.iter().find(|o| o.0 == *kind), &d.unknown)
        {
            let right = u.signals.first().is_some_and(|s| o.3.contains(s)) && u.quantity == o.2;
            t.signal += usize::from(right && d.verdict == Verdict::Unknown);
        }
        let mut off = String::new();
        for e in &hidden {
            if let Effect::Cause { id, size, .. } = e
                && let Some(c) = d.causes.iter().find(|c| c.id == *id)
                && let Some((key, value)) = expected(id, *size)
                && let Some(p) = c.parameters.get(key)
            {
                let z = (p.value - value) / p.sigma;
                t.intervals += 1;
                t.covered += usize::from(z.abs() <= 1.645);
                off += &format!(" z={z:.1} (true {value:.4})");
            }
        }
        if let Some(g) = &d.gain {
            t.worse += usize::from(g.log_score_nats < 0.0);
            let (b, a) = (g.speed_rmse_m_s.before, g.speed_rmse_m_s.after);
            let floor = d.wrong.first().map_or(0.0, |w| w.noise_floor);
            if b > 1.5 * floor {
                t.kept.push((b - a) / (b - floor));
            }
        }
        let mark = if truth.is_empty() {
            if named.is_empty() { "." } else { "X" }
        } else if exact {
            "."
        } else if first {
            "+"
        } else if named.is_empty() {
            "-"
        } else {
            "X"
        };
        println!("{mark} {case} {hidden:?}\n      {seconds:.1} s {}{off}", line(&d));
    }
    let of = |n: usize| format!("{n}/{} ({:.1} %)", t.cases, 100.0 * n as f64 / t.cases as f64);
    t.seconds.sort_by(f64::total_cmp);
    t.kept.sort_by(f64::total_cmp);
    println!("\n{kind}, seed {seed}: {} cases", t.cases);
    println!("first cause right   {}", of(t.first));
    println!("all named           {}", of(t.all));
    println!("at least one named  {}", of(t.any));
    println!("exact set           {}", of(t.exact));
    println!("nothing to explain  {}", of(t.silent));
    println!("unknown             {}, right signal first {}", of(t.unknown), of(t.signal));
    println!("not stated as sure  {}", of(t.unsure));
    println!("confident and wrong {}", of(t.wrong));
    println!("90 % intervals that cover {} of {}", t.covered, t.intervals);
    println!("worse on held-out drives {}", of(t.worse));
    if let (Some(m), Some(w)) = (t.kept.get(t.kept.len() / 2), t.kept.get(t.kept.len() / 10)) {
        println!("speed gain over the way to the noise floor: median {m:.3}, worst tenth {w:.3}");
    }
    println!("time per case: median {:.1} s", t.seconds[t.seconds.len() / 2]);
    Ok(())
}
