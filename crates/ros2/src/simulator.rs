//! The simulation as the node sees it: what it can be asked, and what it says about itself. Who
//! runs the simulation implements [`Simulator`].

use futures::future::BoxFuture;

/// The states of `simulation_interfaces/msg/SimulationState`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// At its start, not driving.
    Stopped = 0,
    /// Driving.
    Playing = 1,
    /// Between two ticks.
    Paused = 2,
    /// About to end.
    Quitting = 3,
    /// Nothing is loaded.
    NoWorld = 4,
    /// A scenario is being loaded.
    LoadingWorld = 5,
}

/// What a node asks of the simulation.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    /// Goes on.
    Play,
    /// Stands still between two ticks.
    Pause,
    /// Back to the start, standing still.
    Stop,
    /// Ends the run.
    Quit,
    /// Back to the start with the same seed, driving if it drove.
    Reset,
    /// Drives so many ticks, from pause to pause; answered when they are driven.
    Step {
        /// Number of ticks.
        ticks: u64,
    },
    /// Loads a scenario by its name or as TOML text.
    Load(WorldSource),
    /// The driver's set speed.
    SetSpeed {
        /// m/s.
        speed_m_s: f64,
    },
    /// Wishes a lane change.
    LaneChange(Direction),
    /// Somebody else drives from here on.
    Control {
        /// m/s², -10 to 5.
        accel_m_s2: f64,
        /// Angle of the front wheels, rad, -1 to 1; positive: to the left.
        road_wheel_rad: f64,
    },
    /// Nobody else drives any more.
    Release,
}

/// Where to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// To the lane on the left.
    Left,
    /// To the lane on the right.
    Right,
    /// No change any more.
    Keep,
}

/// A scenario.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum WorldSource {
    /// Its name.
    Name(String),
    /// Its text.
    Toml(String),
}

/// Why a request was not carried out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refused {
    /// Never possible here.
    Unsupported(String),
    /// Not in this state.
    IncorrectState(String),
    /// There is no such thing.
    NotFound(String),
    /// It was tried.
    Failed(String),
}

/// A scenario that is or can be loaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct World {
    /// Its name.
    pub name: String,
    /// In words.
    pub description: String,
}

/// A body in the map frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Entity {
    /// `ego`, `ego/trailer`, or `vehicle/ID`.
    pub name: String,
    /// Position of its reference point, m.
    pub position_m: [f64; 3],
    /// Heading, rad, counter-clockwise from map x.
    pub yaw_rad: f64,
    /// Speed ahead and to the left, m/s.
    pub speed_m_s: [f64; 2],
    /// rad/s.
    pub yaw_rate_rad_s: f64,
    /// Acceleration ahead and to the left, m/s².
    pub accel_m_s2: [f64; 2],
}

/// The bodies at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Entities {
    /// Simulation time, ns.
    pub time_ns: i64,
    /// The truck first.
    pub all: Vec<Entity>,
}

/// A simulation that a node can command. Its answers come between two ticks; none may take longer
/// than what was asked for (the ticks of a step) and some seconds.
pub trait Simulator: Send + Sync {
    /// Carries out a request.
    fn ask(&self, request: Request) -> BoxFuture<'static, Result<(), Refused>>;
    /// The state now.
    fn state(&self) -> State;
    /// What is loaded.
    fn world(&self) -> Option<World>;
    /// What can be loaded.
    fn worlds(&self) -> Vec<World>;
    /// The bodies now.
    fn entities(&self) -> Entities;
}
