//! What can be broken about a run while it drives: how the stack sees the world, and the truck's
//! control units.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::str::FromStr;

use tractrix_core::{
    Command, EgoState, Scene, Stamped, Time, TrafficSource, Vehicle, VehicleLimits, VehicleStatus,
};

use crate::ecu::{EcuFault, Unit};
use crate::{SimError, Simulated, Truck};

/// Something that is broken. In words: `localisation`, `perception`, `wheel_speeds`, `engine`,
/// `transmission`, `brakes`, `steering`, `retarder`, `radar`, `cab`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// The truck's state is no longer renewed.
    Localisation,
    /// The scene is no longer renewed.
    Perception,
    /// The wheel speed sensors report what they reported when the fault began (over a bus).
    WheelSpeeds,
    /// A control unit neither sends nor does what it is asked (over a bus).
    Silent(Unit),
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Localisation,
        Self::Perception,
        Self::WheelSpeeds,
        Self::Silent(Unit::Engine),
        Self::Silent(Unit::Transmission),
        Self::Silent(Unit::Brakes),
        Self::Silent(Unit::Steering),
        Self::Silent(Unit::Retarder),
        Self::Silent(Unit::Radar),
        Self::Silent(Unit::Cab),
    ];

    /// Its word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Localisation => "localisation",
            Self::Perception => "perception",
            Self::WheelSpeeds => "wheel_speeds",
            Self::Silent(Unit::Engine) => "engine",
            Self::Silent(Unit::Transmission) => "transmission",
            Self::Silent(Unit::Brakes) => "brakes",
            Self::Silent(Unit::Steering) => "steering",
            Self::Silent(Unit::Retarder) => "retarder",
            Self::Silent(Unit::Radar) => "radar",
            Self::Silent(Unit::Cab) => "cab",
        }
    }

    /// Whether only a truck on a bus has what it breaks.
    #[must_use]
    pub const fn needs_bus(self) -> bool {
        matches!(self, Self::WheelSpeeds | Self::Silent(_))
    }
}

impl FromStr for Fault {
    type Err = ();

    fn from_str(word: &str) -> Result<Self, ()> {
        Self::ALL.into_iter().find(|fault| fault.word() == word).ok_or(())
    }
}

/// What is broken about a world, and what was last seen of what is.
#[derive(Debug, Clone, Default)]
pub(crate) struct Faults {
    on: BTreeSet<Fault>,
    ego: Option<Stamped<EgoState>>,
    scene: Option<Scene>,
    /// The scene as it is, while another one is seen.
    real: Option<Scene>,
}

impl Faults {
    /// Breaks something, or mends it.
    pub(crate) fn set(
        &mut self,
        fault: Fault,
        is_on: bool,
        truck: &mut Truck,
    ) -> Result<(), SimError> {
        match (fault, truck) {
            (Fault::Localisation, _) => self.ego = None,
            (Fault::Perception, _) => (self.scene, self.real) = (None, None),
            (Fault::WheelSpeeds, Truck::Bus(looped)) => {
                looped.ecu().set_fault(EcuFault::FrozenWheels, is_on);
            }
            (Fault::Silent(unit), Truck::Bus(looped)) => {
                looped.ecu().set_fault(EcuFault::Silent(unit), is_on);
            }
            (Fault::WheelSpeeds | Fault::Silent(_), Truck::Direct(_) | Truck::Detached(_)) => {
                return Err(SimError::NoBus { fault: fault.word() });
            }
        }
        if is_on {
            self.on.insert(fault);
        } else {
            self.on.remove(&fault);
        }
        Ok(())
    }

    /// What is broken.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Fault> {
        self.on.iter().copied()
    }

    /// Whether the stack sees something else than there is.
    pub(crate) fn deceive(&self) -> bool {
        self.on.contains(&Fault::Localisation) || self.on.contains(&Fault::Perception)
    }

    /// The scene as it is, where the stack sees another one.
    pub(crate) const fn real_scene(&self) -> Option<&Scene> {
        self.real.as_ref()
    }

    /// The ways to truck and traffic with what is broken about them. `truth` has the truck's state
    /// for the others, who are not deceived.
    pub(crate) fn between<'a, T>(
        &'a mut self,
        truck: &'a mut Truck,
        traffic: &'a mut T,
        truth: &'a Cell<Option<EgoState>>,
    ) -> (FaultyTruck<'a>, FaultyTraffic<'a, T>) {
        let is_on = |fault| self.on.contains(&fault);
        let (lost, blind) = (is_on(Fault::Localisation), is_on(Fault::Perception));
        let held_ego = lost.then_some(&mut self.ego);
        let held_scene = blind.then_some((&mut self.scene, &mut self.real));
        let traffic = FaultyTraffic { traffic, held: held_scene, truth };
        (FaultyTruck { truck, held: held_ego, truth }, traffic)
    }
}

/// A truck whose state may stand still.
pub(crate) struct FaultyTruck<'a> {
    truck: &'a mut Truck,
    held: Option<&'a mut Option<Stamped<EgoState>>>,
    truth: &'a Cell<Option<EgoState>>,
}

impl Vehicle for FaultyTruck<'_> {
    type Error = SimError;

    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, SimError> {
        let ego = self.truck.ego(now)?;
        let Some(held) = &mut self.held else { return Ok(ego) };
        self.truth.set(Some(*self.truck.sim().state()));
        Ok(*held.get_or_insert(ego))
    }

    fn command(&mut self, now: Time, command: &Command) -> Result<(), SimError> {
        self.truck.command(now, command)
    }

    fn limits(&self) -> &VehicleLimits {
        self.truck.limits()
    }

    fn status(&self) -> VehicleStatus {
        self.truck.status()
    }
}

/// Traffic whose scene may stand still.
pub(crate) struct FaultyTraffic<'a, T> {
    traffic: &'a mut T,
    /// The scene that is seen, and the one that there is.
    held: Option<(&'a mut Option<Scene>, &'a mut Option<Scene>)>,
    truth: &'a Cell<Option<EgoState>>,
}

impl<T: TrafficSource> TrafficSource for FaultyTraffic<'_, T> {
    type Error = T::Error;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, T::Error> {
        let there = self.truth.get();
        let scene = self.traffic.advance(now, there.as_ref().unwrap_or(ego))?;
        match &mut self.held {
            Some((seen, real)) => {
                **real = Some(scene.clone());
                Ok(seen.get_or_insert_with(|| scene.clone()))
            }
            None => Ok(scene),
        }
    }
}
