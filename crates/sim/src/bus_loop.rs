//! A truck that the stack reaches over a bus only: the virtual truck at one end, what drives it at
//! the other, both in one process and in step.

use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::bus::{Bus, BusError};
use j1939::steering::ExampleSteering;
use j1939::truck::{BusTruck, BusTruckConfig, DriverSetup, Engagement};
use j1939::{BitRate, BusLoad, Frame};
use tractrix_core::{Command, EgoState, Stamped, Time, Vehicle, VehicleLimits, VehicleStatus};

use crate::ecu::{Ahead, EcuConfig, EcuSim};
use crate::{PlantPose, PoseNoise, SimError, SimTruck, Simulated};

/// How long before the first tick both ends come onto the bus, ns: claims, EC1 by broadcast, every
/// signal at least once, and the driver's wish to engage.
const WARM_UP: i64 = 3_000_000_000;
/// Tick of the warm-up, ns.
const WARM_UP_TICK: i64 = 10_000_000;

/// Nodes of a bus in memory.
const ECU_NODE: usize = 0;
const DRIVER_NODE: usize = 1;

/// What drives the truck of a simulation over a bus: addresses and carriers of the standard, the
/// example steering frame.
#[must_use]
pub fn bus_driver_setup(rate: BitRate) -> DriverSetup {
    let steering_key = Some(EcuConfig::default().steering_key);
    DriverSetup { rate, config: BusTruckConfig::default(), steering_key }
}

/// One end's way to the bus. A clone is cut off: who copies both ends connects them again.
pub struct End {
    way: Way,
    sent: BusLoad,
    /// How far this end's clock is ahead of the bus's, ns.
    ahead_ns: i64,
}

enum Way {
    Loopback(LoopbackNode),
    Given(Box<dyn Bus + Send + Sync>),
    CutOff,
}

impl End {
    fn new(way: Way, rate: BitRate) -> Self {
        Self { way, sent: BusLoad::new(rate), ahead_ns: 0 }
    }
}

impl Clone for End {
    fn clone(&self) -> Self {
        Self { way: Way::CutOff, sent: self.sent, ahead_ns: self.ahead_ns }
    }
}

impl std::fmt::Debug for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self.way {
            Way::Loopback(_) => "End(loopback)",
            Way::Given(_) => "End(given)",
            Way::CutOff => "End(cut off)",
        })
    }
}

impl Bus for End {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        let now = now.plus_nanos(-self.ahead_ns);
        match &mut self.way {
            Way::Loopback(node) => node.send(now, frame)?,
            Way::Given(bus) => bus.send(now, frame)?,
            Way::CutOff => return Err(BusError::Off),
        }
        self.sent.add(now, frame);
        Ok(())
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let now = now.plus_nanos(-self.ahead_ns);
        let heard = match &mut self.way {
            Way::Loopback(node) => node.receive(now)?,
            Way::Given(bus) => bus.receive(now)?,
            Way::CutOff => return Err(BusError::Off),
        };
        Ok(heard.map(|heard| Stamped { time: heard.time.plus_nanos(self.ahead_ns), ..heard }))
    }
}

/// The virtual truck and what drives it, at two ends of a bus.
#[derive(Debug)]
pub struct BusLoop {
    /// A bus in memory; none for one outside.
    wire: Option<Loopback>,
    ecu: EcuSim<End>,
    driver: BusTruck<End, PlantPose, ExampleSteering>,
    figures: BusFigures,
    /// How far the driver's clock is ahead, ns.
    ahead_ns: i64,
}

/// How the bus did so far.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct BusFigures {
    /// Highest share of a second in which the bus was busy with both ends' frames, 0 to 1.
    pub peak_load_frac: f64,
    /// Mean of that share over the ticks.
    pub mean_load_frac: f64,
    /// Ticks in which the stack did not drive: before it engaged, or after it let go.
    pub ticks_not_driven: u64,
    /// Demands that the truck refused.
    pub refused: u64,
    /// Frames that the driver's end had no room for.
    pub unsent: u64,
    ticks: u64,
}

impl BusLoop {
    /// Both ends on a bus in memory.
    ///
    /// # Errors
    /// As [`Self::over`].
    pub fn loopback(truck: SimTruck, rate: BitRate) -> Result<Self, SimError> {
        let wire = Loopback::new(rate, 2);
        let end = |node: usize| End::new(Way::Loopback(wire.node(node)), rate);
        let ends = [end(ECU_NODE), end(DRIVER_NODE)];
        Self::new(truck, rate, ends, Some(wire))
    }

    /// Both ends on a bus that somebody else has, a connection each: one outside of this process, or
    /// one with faults. Over one outside, [`crate::in_step`] makes time that of the ticks.
    ///
    /// # Errors
    /// [`SimError`] if the truck's sheet cannot be planned with, the bus fails, or the truck does
    /// not become ready to be driven over it.
    pub fn over(
        truck: SimTruck,
        rate: BitRate,
        ecu: Box<dyn Bus + Send + Sync>,
        driver: Box<dyn Bus + Send + Sync>,
    ) -> Result<Self, SimError> {
        let end = |bus| End::new(Way::Given(bus), rate);
        Self::new(truck, rate, [end(ecu), end(driver)], None)
    }

    fn new(
        truck: SimTruck,
        rate: BitRate,
        [ecu, driver]: [End; 2],
        wire: Option<Loopback>,
    ) -> Result<Self, SimError> {
        let start = Time(-WARM_UP);
        let limits = truck.limits().clone();
        let config = EcuConfig::default();
        let ecu = EcuSim::new(truck, ecu, config, start, Some(Time::ZERO))?;
        let pose = PlantPose::new(PoseNoise::default(), 0, ecu.ego());
        let driver = bus_driver_setup(rate).driver(driver, pose, limits).map_err(drive_error)?;
        let mut looped = Self { wire, ecu, driver, figures: BusFigures::default(), ahead_ns: 0 };
        looped.warm_up(start)?;
        Ok(looped)
    }

    /// Lets both ends meet while the truck is held, and engages as soon as that is possible: the
    /// stack's first command, at time zero, acts.
    fn warm_up(&mut self, start: Time) -> Result<(), SimError> {
        let mut now = start;
        while now < Time::ZERO {
            self.exchange(now)?;
            self.driver.command(now, &Command::default()).map_err(drive_error)?;
            now = now.plus_nanos(WARM_UP_TICK);
        }
        if self.driver.engagement() != Engagement::Ready {
            let state = self.driver.engagement();
            let faults: Vec<_> = self.driver.status().faults().map(|f| f.fault).collect();
            return Err(SimError::Drive(format!(
                "the truck on the bus is not ready to be driven after {} s: {state:?}, {faults:?}",
                WARM_UP / 1_000_000_000
            )));
        }
        self.driver.engage();
        Ok(())
    }

    fn exchange(&mut self, now: Time) -> Result<Stamped<EgoState>, SimError> {
        let truth = self.ecu.advance(now)?;
        let driver_now = now.plus_nanos(self.ahead_ns);
        self.driver.pose_source().feed(&Stamped { time: driver_now, ..truth });
        let ego = self.driver.ego(driver_now).map_err(drive_error)?;
        Ok(Stamped { time: ego.time.plus_nanos(-self.ahead_ns), ..ego })
    }

    /// Sets the driver's clock so far ahead, or back, ns: times in its status are its own.
    pub const fn jump_clock(&mut self, by_ns: i64) {
        self.ahead_ns = self.ahead_ns.saturating_add(by_ns);
        self.driver.bus().ahead_ns = self.ahead_ns;
    }

    /// A copy that goes on bit for bit like this one; none on a bus outside of this process, of
    /// which there is one.
    #[must_use]
    pub fn fork(&self) -> Option<Self> {
        let wire = self.wire.as_ref()?.fork();
        let (ecu, driver) = (self.ecu.clone(), self.driver.clone());
        let (figures, ahead_ns) = (self.figures, self.ahead_ns);
        let mut fork = Self { wire: None, ecu, driver, figures, ahead_ns };
        fork.ecu.bus().way = Way::Loopback(wire.node(ECU_NODE));
        fork.driver.bus().way = Way::Loopback(wire.node(DRIVER_NODE));
        fork.wire = Some(wire);
        Some(fork)
    }

    /// What drives the truck.
    pub const fn driver(&mut self) -> &mut BusTruck<End, PlantPose, ExampleSteering> {
        &mut self.driver
    }

    /// The virtual truck.
    pub const fn ecu(&mut self) -> &mut EcuSim<End> {
        &mut self.ecu
    }

    /// The truth about the truck, as of the last tick.
    #[must_use]
    pub const fn truth(&self) -> &EgoState {
        &self.ecu.ego().value
    }

    /// Shows the truck's radar what is ahead.
    pub(crate) const fn see(&mut self, ahead: Option<Ahead>) {
        self.ecu.see(ahead);
    }

    /// How the bus did so far.
    #[must_use]
    pub fn figures(&self) -> BusFigures {
        BusFigures { refused: self.ecu.refused(), unsent: self.driver.losses().0, ..self.figures }
    }

    fn meter(&mut self, now: Time) {
        let load = self.ecu.bus().sent.share(now) + self.driver.bus().sent.share(now);
        let f = &mut self.figures;
        f.ticks += 1;
        f.peak_load_frac = f.peak_load_frac.max(load);
        f.mean_load_frac += (load - f.mean_load_frac) / f.ticks as f64;
        f.ticks_not_driven += u64::from(self.driver.engagement() != Engagement::Engaged);
    }
}

impl Simulated for BusLoop {
    fn sim(&self) -> &SimTruck {
        self.ecu.sim()
    }
}

impl Vehicle for BusLoop {
    type Error = SimError;

    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, SimError> {
        let ego = self.exchange(now)?;
        self.meter(now);
        Ok(ego)
    }

    fn command(&mut self, now: Time, command: &Command) -> Result<(), SimError> {
        self.driver.command(now.plus_nanos(self.ahead_ns), command).map_err(drive_error)
    }

    fn limits(&self) -> &VehicleLimits {
        self.driver.limits()
    }

    fn status(&self) -> VehicleStatus {
        self.driver.status()
    }
}

fn drive_error(error: impl std::error::Error) -> SimError {
    SimError::Drive(error.to_string())
}
