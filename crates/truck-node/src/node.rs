//! The loop: checks, driving, the stop at the end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use j1939::bus::Bus;
use j1939::steering::ExampleSteering;
use j1939::truck::{BusTruck, Engagement};
use planner::localise::Localiser;
use planner::{Stack, StackConfig, drive_tick};
use recording::DriverWish;
use road::Road;
use serde_json::json;
use tractrix_core::{Command, EgoState, Stamped, Time, Vehicle};

use crate::checks::{Checks, Report, word};
use crate::cli::{Args, Pose, bus_name};
use crate::clock::Clock;
use crate::control::{Asked, Control};
use crate::failure::Failure;
use crate::first_wish::FirstWish;
use crate::health::Health;
use crate::live::Live;
use crate::log::{self, Log};
use crate::nmea::Fixes;
use crate::output;
use crate::pose::NodePose;
use crate::radar::ForwardRadar;
use crate::roll_call::roll_call;
use crate::sheet::Sheet;
use crate::watchdog::Watchdog;

/// The truck behind its bus.
pub(crate) type Truck = BusTruck<Box<dyn Bus + Send + Sync>, NodePose, ExampleSteering>;

/// Below this speed the truck stands, m/s; for so long, s.
const STANDS_M_S: f64 = 0.05;
const STANDS_S: f64 = 1.0;
/// What is missing is told again at most so often, s.
const TELL_S: f64 = 1.0;
/// A bus that fails for so long ends the program: nothing can be asked of the truck, s.
const BUS_GONE_S: f64 = 5.0;

/// What the program is about.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Not everything is in order yet.
    Checking,
    /// All checks were passed; who drives is in the engagement.
    Running,
    /// The minimal-risk manoeuvre, since then.
    Stopping(Time),
}

impl Phase {
    const fn name(self) -> &'static str {
        match self {
            Self::Checking => "checking",
            Self::Running => "running",
            Self::Stopping(_) => "stopping",
        }
    }
}

/// Figures of the loop.
#[derive(Debug, Default)]
struct Figures {
    ticks: u64,
    missed: u64,
    longest: Duration,
    driven_ticks: u64,
    guarded_ticks: u64,
    minimal_risk_ticks: u64,
    least_gap_m: Option<f64>,
    fastest_m_s: f64,
}

/// Runs the program.
///
/// # Errors
/// As its exit codes say.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let clock = Clock::start();
    let sheet = Sheet::load(&args.truck, args.address)?;
    let road = Arc::new(Road::load(&args.map).map_err(Failure::input)?);
    let limits = sheet.limits.clone();
    let config = StackConfig {
        set_speed_m_s: args.set_speed_m_s,
        speed_planner: args.speed_planner.into(),
        ..StackConfig::default()
    };
    let tick = Duration::from_secs_f64(config.rates.tick_s);
    let stack = Stack::new(config, &limits).map_err(Failure::input)?;
    let localiser = Localiser::new(sheet.pose, &limits, Arc::clone(&road))
        .map_err(|e| Failure::input(format!("--map {}: {e}", args.map)))?;
    let receiver = match &args.pose {
        Pose::Bus => None,
        Pose::Nmea(source) => Some(Fixes::open(source, clock)?),
    };
    let watchdog = Watchdog::open(args.watchdog.as_deref())?;
    let health = args.health.map(Health::bind).transpose()?;
    let control = args.control.as_deref().map(Control::bind).transpose()?;
    if let Some(folder) = &args.out {
        log::free(folder, args.overwrite)?;
    }
    let asked_to_end = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&asked_to_end)).map_err(Failure::work)?;
    }
    let name = bus_name(&args.can);
    let bus = j1939::bus::open(&name).map_err(|e| Failure::input(format!("--can {e}")))?;
    let mut bus = Live::new(bus, clock);
    let present = roll_call(&mut bus, clock, &name, sheet.bus.address)?;
    let setup = sheet.bus.setup(args.bit_rate.into(), std::process::id() as u8);
    let log = Log::begin(args, &road, &sheet, stack.config(), &setup)?;
    let pose = NodePose::new(localiser, receiver);
    let truck =
        setup.driver(log.tapped(bus), pose, sheet.limits.clone()).map_err(Failure::input)?;
    let checks = Checks::new(name, sheet.bus, limits.road_load.mass_kg, present);
    let mut node = Node {
        args,
        clock,
        tick,
        radar: ForwardRadar::new(Arc::clone(&road), limits.geometry.front_m),
        road,
        truck,
        stack,
        log,
        checks,
        watchdog,
        health,
        control,
        asked_to_end,
        phase: Phase::Checking,
        wish: DriverWish::None,
        first_wish: FirstWish::default(),
        ego: None,
        figures: Figures::default(),
        told: (String::new(), Time::ZERO),
        drove: Engagement::Off,
        bus_failed: None,
    };
    node.watchdog.ready();
    let ended = node.drive();
    node.finish(ended)
}

struct Node<'a> {
    args: &'a Args,
    clock: Clock,
    tick: Duration,
    road: Arc<Road>,
    truck: Truck,
    radar: ForwardRadar,
    stack: Stack,
    log: Log,
    checks: Checks,
    watchdog: Watchdog,
    health: Option<Health>,
    control: Option<Control>,
    asked_to_end: Arc<AtomicBool>,
    phase: Phase,
    /// What is wished of the truck's driver at the beginning of the next tick.
    wish: DriverWish,
    /// What `--engage-after-checks` still has to bring about.
    first_wish: FirstWish,
    ego: Option<Stamped<EgoState>>,
    figures: Figures,
    /// What was said last about what is missing, and when.
    told: (String, Time),
    /// Who drove in the last tick.
    drove: Engagement,
    bus_failed: Option<Time>,
}

impl Node<'_> {
    /// Ticks until the end.
    fn drive(&mut self) -> Result<(), Failure> {
        let start = self.clock.elapsed();
        let mut due = start;
        let mut stands_since = None;
        loop {
            self.clock.sleep_until(due);
            let began = self.clock.elapsed();
            let now = self.clock.now();
            self.one_tick(now);
            self.tell_change(now);
            if let Some(ended) = self.judge(now, start, &mut stands_since)? {
                return ended;
            }
            let took = self.clock.elapsed().saturating_sub(began);
            self.figures.ticks += 1;
            self.figures.longest = self.figures.longest.max(took);
            self.watch(now);
            self.hear(now);
            due += self.tick;
            // What is late is not made up for: the next tick is the next on the grid
            while due + self.tick < self.clock.elapsed() {
                due += self.tick;
                self.figures.missed += 1;
            }
        }
    }

    /// Reads, plans, commands, records.
    fn one_tick(&mut self, now: Time) {
        self.grant(now);
        self.truck.pose_source().poll();
        self.radar.see(self.truck.lead());
        let (truck, radar, stack) = (&mut self.truck, &mut self.radar, &mut self.stack);
        // What cannot be read is in the checks and in the status
        if let Ok(outcome) = drive_tick(now, truck, radar, stack, &self.road, &mut self.log) {
            self.ego = Some(outcome.ego);
            let f = &mut self.figures;
            if self.truck.engagement().actuates() {
                f.driven_ticks += 1;
                f.guarded_ticks += u64::from(outcome.guarded);
                f.minimal_risk_ticks +=
                    u64::from(self.truck.engagement() == Engagement::MinimalRisk);
                f.fastest_m_s = f.fastest_m_s.max(outcome.ego.value.speed_m_s);
                if let Some((gap_m, _)) = self.radar.lead() {
                    f.least_gap_m = Some(f.least_gap_m.map_or(gap_m, |least| least.min(gap_m)));
                }
            }
        }
    }

    /// Tells the truck's driver what is wished of it, and the recording with it.
    fn grant(&mut self, now: Time) {
        let wish = std::mem::take(&mut self.wish);
        self.log.wished(wish);
        match wish {
            DriverWish::None => {}
            DriverWish::Engage => self.truck.engage(),
            DriverWish::Disengage => self.truck.disengage(now),
            DriverWish::Stop => self.truck.stop(now),
        }
    }

    /// What comes next; `Some` at the end.
    fn judge(
        &mut self,
        now: Time,
        start: Duration,
        stands_since: &mut Option<Time>,
    ) -> Result<Option<Result<(), Failure>>, Failure> {
        let passed = self.clock.elapsed().saturating_sub(start);
        let over = self.args.duration.is_some_and(|s| passed.as_secs_f64() >= s);
        if (over || self.asked_to_end.load(Ordering::Relaxed)) && !self.is_stopping() {
            if !self.truck.engagement().actuates() {
                return Ok(Some(Ok(())));
            }
            output::report(&format!("{:.2} s  asked to end: stops", now.seconds()));
            self.phase = Phase::Stopping(now);
            self.wish = DriverWish::Stop;
        }
        match self.phase {
            Phase::Checking => {
                let report = self.look(now)?;
                if report.is_ready() {
                    output::report(&format!("{:.2} s  ready\n{}", now.seconds(), report.text()));
                    self.phase = Phase::Running;
                    self.first_wish = FirstWish::begins(self.args.engage_after_checks);
                } else if passed.as_secs_f64() >= self.args.ready_within {
                    output::report(&format!(
                        "{:.2} s  not ready\n{}",
                        now.seconds(),
                        report.text()
                    ));
                    let (after_s, waiting) = (self.args.ready_within, report.missing());
                    return Ok(Some(Err(Failure::NotReady { after_s, waiting })));
                } else {
                    self.tell_missing(now, report.missing());
                }
            }
            Phase::Running => {
                let is_open = self.first_wish.is_open(self.truck.engagement());
                if is_open && self.look(now)?.is_ready() {
                    self.wish = DriverWish::Engage;
                }
                self.notice_lost_bus(now)?;
            }
            Phase::Stopping(since) => {
                let speed_m_s = self.ego.map_or(0.0, |ego| ego.value.speed_m_s);
                if !self.truck.engagement().actuates() {
                    output::report(&format!("{:.2} s  the driver has taken over", now.seconds()));
                    return Ok(Some(Ok(())));
                }
                let stands = speed_m_s.abs() < STANDS_M_S;
                *stands_since = if stands { stands_since.or(Some(now)) } else { None };
                if stands_since.is_some_and(|at| now.seconds_since(at) >= STANDS_S) {
                    output::report(&format!("{:.2} s  stands", now.seconds()));
                    return Ok(Some(Ok(())));
                }
                let after_s = now.seconds_since(since);
                if after_s >= self.args.stop_within {
                    return Ok(Some(Err(Failure::StillMoving { speed_m_s, after_s })));
                }
            }
        }
        Ok(None)
    }

    fn is_stopping(&self) -> bool {
        matches!(self.phase, Phase::Stopping(_))
    }

    fn look(&mut self, now: Time) -> Result<Report, Failure> {
        let radar_s = self.truck.lead().map_or(f64::INFINITY, |told| now.seconds_since(told.time));
        self.checks.look(now, &mut self.truck, radar_s)
    }

    /// A bus that is gone for good: nothing reaches the truck, whose control units let go by
    /// themselves, and whoever started the program may start it again.
    fn notice_lost_bus(&mut self, now: Time) -> Result<(), Failure> {
        let Some(error) = self.truck.bus_error() else {
            self.bus_failed = None;
            return Ok(());
        };
        let since = *self.bus_failed.get_or_insert(now);
        if now.seconds_since(since) >= BUS_GONE_S {
            return Err(Failure::work(format!("--can {}: {error}", self.args.can)));
        }
        Ok(())
    }

    fn tell_missing(&mut self, now: Time, missing: String) {
        let (last, at) = &self.told;
        if *last != missing && (last.is_empty() || now.seconds_since(*at) >= TELL_S) {
            output::note(&format!("{:.2} s  waits for {missing}", now.seconds()));
            self.told = (missing, now);
        }
    }

    /// Says who drives, when that changes, and what is wrong.
    fn tell_change(&mut self, now: Time) {
        let drives = self.truck.engagement();
        if drives == self.drove {
            return;
        }
        self.drove = drives;
        let faults: Vec<_> = self.truck.status().faults().map(|f| word(f.fault)).collect();
        let faults =
            if faults.is_empty() { String::new() } else { format!(": {}", faults.join(", ")) };
        output::report(&format!("{:.2} s  {}{faults}", now.seconds(), name_of(drives)));
    }

    /// Feeds the watchdogs, answers who asks.
    fn watch(&mut self, now: Time) {
        let speed_m_s = self.ego.map_or(0.0, |ego| ego.value.speed_m_s);
        let (drives, phase) = (name_of(self.truck.engagement()), self.phase.name());
        let status = || format!("{phase}, {drives}, {speed_m_s:.1} m/s");
        self.watchdog.feed(self.clock.elapsed(), status);
        if let Some(health) = self.health.take() {
            health.serve(|| self.state(now));
            self.health = Some(health);
        }
    }

    /// Hears who wishes to hand over or to drive himself, and says in the next tick what came of it.
    fn hear(&mut self, now: Time) {
        let Some(mut control) = self.control.take() else { return };
        if control.waits() {
            control.answer(name_of(self.truck.engagement()));
        } else if let Some(asked) = control.asked(self.clock.elapsed()) {
            match self.consider(now, asked) {
                Ok(wish) => {
                    self.first_wish.is_over();
                    self.wish = wish;
                }
                Err(why) => control.answer(&format!("refused: {why}")),
            }
        }
        self.control = Some(control);
    }

    /// Engaging again needs what engaging first did: all the checks.
    fn consider(&mut self, now: Time, asked: Asked) -> Result<DriverWish, String> {
        match (self.phase, asked) {
            (_, Asked::Disengage) => Ok(DriverWish::Disengage),
            (Phase::Running, Asked::Engage) => {
                let report = self.look(now).map_err(|failure| failure.to_string())?;
                if report.is_ready() { Ok(DriverWish::Engage) } else { Err(report.missing()) }
            }
            (phase, Asked::Engage) => Err(phase.name().to_owned()),
        }
    }

    /// The state for who asks, and for the end of the recording.
    fn state(&mut self, now: Time) -> serde_json::Value {
        let (ego, f) = (self.ego.map(|ego| ego.value).unwrap_or_default(), &self.figures);
        let faults: Vec<_> = self.truck.status().faults().map(|f| word(f.fault)).collect();
        let guard: Vec<_> = self.stack.plan().guard.iter().map(word).collect();
        let (unsent, short) = self.truck.losses();
        json!({
            "time_s": now.seconds(),
            "phase": self.phase.name(),
            "engagement": name_of(self.drove),
            "faults": faults,
            "guard": guard,
            "speed_m_s": ego.speed_m_s,
            "s_m": ego.s_m,
            "d_m": ego.d_m,
            "pose_deviation_m": finite(self.truck.pose_source().deviation_m()),
            "lead": self.radar.lead().map(|(gap_m, speed_m_s)| json!({ "gap_m": gap_m, "speed_m_s": speed_m_s })),
            "load_frac": self.truck.load(now),
            "frames": self.truck.readiness().frames,
            "frames_unsent": unsent,
            "frames_too_short": short,
            "ticks": f.ticks,
            "missed_deadlines": f.missed,
            "longest_tick_ms": f.longest.as_secs_f64() * 1e3,
            "driven_ticks": f.driven_ticks,
            "guarded_ticks": f.guarded_ticks,
            "recording_broken": self.log.is_broken(),
            "notes_not_recorded": self.log.dropped(),
        })
    }

    /// Lets go of the truck, closes the recording, prints the figures.
    fn finish(mut self, ended: Result<(), Failure>) -> Result<(), Failure> {
        let now = self.clock.now();
        self.truck.disengage(now);
        let _ = self.truck.command(now, &Command::default());
        let state = self.state(now);
        self.watchdog.end();
        let (f, ego) = (&self.figures, self.ego.map(|ego| ego.value).unwrap_or_default());
        let gap =
            f.least_gap_m.map_or("no vehicle ahead".to_owned(), |m| format!("nearest {m:.1} m"));
        let lost = match self.log.dropped() {
            0 => String::new(),
            notes => format!(", {notes} notes not recorded"),
        };
        output::report(&format!(
            "{:.2} s  let go at {:.1} m/s: drove {} of {} ticks ({} of them guarded, {} minimal \
             risk), up to {:.1} m/s, {gap}, {} deadlines missed, longest tick {:.1} ms{lost}",
            now.seconds(),
            ego.speed_m_s,
            f.driven_ticks,
            f.ticks,
            f.guarded_ticks,
            f.minimal_risk_ticks,
            f.fastest_m_s,
            f.missed,
            f.longest.as_secs_f64() * 1e3,
        ));
        let recorded = self.log.finish(&state);
        ended.and(recorded)
    }
}

/// JSON has no infinity.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

const fn name_of(drives: Engagement) -> &'static str {
    match drives {
        Engagement::Off => "off",
        Engagement::Ready => "ready",
        Engagement::Engaged => "engaged",
        Engagement::Override => "override",
        Engagement::MinimalRisk => "minimal risk",
    }
}
