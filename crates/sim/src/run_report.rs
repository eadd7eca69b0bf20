//! `summary.json`: a run's figures, with what produced them and how it went on the wall clock.

use serde::Serialize;
use tractrix_core::Provenance;
use traffic_client::Mode;

use crate::{Arrivals, BusFigures, GhostReport, Status, Summary, TickTime, World};

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// The ego has reached the end of the road.
    RoadEnd,
    /// The scenario's duration is over.
    TimeOver,
    /// A wheel has left the road.
    OffRoad,
    /// The user stopped it.
    Interrupted,
    /// The world or the recording failed.
    Failed,
}

impl Status {
    /// Why the run is over; none while it goes on.
    #[must_use]
    pub const fn end(self) -> Option<EndReason> {
        match self {
            Self::Running => None,
            Self::RoadEnd => Some(EndReason::RoadEnd),
            Self::TimeOver => Some(EndReason::TimeOver),
            Self::OffRoad => Some(EndReason::OffRoad),
        }
    }
}

/// How a run went on the wall clock of the shell that drove it.
#[derive(Debug, Clone, PartialEq)]
pub struct WallClock {
    /// Ticks whose work ended after the next one was due; 0 without pacing.
    pub missed_deadlines: u64,
    /// Wall time of a tick, µs.
    pub tick_time_us: TickTime,
    /// `realtime`, `max` or simulated seconds per second.
    pub pace: String,
    /// Wall time of the run, s.
    pub wall_time_s: f64,
}

/// `summary.json`.
#[derive(Debug, Serialize)]
pub struct RunReport {
    #[serde(flatten)]
    provenance: Provenance,
    scenario: String,
    /// None while the run goes on.
    end_reason: Option<EndReason>,
    traffic: TrafficReport,
    /// The figures.
    #[serde(flatten)]
    pub summary: Summary,
    /// Fuel saved against the ghost at equal trip time ([`GhostReport::saving_frac`]).
    saving_frac: Option<f64>,
    /// The comparison with the ghost; none where none drove along.
    pub ghost: Option<GhostReport>,
    /// How the bus between stack and truck did; none where the stack reaches the truck directly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bus: Option<BusFigures>,
    missed_deadlines: u64,
    tick_time_us: TickTime,
    pace: String,
    wall_time_s: f64,
    realtime_factor: f64,
}

/// Where the other vehicles came from.
#[derive(Debug, Serialize)]
struct TrafficReport {
    /// Engine and version.
    engine: String,
    mode: Mode,
    /// Why the native engine went on in its place.
    failure: Option<String>,
    /// Vehicles that came to the road, and those that wait before it; of native traffic.
    arrivals: Option<Arrivals>,
}

impl RunReport {
    /// The report of a world as it is now.
    #[must_use]
    pub fn new(
        provenance: Provenance,
        world: &World,
        end_reason: Option<EndReason>,
        wall: WallClock,
    ) -> Self {
        let summary = world.summary();
        let ghost = world.ghost();
        let traffic = world.traffic();
        Self {
            provenance,
            scenario: world.scenario().name.clone(),
            end_reason,
            traffic: TrafficReport {
                engine: traffic.manifest().engine,
                mode: traffic.mode(),
                failure: traffic.failure().map(str::to_owned),
                arrivals: traffic.arrivals(),
            },
            missed_deadlines: wall.missed_deadlines,
            tick_time_us: wall.tick_time_us,
            pace: wall.pace,
            wall_time_s: wall.wall_time_s,
            realtime_factor: summary.duration_s / wall.wall_time_s.max(1e-9),
            bus: world.bus(),
            saving_frac: ghost.and_then(|ghost| ghost.saving_frac),
            ghost,
            summary,
        }
    }
}
