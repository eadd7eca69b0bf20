//! Hides effects in generated drives and counts what the diagnosis makes of them:
//! `campaign KIND COUNT SEED [drives=N] [held=N] [seconds=S] [tolerance=F] [baseline_tolerance=F]
//! [without=channel,channel] [only=cause] [from=CASE] [to=CASE] [cases=N,N,...] [dump=DIR]
//! [family=1|2]`, KIND one of `clean`, `small`, `medium`, `large`, `pairs`, `outside`, `deleted`,
//! `noise`. Two lines per case, one for people (`.` exact, `+` first right, `-` nothing, `X` wrong) and
//! one of JSON, then the table. `family=2` takes shapes, driver, roads and noise that were written apart
//! (`tests/support/second`). KIND `noise` says of the baseline how sums over rows scatter and how many
//! drives show how much scatter about every cause.
//! `campaign calibration FILE... [plot=PICTURE.svg]` pools the outputs of runs.
#![expect(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "an example prints and takes times"
)]

#[path = "campaign/calibration.rs"]
mod calibration;
#[path = "real_data/plot.rs"]
mod plot;
#[allow(dead_code, clippy::unwrap_used, reason = "each user of the generator needs a part of it")]
#[path = "../tests/support/mod.rs"]
mod support;
#[path = "campaign/truth.rs"]
mod truth;

use std::path::Path;

use diagnosis::{
    Baseline, Channel, Diagnosis, Drive, DriveSet, Options, Plant, Serial, Verdict, diagnose_with,
};
use dynamics::TruckParameters;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::effects::{Effect, Magnitude, SIZES, Shape, hide};
use support::outside::OUTSIDE;
use support::random::{between, sign};
use support::second::outside::SECOND_OUTSIDE;
use support::{Campaign, generate_apart, second};

const USAGE: &str = "usage: campaign KIND COUNT SEED [drives=N] [held=N] [seconds=S] [tolerance=F] [baseline_tolerance=F] [without=channel,...] [only=cause] [from=CASE] [to=CASE] [cases=N,...] [dump=DIR] [family=1|2]\n       campaign calibration FILE... [plot=PICTURE.svg]";

#[derive(Default)]
struct Table {
    family: u32,
    cases: usize,
    first: usize,
    exact: usize,
    any: usize,
    all: usize,
    silent: usize,
    unseen: usize,
    wrong: usize,
    /// Stated as the explanation, with a cause that was not hidden among those named.
    helped: usize,
    unknown: usize,
    signal: usize,
    unsure: usize,
    intervals: usize,
    covered: usize,
    gains: usize,
    worse: usize,
    seconds: Vec<f64>,
    kept: Vec<f64>,
    /// Stated probability of every named cause, and whether it was hidden.
    stated: Vec<(f64, bool)>,
}

/// Causes that the speed shows when torque, pressure and gear are as measured.
const ON_SPEED: [&str; 17] = [
    "rolling_resistance",
    "air_drag",
    "headwind",
    "wind",
    "mass",
    "grade_bias",
    "map_shift",
    "tyre_warmup",
    "driveline_loss",
    "fan_load",
    "dragging_brake",
    "engine_friction",
    "brake_gain",
    "brake_fade",
    "engine_brake_torque",
    "hidden_retarder",
    "speed_scale",
];

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
            let or = if or.is_empty() { String::new() } else { format!(" or {or:?}") };
            format!("{}[{}] {:.0} nats p={:.2}{or}", c.id, p.join(" "), c.evidence, c.probability)
        })
        .collect();
    let unknown = d.unknown.as_ref().map_or(String::new(), |u| {
        format!(" unknown: {} by {:?} {:.0} nats", u.quantity, u.signals, u.evidence)
    });
    let not: Vec<&str> = d.not_observable.iter().map(|n| n.id).collect();
    let not = if not.is_empty() { String::new() } else { format!(" not observable {not:?}") };
    format!("{:?} {}{unknown}{not}", d.verdict, causes.join(" + "))
}

/// What is hidden in a case of a kind.
fn draw(
    kind: &str,
    family: u32,
    case: usize,
    only: Option<&str>,
    rng: &mut ChaCha8Rng,
) -> Option<Vec<Effect>> {
    let single = |m: Magnitude, rng: &mut ChaCha8Rng| {
        let id = only.unwrap_or(SIZES[case % SIZES.len()].0);
        hide(id, m, rng).map(|e| vec![e])
    };
    match kind {
        "clean" => Some(Vec::new()),
        "small" => single(Magnitude::Small, rng),
        "medium" | "deleted" => single(Magnitude::Medium, rng),
        "large" => single(Magnitude::Large, rng),
        "pairs" => {
            let n = SIZES.len();
            let a = rng.random_range(0..n);
            let b = (a + rng.random_range(1..n)) % n;
            let mut either = |i: usize| {
                let m = if rng.random::<bool>() { Magnitude::Medium } else { Magnitude::Large };
                hide(SIZES[i].0, m, rng)
            };
            Some([either(a)?, either(b)?].into())
        }
        "outside" if family == 2 => {
            let &(kind, usual, either, _) = &SECOND_OUTSIDE[case % SECOND_OUTSIDE.len()];
            let size = if either { sign(rng) } else { 1.0 } * usual * between(rng, 0.7, 1.3);
            Some(vec![Effect::SecondOutside { kind, size, shape: Shape::draw(rng) }])
        }
        "outside" => {
            let o = &OUTSIDE[case % OUTSIDE.len()];
            let positive = o.1 > 1.0 || o.2 == "shift_in_process" || o.1 == 0.5;
            let sign = if positive { 1.0 } else { sign(rng) };
            let size = sign * o.1 * between(rng, 0.7, 1.3);
            Some(vec![Effect::Outside { kind: o.0, size, shape: Shape::draw(rng) }])
        }
        _ => None,
    }
}

impl Table {
    /// Counts a case; returns its mark and how far the sizes are off. `oracle` is the error of the
    /// speed that the true model leaves on the drives held out, m/s.
    fn count(
        &mut self,
        hidden: &[Effect],
        d: &Diagnosis,
        deleted: bool,
        oracle: Option<f64>,
    ) -> (char, String) {
        let truth: Vec<&str> = hidden
            .iter()
            .filter_map(|e| if let Effect::Cause { id, .. } = e { Some(*id) } else { None })
            .collect();
        let named: Vec<&str> = d.causes.iter().map(|c| c.id).collect();
        let observable = |id: &&&str| !d.not_observable.iter().any(|n| n.id == **id);
        let visible: Vec<&&str> = truth.iter().filter(observable).collect();
        self.cases += 1;
        let hit = visible.iter().filter(|id| named.contains(**id)).count();
        let unseen = visible.is_empty() && named.is_empty();
        let first = named.first().is_some_and(|n| truth.contains(n)) || unseen;
        self.unseen += usize::from(unseen && !truth.is_empty());
        let all = hit == visible.len();
        let exact = all && named.len() == visible.len() && d.verdict != Verdict::Unknown;
        self.first += usize::from(first);
        self.all += usize::from(all);
        self.any += usize::from(hit > 0 || unseen);
        self.exact += usize::from(exact);
        self.silent += usize::from(d.verdict == Verdict::NothingToExplain);
        self.wrong += usize::from(
            d.verdict == Verdict::Explained && named.first().is_some_and(|n| !truth.contains(n)),
        );
        self.helped += usize::from(
            d.verdict == Verdict::Explained && named.iter().any(|n| !truth.contains(n)),
        );
        self.unknown += usize::from(d.verdict == Verdict::Unknown);
        self.unsure += usize::from(d.verdict != Verdict::Explained);
        let counts = match hidden.first() {
            Some(Effect::Outside { kind, .. }) => {
                OUTSIDE.iter().find(|o| o.0 == *kind).map(|o| o.3)
            }
            Some(Effect::SecondOutside { kind, .. }) => {
                SECOND_OUTSIDE.iter().find(|o| o.0 == *kind).map(|o| o.3)
            }
            _ => None,
        };
        let first_signal = d.unknown.as_ref().and_then(|u| u.signals.first());
        let right = d.verdict == Verdict::Unknown
            && counts.zip(first_signal).is_some_and(|(c, s)| c.contains(s));
        self.signal += usize::from(right);
        let stated = d.causes.iter().map(|c| (c.probability, truth.contains(&c.id)));
        self.stated.extend(stated.filter(|_| !deleted));
        let mut off = String::new();
        for i in truth::intervals(self.family, hidden, d) {
            self.intervals += 1;
            self.covered += usize::from(i.covers());
            off += &format!(" z={:.1}", i.off());
        }
        if let Some(g) = &d.gain {
            self.gains += 1;
            self.worse += usize::from(!g.significant);
            let (b, a) = (g.speed_rmse_m_s.before, g.speed_rmse_m_s.after);
            let acts = truth.iter().any(|id| ON_SPEED.contains(id));
            if let Some(o) = oracle.filter(|o| acts && b > 1.5 * o && hit > 0 && !deleted) {
                self.kept.push((b - a) / (b - o));
                off += &format!(" speed {b:.3} to {a:.3} of {o:.3} m/s");
            }
        }
        let mark = match () {
            () if deleted || truth.is_empty() && !hidden.is_empty() => {
                if right || deleted && d.verdict != Verdict::Explained { '.' } else { 'X' }
            }
            () if exact => '.',
            () if first => '+',
            () if named.is_empty() => '-',
            () => 'X',
        };
        (mark, off)
    }

    fn print(&mut self, kind: &str, seed: u64) {
        let of = |n: usize| {
            format!("{n}/{} ({:.1} %)", self.cases, 100.0 * n as f64 / self.cases.max(1) as f64)
        };
        self.seconds.sort_by(f64::total_cmp);
        self.kept.sort_by(f64::total_cmp);
        println!("\n{kind}, seed {seed}: {} cases", self.cases);
        println!("first cause right   {}", of(self.first));
        println!("all named           {}", of(self.all));
        println!("at least one named  {}", of(self.any));
        println!("exact set           {}", of(self.exact));
        println!("not observable      {}", of(self.unseen));
        println!("nothing to explain  {}", of(self.silent));
        println!(
            "unknown             {}, right signal first {}",
            of(self.unknown),
            of(self.signal)
        );
        println!("not stated as sure  {}", of(self.unsure));
        println!(
            "confident and wrong {}, in a cause beside it {}",
            of(self.wrong),
            of(self.helped)
        );
        println!("90 % intervals that cover {} of {}", self.covered, self.intervals);
        println!(
            "extension withheld, not significant on held-out drives {} of {}",
            self.worse, self.gains
        );
        if let (Some(m), Some(w)) =
            (self.kept.get(self.kept.len() / 2), self.kept.get(self.kept.len() / 10))
        {
            println!("speed gain over that of the true model: median {m:.3}, worst tenth {w:.3}");
        }
        if !self.stated.is_empty() {
            let count = self.stated.len() as f64;
            let of = |f: fn(&(f64, bool)) -> f64| self.stated.iter().map(f).sum::<f64>() / count;
            println!(
                "named causes {count}: mean probability {:.3}, hidden {:.3}, Brier score {:.4}",
                of(|s| s.0),
                of(|s| f64::from(u8::from(s.1))),
                of(|s| (s.0 - f64::from(u8::from(s.1))).powi(2)),
            );
        }
        if let Some(s) = self.seconds.get(self.seconds.len() / 2) {
            println!("time per case: median {s:.1} s");
        }
    }
}

/// Effects with sizes and shapes, in words.
fn named(hidden: &[Effect]) -> String {
    let words = hidden.iter().map(|e| match e {
        Effect::Cause { id, size, shape } => format!("{id} {size:.4} {:.2?}", shape.0),
        Effect::Outside { kind, size, shape } => format!("{kind:?} {size:.4} {:.2?}", shape.0),
        Effect::SecondOutside { kind, size, shape } => {
            format!("{kind:?} {size:.4} {:.2?}", shape.0)
        }
    });
    words.collect::<Vec<_>>().join(" & ")
}

/// Soft drive tyres with slow steering make a truck that swings ever wider.
fn stays_on_the_road(set: &DriveSet) -> bool {
    let wheel = |d: &diagnosis::Drive| {
        d.get(Channel::SteeringWheelRad).is_none_or(|w| w.iter().all(|x| x.abs() < 12.0))
    };
    set.drives.iter().all(wheel)
}

/// What a baseline knows of its noise: variance of sums over that of white noise, and the scatter about
/// the sizes of every hypothesis with the drives that show it.
fn noise(
    plant: &Plant,
    baseline: &Baseline,
    clean: &DriveSet,
) -> Result<(), Box<dyn std::error::Error>> {
    for rows in [1, 16, 64, 256, 1024] {
        for n in baseline.noise_of_sums(plant, clean, rows, &Serial)? {
            println!(
                "{rows:4} rows {:22} {:6.2} with slow noise {:6.2}",
                n.quantity, n.autoregressive, n.slow
            );
        }
    }
    for s in baseline.scatter_of_sizes() {
        println!("{:28} {:6.2} times, {:.1} drives", s.id, s.ratio, s.drives);
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let kind = arguments.first().ok_or(USAGE)?.as_str();
    if kind == "calibration" {
        let mut cases = Vec::new();
        let given = arguments.get(1..).filter(|f| !f.is_empty()).ok_or(USAGE)?;
        for file in given.iter().filter(|a| !a.starts_with("plot=")) {
            let text = std::fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
            cases.extend(calibration::read(&text).map_err(|e| format!("{file}: {e}"))?);
        }
        print!("{}", calibration::report(&cases));
        if let Some(path) = given.iter().find_map(|a| a.strip_prefix("plot=")) {
            calibration::draw(&cases, Path::new(path))?;
        }
        return Ok(());
    }
    let count: usize = arguments.get(1).ok_or(USAGE)?.parse()?;
    let seed: u64 = arguments.get(2).ok_or(USAGE)?.parse()?;
    let option = |key: &str| arguments.iter().find_map(|a| a.strip_prefix(key));
    let number = |key: &str, default: usize| option(key).map_or(Ok(default), str::parse::<usize>);
    let mut campaign = Campaign::FULL;
    campaign.drives = number("drives=", campaign.drives)?;
    let held = number("held=", 0)?;
    if let Some(s) = option("seconds=") {
        campaign.duration_s = s.parse()?;
    }
    // How far trucks in order differ from drive to drive, 1 as usual; those of the baseline, too, unless
    // said.
    if let Some(f) = option("tolerance=") {
        campaign.tolerance = f.parse()?;
    }
    let baseline_tolerance =
        option("baseline_tolerance=").map_or(Ok(campaign.tolerance), str::parse)?;
    let listed = |case: usize| {
        let case = case.to_string();
        option("cases=").is_none_or(|list| list.split(',').any(|c| c == case))
    };
    let family: u32 = option("family=").map_or(Ok(1), str::parse)?;
    let generate = match family {
        1 => generate_apart,
        2 => second::generate,
        _ => return Err(USAGE.into()),
    };
    let (from, to) = (number("from=", 0)?, number("to=", usize::MAX)?);
    let plant = Plant::of_truck(&TruckParameters::load("reference")?)?;
    let usual = Campaign { drives: 8, tolerance: baseline_tolerance, ..campaign };
    let clean = generate(&[], &usual, seed.wrapping_mul(7919) + 1);
    let baseline = Baseline::learn(&plant, &clean, &Serial)?;
    if kind == "noise" {
        return noise(&plant, &baseline, &clean);
    }
    let mut t = Table { family, ..Table::default() };
    for case in 0..count.min(to) {
        let case_seed = seed.wrapping_mul(1_000_003) + case as u64;
        let mut rng = ChaCha8Rng::seed_from_u64(case_seed ^ 0x5eed);
        let hidden = draw(kind, family, case, option("only="), &mut rng).ok_or(USAGE)?;
        if case < from || !listed(case) {
            continue;
        }
        let mut set = generate(&hidden, &campaign, case_seed);
        if let Some(without) = option("without=") {
            for name in without.split(',') {
                let channel = Channel::of(name).ok_or_else(|| format!("no channel {name}"))?;
                set.drives.iter_mut().for_each(|d| d.remove(channel));
            }
        }
        if !stays_on_the_road(&set) {
            println!("  {case} left out: with {} nobody keeps the lane", named(&hidden));
            continue;
        }
        if let Some(folder) = option("dump=") {
            dump(&set, Path::new(folder))?;
        }
        let mut options = Options::default();
        let names = set.drives.iter().rev().take(held).map(|d| d.name.clone());
        options.hold_out = names.collect();
        let deleted = kind == "deleted";
        if deleted {
            options.excluded = hidden
                .iter()
                .filter_map(|e| match e {
                    Effect::Cause { id, .. } => Some((*id).to_owned()),
                    Effect::Outside { .. } | Effect::SecondOutside { .. } => None,
                })
                .collect();
        }
        let start = std::time::Instant::now();
        let d = diagnose_with(&plant, &set, Some(&baseline), &options, &Serial, &mut |_| {})?;
        let seconds = start.elapsed().as_secs_f64();
        t.seconds.push(seconds);
        // The same roads, loads, weather and tolerances without what is hidden: the error that is
        // left there is what the true model leaves.
        let oracle = d.gain.as_ref().filter(|_| kind != "outside").map(|g| {
            let twin = generate(&[], &campaign, case_seed);
            let held = twin.drives.iter().filter(|d| g.held_out.contains(&d.name));
            baseline.speed_rmse_m_s(&plant, held)
        });
        let (mark, off) = t.count(&hidden, &d, deleted, oracle);
        println!("{mark} {case} {} | {seconds:.1} s {}{off}", named(&hidden), line(&d));
        let record = calibration::Case::of((family, kind, seed, case), &hidden, &d);
        println!("{}", serde_json::to_string(&record)?);
    }
    t.print(kind, seed);
    Ok(())
}
