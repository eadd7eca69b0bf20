//! From options to the scenario that is driven.

use sim::{Overrides, Scenario};

use super::{Args, Names};
use crate::failure::Failure;
use crate::listeners::Wanted;

/// The scenario with the command line's changes.
///
/// # Errors
/// [`Failure::Input`] names the file and key, or the option that cannot be used.
pub(super) fn scenario(args: &Args) -> Result<Scenario, Failure> {
    let mut scenario = Scenario::named(&args.scenario).map_err(Failure::input)?;
    let changes = Overrides {
        road: args.road.as_deref(),
        truck: args.truck.as_deref(),
        payload_kg: args.payload_kg,
        duration_s: args.duration,
        allow_off_road: args.allow_off_road,
        traffic: args.traffic.as_deref(),
        mode: args.mode.as_deref(),
        manifest: args.manifest.as_deref(),
        on_traffic_failure: args.on_traffic_failure.as_deref(),
        decider: args.decider.as_deref(),
        speed_planner: args.speed_planner.as_deref(),
    };
    changes.apply(&mut scenario).map_err(Failure::of_option)?;
    Ok(scenario)
}

/// The networks that the run is to be shown on.
pub(super) fn networks(args: &Args) -> Wanted {
    Wanted {
        vehicle: args.vehicle.clone(),
        ros2: args.ros2,
        with_autoware: matches!(args.ros2_names, Some(Names::Autoware)),
        foxglove: args.foxglove,
        foxglove_origins: args.foxglove_origin.clone(),
    }
}
