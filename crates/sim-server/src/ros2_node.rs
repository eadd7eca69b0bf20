//! The session as its ROS 2 node sees it.

use std::sync::Arc;

use futures::FutureExt;
use futures::future::BoxFuture;
use planner::decider::LaneChoice;
use ros2::{
    Direction, Entities, Entity, Names, Network, Node, Request, Simulator, World, WorldSource,
};
use sim::Scenario;
use tractrix_core::{EgoState, Neighbour};

use crate::failure::Failure;
use crate::session::{Command, Handle, Refused, State};

/// Starts the node of a session whose truck is reached as `vehicle` says, in the domain that the
/// environment says.
///
/// # Errors
/// [`Failure::Input`]: an environment variable, or a domain with a clock already.
#[expect(clippy::disallowed_methods, reason = "ROS 2 is configured by the environment")]
pub(crate) fn start(handle: &Handle, vehicle: &str, with_autoware: bool) -> Result<Node, Failure> {
    let network = Network::from_environment(|name| std::env::var(name).ok());
    let network = network.map_err(Failure::input)?;
    let names = if with_autoware { Names::Autoware } else { Names::Own };
    let (bus, session) = (recording::bus_name(vehicle), Arc::new(Session(handle.clone())));
    Node::start(network, names, bus, session).map_err(Failure::input)
}

/// A session's door with the words of ROS 2.
struct Session(Handle);

impl Simulator for Session {
    fn ask(&self, request: Request) -> BoxFuture<'static, Result<(), ros2::Refused>> {
        let handle = self.0.clone();
        async move {
            let command = command(&handle, request).map_err(|e| refused(&e))?;
            handle.ask(command).await.map(drop).map_err(|e| refused(&e))
        }
        .boxed()
    }

    fn state(&self) -> ros2::State {
        match self.0.state() {
            State::Stopped => ros2::State::Stopped,
            State::Playing => ros2::State::Playing,
            State::Paused => ros2::State::Paused,
            State::Quitting => ros2::State::Quitting,
        }
    }

    fn world(&self) -> Option<World> {
        Some(world(&self.0.scenario()))
    }

    fn worlds(&self) -> Vec<World> {
        let scenarios = Scenario::names().filter_map(|name| Scenario::builtin(name).ok());
        scenarios.map(|scenario| world(&scenario)).collect()
    }

    fn entities(&self) -> Entities {
        let now = self.0.bodies();
        let all = now.ego.iter().map(of_ego).chain(now.others.iter().map(of_other));
        Entities { time_ns: now.time.0, all: all.collect() }
    }
}

/// What a request is for the session; a world is built here.
fn command(handle: &Handle, request: Request) -> Result<Command, Refused> {
    Ok(match request {
        Request::Play => Command::Play,
        Request::Pause => Command::Pause,
        Request::Stop => handle.reset(None, Some(State::Stopped))?,
        Request::Reset => handle.reset(None, None)?,
        Request::Quit => Command::Quit,
        Request::Step { ticks } => {
            Command::Step { ticks: u32::try_from(ticks).unwrap_or(u32::MAX), wait: true }
        }
        Request::Load(source) => {
            let scenario = match source {
                WorldSource::Name(name) => Scenario::builtin(&name),
                WorldSource::Toml(text) => Scenario::from_toml_str("world", &text),
            };
            let scenario = scenario.map_err(|e| Refused::Unusable(e.to_string()))?;
            if let [key, ..] = scenario.reaches_out()[..] {
                let why = format!("{key} names something outside the program");
                return Err(Refused::Unusable(why));
            }
            let seed = scenario.seed(None).map_err(|e| Refused::Unusable(e.to_string()))?;
            handle.begin(&scenario, seed, State::Stopped)?
        }
        Request::Control { accel_m_s2, road_wheel_rad } => {
            Command::External { accel_m_s2, road_wheel_rad }
        }
        Request::Release => Command::Release,
        Request::SetSpeed { speed_m_s } => Command::SetSpeed(speed_m_s),
        Request::LaneChange(to) => Command::LaneChange {
            to: match to {
                Direction::Left => LaneChoice::Left,
                Direction::Right => LaneChoice::Right,
                Direction::Keep => LaneChoice::Keep,
            },
        },
    })
}

fn refused(why: &Refused) -> ros2::Refused {
    let text = why.to_string();
    match why {
        Refused::WrongState { .. } | Refused::Ended => ros2::Refused::IncorrectState(text),
        Refused::NoExternalDecider
        | Refused::NoBus(_)
        | Refused::OutsideBus(_)
        | Refused::OneSumo
        | Refused::SecondSumo => ros2::Refused::Unsupported(text),
        Refused::TooMany
        | Refused::NothingKept(_)
        | Refused::TooManyKept
        | Refused::CutShort { .. }
        | Refused::TooFar { .. }
        | Refused::Unusable(_) => ros2::Refused::Failed(text),
    }
}

fn world(scenario: &Scenario) -> World {
    World { name: scenario.name.clone(), description: scenario.description.clone() }
}

fn of_ego(ego: &EgoState) -> Entity {
    Entity {
        name: "ego".to_owned(),
        position_m: [ego.x_m, ego.y_m, ego.z_m],
        yaw_rad: ego.yaw_rad,
        speed_m_s: [ego.speed_m_s, ego.lateral_speed_m_s],
        yaw_rate_rad_s: ego.yaw_rate_rad_s,
        accel_m_s2: [ego.accel_x_m_s2, ego.accel_y_m_s2],
    }
}

/// Height and yaw rate of the others are not known to a scene.
fn of_other(other: &Neighbour) -> Entity {
    Entity {
        name: format!("vehicle/{}", other.id),
        position_m: [other.x_m, other.y_m, 0.0],
        yaw_rad: other.yaw_rad,
        speed_m_s: [other.speed_m_s, other.lateral_speed_m_s],
        yaw_rate_rad_s: 0.0,
        accel_m_s2: [other.accel_m_s2, 0.0],
    }
}
