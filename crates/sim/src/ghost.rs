//! The ghost: the same truck under ordinary cruise control on the same road without traffic, and
//! what the truck saves against it.
//!
//! The ghost starts where and as the truck does, holds the same set speed, lets itself roll 5 km/h
//! faster on descents before it brakes, and stays in its lane. It is a truck and a stack of its own:
//! nothing of the run depends on it, and one ghost is the same for every run of a scenario.
//!
//! Both are compared at one place, the truck's, so that height cancels: the ghost drives ahead to it
//! where it is slower. [`Price`] says what the difference in time and speed is worth. Traffic costs
//! fuel and time that no driver can save; so the comparison is made a second time over only those
//! stretches on which traffic did not hold the truck up. It does so until the truck has got back the
//! speed that it was held up from.

use std::convert::Infallible;
use std::sync::Arc;

use planner::pcc::{Leg, Price, SpeedBand, TripRequest, Tuning, profile_of};
use planner::{DeciderKind, RatesConfig, SpeedPlannerKind, Stack, StackConfig};
use road::Road;
use serde::Serialize;
use tractrix_core::{EgoState, Scene, Time, TrafficSource, Vehicle};

use crate::{Scenario, SimError, SimTruck};

/// The ghost rolls this much above its set speed on descents, m/s.
const OVERSPEED_M_S: f64 = 5.0 / 3.6;
/// The drives are compared, and the ghost's is kept, every so many metres.
const STEP_M: f64 = 5.0;
/// A ghost that stands still leaves a trace every so many seconds.
const STEP_S: f64 = 5.0;
/// Spacing of the road profile that the price of time is found on, m.
const PROFILE_STEP_M: f64 = 12.5;
/// The ghost's drive ends so far before the end of the road, m.
const END_MARGIN_M: f64 = 5.0;
/// A truck that was held up has not got over it while it is slower than the ghost by this, m/s: more
/// than a planner slows by itself.
const REGAINED_M_S: f64 = 3.0;
/// A ghost that takes this much longer than the truck to one place has got stuck, s.
const STUCK_S: f64 = 600.0;

/// Where the ghost is, and how truck and ghost compare (keys of `summary.json` and of a frame).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Default)]
pub struct GhostReport {
    /// The ghost's station now, m.
    pub s_m: f64,
    /// The ghost's offset there, m.
    pub d_m: f64,
    /// Its speed now, m/s.
    pub speed_m_s: f64,
    /// Place of the comparison, the truck's, m.
    pub compared_s_m: f64,
    /// Fuel that the ghost burns to there, g.
    pub fuel_g: f64,
    /// Time that the ghost takes to there, s.
    pub time_s: f64,
    /// Fuel that the truck has burnt to there, g.
    pub ego_fuel_g: f64,
    /// Time that the truck has taken to there, s.
    pub ego_time_s: f64,
    /// Kinetic energy of the truck there less that of the ghost, J.
    pub spare_kinetic_j: f64,
    /// What a second is worth, g/s; none where the road could not be planned.
    pub price_of_time_g_s: Option<f64>,
    /// What a joule of kinetic energy is worth, g/J.
    pub price_of_energy_g_j: Option<f64>,
    /// Fuel saved against the ghost at equal trip time and equal speed there.
    pub saving_frac: Option<f64>,
    /// The same over the stretches on which traffic did not hold the truck up.
    pub free_saving_frac: Option<f64>,
    /// Time for which traffic held the truck up, until it has its speed back, s.
    pub held_up_s: f64,
    /// Distance over which traffic held the truck up, m.
    pub held_up_m: f64,
}

/// A place that a drive has passed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Passed {
    s_m: f64,
    d_m: f64,
    time_s: f64,
    fuel_g: f64,
    speed_m_s: f64,
}

impl Passed {
    fn new(now: Time, ego: &EgoState) -> Self {
        Self {
            s_m: ego.s_m,
            d_m: ego.d_m,
            time_s: now.seconds(),
            fuel_g: ego.powertrain.fuel_used_g,
            speed_m_s: ego.speed_m_s,
        }
    }

    /// On the way to another, `share` of it done.
    fn towards(&self, to: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        Self {
            s_m: mix(self.s_m, to.s_m),
            d_m: mix(self.d_m, to.d_m),
            time_s: mix(self.time_s, to.time_s),
            fuel_g: mix(self.fuel_g, to.fuel_g),
            speed_m_s: mix(self.speed_m_s, to.speed_m_s),
        }
    }

    fn leg_to(&self, to: &Self, mass_kg: f64) -> Leg {
        let kinetic = |v: f64| 0.5 * mass_kg * v * v;
        Leg {
            fuel_g: to.fuel_g - self.fuel_g,
            time_s: to.time_s - self.time_s,
            kinetic_j: kinetic(to.speed_m_s) - kinetic(self.speed_m_s),
        }
    }
}

/// Truck and ghost over the same stretches.
#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    ego: Leg,
    ghost: Leg,
}

impl Pair {
    fn add(&mut self, ego: &Leg, ghost: &Leg) {
        for (sum, leg) in [(&mut self.ego, ego), (&mut self.ghost, ghost)] {
            sum.fuel_g += leg.fuel_g;
            sum.time_s += leg.time_s;
            sum.kinetic_j += leg.kinetic_j;
        }
    }

    fn saving(&self, price: Option<Price>) -> Option<f64> {
        price.and_then(|price| price.saving_frac(&self.ego, &self.ghost))
    }
}

/// No other vehicles.
#[derive(Debug, Clone, Default)]
struct EmptyRoad(Scene);

impl TrafficSource for EmptyRoad {
    type Error = Infallible;

    fn advance(&mut self, now: Time, _ego: &EgoState) -> Result<&Scene, Infallible> {
        self.0.time = now;
        Ok(&self.0)
    }
}

/// The ghost of a run.
#[derive(Debug, Clone)]
pub struct Ghost {
    truck: SimTruck,
    stack: Stack,
    road: Arc<Road>,
    nobody: EmptyRoad,
    now: Time,
    tick_ns: i64,
    /// The ghost's drive so far, [`STEP_M`] apart, and its last place.
    trace: Vec<Passed>,
    tip: Passed,
    ended: bool,
    mass_kg: f64,
    price: Option<Price>,
    all: Pair,
    free: Pair,
    /// Where the comparison has got to: truck and ghost.
    at: Option<(Passed, Passed)>,
    /// Traffic holds the truck up, or it has not got its speed back since.
    held_up: bool,
    held_up_here: bool,
    held_up_s: f64,
    held_up_m: f64,
    last: Option<Passed>,
}

impl Ghost {
    /// The ghost of a scenario's run with this truck at its start; finds the price of time on the
    /// road ahead, which takes about a tenth of a second for 15 km.
    ///
    /// # Errors
    /// [`SimError::Stack`] if the stack cannot be built.
    pub fn new(scenario: &Scenario, truck: SimTruck, road: &Arc<Road>) -> Result<Self, SimError> {
        let config = StackConfig {
            speed_planner: SpeedPlannerKind::Cruise,
            overspeed_m_s: OVERSPEED_M_S,
            decider: DeciderKind::KeepLane,
            rates: RatesConfig::for_tick(scenario.run.tick_s),
            ..scenario.stack.clone()
        };
        let price = price(scenario, &truck, road);
        Ok(Self {
            stack: Stack::new(config, truck.limits())?,
            mass_kg: truck.limits().road_load.mass_kg,
            truck,
            road: Arc::clone(road),
            nobody: EmptyRoad::default(),
            now: Time::ZERO,
            tick_ns: Time::from_seconds(scenario.run.tick_s).0,
            trace: Vec::new(),
            tip: Passed::default(),
            ended: false,
            price,
            all: Pair::default(),
            free: Pair::default(),
            at: None,
            held_up: false,
            held_up_here: false,
            held_up_s: 0.0,
            held_up_m: 0.0,
            last: None,
        })
    }

    /// Takes where the truck is now, and whether traffic holds it up; drives the ghost on to now and
    /// at least to the truck's place.
    pub fn follow(&mut self, now: Time, ego: &EgoState, held_up: bool) {
        self.drive_to(now, ego.s_m);
        let here = Passed::new(now, ego);
        let ghost = self.passed(here.s_m);
        let slower = ghost.is_some_and(|ghost| here.speed_m_s < ghost.speed_m_s - REGAINED_M_S);
        self.held_up = held_up || self.held_up && slower;
        if let Some(last) = self.last.replace(here)
            && self.held_up
        {
            self.held_up_here = true;
            self.held_up_s += here.time_s - last.time_s;
            self.held_up_m += here.s_m - last.s_m;
        }
        let due = self.at.is_none_or(|(at, _)| here.s_m >= at.s_m + STEP_M);
        let Some(ghost) = ghost.filter(|_| due) else { return };
        if let Some((from, ghost_from)) = self.at.replace((here, ghost)) {
            let ego = from.leg_to(&here, self.mass_kg);
            let ghost = ghost_from.leg_to(&ghost, self.mass_kg);
            self.all.add(&ego, &ghost);
            if !self.held_up_here {
                self.free.add(&ego, &ghost);
            }
        }
        self.held_up_here = false;
    }

    /// Where the ghost is at `now`, and the comparison so far.
    #[must_use]
    pub fn report(&self, now: Time) -> GhostReport {
        let is = self.where_is(|p| p.time_s, now.seconds());
        GhostReport {
            s_m: is.s_m,
            d_m: is.d_m,
            speed_m_s: is.speed_m_s,
            compared_s_m: self.at.map_or(is.s_m, |(ego, _)| ego.s_m),
            fuel_g: self.all.ghost.fuel_g,
            time_s: self.all.ghost.time_s,
            ego_fuel_g: self.all.ego.fuel_g,
            ego_time_s: self.all.ego.time_s,
            spare_kinetic_j: self.all.ego.kinetic_j - self.all.ghost.kinetic_j,
            price_of_time_g_s: self.price.map(|p| p.time_g_s),
            price_of_energy_g_j: self.price.map(|p| p.energy_g_j),
            saving_frac: self.all.saving(self.price),
            free_saving_frac: self.free.saving(self.price),
            held_up_s: self.held_up_s,
            held_up_m: self.held_up_m,
        }
    }

    /// Drives on until both the time and the place are reached, or the ghost's drive ends.
    fn drive_to(&mut self, now: Time, s_m: f64) {
        while !self.ended && (self.now <= now || self.tip.s_m < s_m) {
            let Self { truck, stack, road, nobody, .. } = self;
            let ticked = planner::drive_tick(self.now, truck, nobody, stack, road, &mut ());
            let ego = truck.state();
            let here = Passed::new(self.now, ego);
            let front_m = ego.s_m + truck.limits().geometry.front_m;
            // A truck that stands still leaves a trace too.
            let kept = self
                .trace
                .last()
                .is_none_or(|p| here.s_m >= p.s_m + STEP_M || here.time_s >= p.time_s + STEP_S);
            self.ended = ticked.is_err()
                || front_m + END_MARGIN_M >= self.road.length_m()
                || self.now.seconds_since(now) > STUCK_S;
            if kept {
                self.trace.push(here);
            }
            self.tip = here;
            self.now = self.now.plus_nanos(self.tick_ns);
        }
    }

    /// The ghost at a place that it has passed.
    fn passed(&self, s_m: f64) -> Option<Passed> {
        (self.tip.s_m >= s_m).then(|| self.where_is(|p| p.s_m, s_m))
    }

    /// The ghost where a value that grows along its drive is `at`; its last place beyond that.
    fn where_is(&self, value: impl Fn(&Passed) -> f64, at: f64) -> Passed {
        let k = self.trace.partition_point(|p| value(p) <= at);
        let b = self.trace.get(k).unwrap_or(&self.tip);
        let Some(a) = k.checked_sub(1).and_then(|k| self.trace.get(k)) else { return *b };
        let width = value(b) - value(a);
        a.towards(b, if width > 0.0 { ((at - value(a)) / width).min(1.0) } else { 0.0 })
    }
}

/// What a second and a joule are worth on the scenario's road from its start on.
fn price(scenario: &Scenario, truck: &SimTruck, road: &Road) -> Option<Price> {
    let (set_m_s, horizon) = (scenario.stack.set_speed_m_s, &scenario.stack.speed_plan);
    let start_m = truck.state().s_m;
    let profile: Vec<_> =
        profile_of(road, PROFILE_STEP_M).into_iter().filter(|p| p.s_m >= start_m).collect();
    Price::of_trip(&TripRequest {
        profile: &profile,
        truck: truck.limits(),
        band: SpeedBand {
            set_m_s,
            min_m_s: set_m_s - horizon.below_m_s,
            max_m_s: set_m_s + horizon.above_m_s,
        },
        trip_time_s: None,
        eco_roll: horizon.eco_roll,
        tuning: Tuning::default(),
    })
    .ok()
}
