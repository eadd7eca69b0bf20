//! A drive of a simulated world as a truck's logger would have it.

use std::sync::Arc;

use diagnosis::Channel;
use diagnosis::logger::{Draw, Sample, as_logged};
use dynamics::{TruckModel, TruckParameters};
use road::Road;
use sim::{Scenario, Status, World};
use tractrix_core::{Command, EgoState, Recorder, Tick};

use diagnosis::Table;

use super::folder::STEP_S;
use crate::failure::Failure;

/// Name of the time column.
const TIME: &str = "time_s";

/// The state and command of the latest tick.
#[derive(Default)]
struct Latest {
    ego: EgoState,
    command: Command,
    now_s: f64,
}

impl Recorder for Latest {
    fn record(&mut self, tick: &Tick<'_>) {
        (self.ego, self.command, self.now_s) = (*tick.ego, tick.plan.command, tick.now.seconds());
    }
}

/// Drives a scenario with a truck and logs it.
///
/// # Errors
/// [`Failure::Work`] if the world fails.
pub(super) fn drive(
    name: String,
    scenario: &Scenario,
    road: &Arc<Road>,
    truck: &TruckParameters,
    reported_mass_kg: f64,
    seed: u64,
) -> Result<Table, Failure> {
    let model = TruckModel::new(truck.clone(), scenario.truck.payload_kg).map_err(Failure::work)?;
    let mut world = World::assemble(scenario, seed, Arc::clone(road), Arc::new(model))
        .map_err(Failure::work)?;
    let columns: Vec<&str> =
        std::iter::once(TIME).chain(Channel::on_board().map(Channel::name)).collect();
    let mut table = Table::new(name, &columns);
    table.reported_mass_kg = Some(reported_mass_kg);
    let mut draw = Draw::of_seed(seed);
    let mut latest = Latest::default();
    let mut due_s = 0.0;
    while world.tick(&mut latest).map_err(Failure::work)? == Status::Running {
        if latest.now_s + 1e-6 >= due_s {
            due_s += STEP_S;
            table.push(&row(&world, &latest, &mut draw));
        }
    }
    Ok(table)
}

fn row(world: &World, latest: &Latest, draw: &mut Draw) -> Vec<f64> {
    let on_map = world.road().at(latest.ego.s_m, latest.ego.d_m);
    let sample = Sample {
        model: world.truck().model(),
        ego: &latest.ego,
        command: &latest.command,
        patch: &world.truck().patch(),
        coolant_k: world.truck().plant().coolant_k,
        map_grade_frac: on_map.grade_rad.tan(),
        map_curvature_1_m: on_map.curvature_1_m,
    };
    let logged = Channel::on_board().zip(sample.row()).map(|(c, x)| as_logged(c, x, draw));
    std::iter::once(latest.now_s).chain(logged).collect()
}
