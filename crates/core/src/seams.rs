//! The seam traits: each has two real implementations or more.

use serde::{Deserialize, Serialize};

use crate::{Command, EgoState, LaneChoice, Plan, Scene, Time, VehicleLimits, VehicleStatus};

/// A value and the time at which it was true.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Stamped<T> {
    /// When the value was measured.
    pub time: Time,
    /// The value.
    pub value: T,
}

/// A truck: simulated directly, simulated behind a bus, or real.
pub trait Vehicle {
    /// What can go wrong at this seam.
    type Error: core::error::Error;
    /// The latest state at `now`.
    ///
    /// # Errors
    /// When the truck cannot be read at all; an old state is returned with its old stamp instead.
    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, Self::Error>;
    /// Gives the command that acts from `now` to the next tick.
    ///
    /// # Errors
    /// When the command cannot be delivered.
    fn command(&mut self, now: Time, command: &Command) -> Result<(), Self::Error>;
    /// What the truck can do, as far as it is known now (mass estimate included).
    fn limits(&self) -> &VehicleLimits;
    /// What is wrong with the truck as of the last [`Self::ego`], and how old its signals are. A
    /// truck that is simulated directly is in order.
    fn status(&self) -> VehicleStatus {
        VehicleStatus::default()
    }
}

/// Where the other vehicles come from.
pub trait TrafficSource {
    /// What can go wrong at this seam.
    type Error: core::error::Error;
    /// Moves the traffic to `now`, given the ego, and returns the scene at `now`.
    ///
    /// # Errors
    /// When the source fails; the caller decides whether the run goes on.
    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, Self::Error>;
}

/// One record of the loop.
#[derive(Debug, Clone, Copy)]
pub struct Tick<'a> {
    /// Time of the tick.
    pub now: Time,
    /// Ego state used by the plan.
    pub ego: &'a EgoState,
    /// Scene used by the plan.
    pub scene: &'a Scene,
    /// The plan, its command included.
    pub plan: &'a Plan,
}

/// One step of the stack: all that it was given, and what it commanded. The same steps in the same
/// order give the same commands.
#[derive(Debug, Clone, Copy)]
pub struct Step<'a> {
    /// Time of the tick.
    pub now: Time,
    /// The truck's state; `None`: it could not be read.
    pub ego: Option<&'a Stamped<EgoState>>,
    /// What is wrong with the truck.
    pub status: &'a VehicleStatus,
    /// The other vehicles; `None`: the traffic source failed, or the truck could not be read.
    pub scene: Option<&'a Scene>,
    /// What the truck can do.
    pub limits: &'a VehicleLimits,
    /// Limit on the whole road beside its own ones, m/s.
    pub limit_cap_m_s: Option<f64>,
    /// The driver's set speed, m/s.
    pub set_speed_m_s: f64,
    /// The lane change that is wished from outside and was not looked at yet.
    pub wish: LaneChoice,
    /// The command.
    pub command: &'a Command,
}

/// Takes one record per tick. Recording never changes the run: `()` records nothing.
pub trait Recorder {
    /// Takes the record. A recorder keeps its own failure and reports it when it is finished.
    fn record(&mut self, tick: &Tick<'_>);
    /// Takes the step of the stack, before its command is delivered; also that of a tick in which
    /// the truck or the traffic failed, which has no record.
    fn step(&mut self, _step: &Step<'_>) {}
}

impl Recorder for () {
    fn record(&mut self, _tick: &Tick<'_>) {}
}

impl<A: Recorder, B: Recorder> Recorder for (A, B) {
    fn record(&mut self, tick: &Tick<'_>) {
        self.0.record(tick);
        self.1.record(tick);
    }

    fn step(&mut self, step: &Step<'_>) {
        self.0.step(step);
        self.1.step(step);
    }
}

impl<R: Recorder + ?Sized> Recorder for &mut R {
    fn record(&mut self, tick: &Tick<'_>) {
        (**self).record(tick);
    }

    fn step(&mut self, step: &Step<'_>) {
        (**self).step(step);
    }
}
