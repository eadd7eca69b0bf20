//! `/api/openapi.json`: the paths come from the routes, the objects are described here.

use utoipa::openapi::response::{Response, ResponseBuilder};
use utoipa::openapi::schema::AdditionalProperties;
use utoipa::openapi::{Content, OpenApi, Ref, RefOr, Schema};
use utoipa::{OpenApi as _, ToSchema};

/// What the document says beside its paths.
#[derive(utoipa::OpenApi)]
#[openapi(
    info(
        title = "Tractrix",
        description = "A running simulation of a heavy truck. SI units, in the names of the keys.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
    ),
    components(schemas(Problem))
)]
struct Document;

/// The document without its paths.
pub(super) fn document() -> OpenApi {
    Document::openapi()
}

/// The document as text: every operation may answer with a problem.
pub(super) fn text(mut document: OpenApi) -> String {
    for path in document.paths.paths.values_mut() {
        for operation in [&mut path.get, &mut path.post, &mut path.delete].into_iter().flatten() {
            let problem = RefOr::T(problem_response());
            operation.responses.responses.insert("default".to_owned(), problem);
        }
    }
    close_commands(&mut document);
    document.to_json().unwrap_or_default()
}

/// Says of each command that it has no other keys: the derived schema does not.
fn close_commands(document: &mut OpenApi) {
    let name = CommandObject::name();
    let schemas = document.components.as_mut().map(|components| &mut components.schemas);
    let Some(RefOr::T(Schema::OneOf(commands))) = schemas.and_then(|s| s.get_mut(&*name)) else {
        return;
    };
    for command in &mut commands.items {
        if let RefOr::T(Schema::Object(command)) = command {
            command.additional_properties = Some(Box::new(AdditionalProperties::FreeForm(false)));
        }
    }
}

fn problem_response() -> Response {
    let schema = Ref::from_schema_name("Problem");
    ResponseBuilder::new()
        .description("Why not (RFC 9457)")
        .content("application/problem+json", Content::new(Some(schema)))
        .build()
}

/// A refusal: problem details, RFC 9457.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct Problem {
    /// Schema of this object.
    schema: u32,
    /// What was wrong, for programs: `urn:tractrix:wrong_state`.
    r#type: String,
    /// The status in words.
    title: String,
    /// The status.
    status: u16,
    /// What was wrong, for people.
    detail: String,
}

/// A command that has acted.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct ActedObject {
    schema: u32,
    /// Ticks driven in this run.
    tick: u64,
    /// Simulation time, s.
    time_s: f64,
    state: StateWord,
}

/// The states of a session.
#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[expect(dead_code, reason = "a schema")]
pub(super) enum StateWord {
    Stopped,
    Playing,
    Paused,
    Quitting,
}

/// A session.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct SessionObject {
    schema: u32,
    version: String,
    git_revision: String,
    id: String,
    state: StateWord,
    scenario: String,
    seed: u64,
    /// Length of a tick, s.
    tick_s: f64,
    /// Name of the latest run.
    run: Option<String>,
    /// The run is being recorded.
    recording: bool,
}

/// The sessions of a server.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct SessionList {
    schema: u32,
    /// Sessions at once, at most.
    most: usize,
    sessions: Vec<SessionObject>,
}

/// What is seen of a run now. Its parts are described in docs/server.md.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct FrameObject {
    schema: u32,
    /// Another one for every run.
    run_id: String,
    /// Simulation time, s.
    time_s: f64,
    #[schema(value_type = Object)]
    run: (),
    #[schema(value_type = Object)]
    ego: (),
    #[schema(value_type = Object)]
    road: (),
    #[schema(value_type = Object)]
    plan: (),
    #[schema(value_type = Vec<Object>)]
    neighbours: (),
}

/// A server's health.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct Health {
    schema: u32,
    status: String,
}

/// A command. A key that it does not have is refused.
#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[serde(tag = "action", rename_all = "snake_case", deny_unknown_fields)]
#[expect(dead_code, reason = "a schema")]
pub(super) enum CommandObject {
    /// Goes on.
    Play {},
    /// Stands still between two ticks.
    Pause {},
    /// In a pause: so many ticks; with `wait` the answer comes when they are driven.
    Step {
        #[schema(minimum = 1, maximum = 1_000_000)]
        ticks: u32,
        #[schema(nullable = false)]
        wait: Option<bool>,
    },
    /// In a pause: to the first tick at or behind a simulation time, s.
    StepUntil {
        #[schema(minimum = 0)]
        time_s: f64,
        #[schema(nullable = false)]
        wait: Option<bool>,
    },
    /// Stands still at the first tick at or behind a simulation time, s, when it comes there.
    PauseAt {
        #[schema(minimum = 0)]
        time_s: f64,
    },
    /// Keeps the world as it is now, under a name.
    Snapshot {
        #[schema(pattern = "^[a-z0-9-]{1,40}$")]
        name: String,
    },
    /// Goes on from where the world was kept, with a recording of its own.
    Restore {
        #[schema(pattern = "^[a-z0-9-]{1,40}$")]
        name: String,
    },
    /// Back to the start, with a recording of its own.
    Reset {
        #[schema(minimum = 0, maximum = 18_446_744_073_709_551_615_u64, nullable = false)]
        seed: Option<u64>,
    },
    /// Back to the start, standing still.
    Stop {},
    /// Simulated seconds per second.
    Pace { pace: PaceValue },
    /// Wishes a lane change; the safety gate decides.
    LaneChange { to: LaneWord },
    /// The driver's set speed, m/s.
    SetSpeed {
        #[schema(minimum = 0, maximum = 40)]
        speed_m_s: f64,
    },
    /// Another decider from here on.
    SetDecider {
        /// `keep`, `rules:METRES` (5 to 500), `mobil`, `rollout`, `dqn` or `external`.
        #[schema(
            pattern = "^(keep|mobil|rollout|dqn|external|rules:([5-9]|[1-9][0-9]|[1-4][0-9]{2}))$"
        )]
        decider: String,
    },
    /// Another source of the reference speed from here on.
    SetSpeedPlanner { speed_planner: SpeedPlannerWord },
    /// Somebody else drives: without another command within 0.2 s the truck stops in its lane.
    External {
        /// Acceleration along the road, m/s².
        #[schema(minimum = -10, maximum = 5)]
        accel_m_s2: f64,
        /// Angle of the front wheels, rad; positive: to the left.
        #[schema(minimum = -1, maximum = 1)]
        road_wheel_rad: f64,
    },
    /// Nobody else drives any more.
    Release {},
    /// Breaks something, or mends it. All but the first two need a truck on a bus.
    Fault { fault: FaultWord, on: bool },
    /// Ends the run and the session, with `default` the program too.
    Quit {},
}

/// A factor, or a word.
#[derive(ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "a schema")]
pub(super) enum PaceValue {
    Factor(Factor),
    Word(PaceWord),
}

#[derive(ToSchema)]
#[schema(minimum = 0.01, maximum = 10_000)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct Factor(f64);

#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[expect(dead_code, reason = "a schema")]
pub(super) enum PaceWord {
    Realtime,
    Max,
}

#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[expect(dead_code, reason = "a schema")]
pub(super) enum SpeedPlannerWord {
    Cruise,
    Predictive,
}

#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[expect(dead_code, reason = "a schema")]
pub(super) enum FaultWord {
    Localisation,
    Perception,
    WheelSpeeds,
    Engine,
    Transmission,
    Brakes,
    Steering,
    Retarder,
    Radar,
    Cab,
}

#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[expect(dead_code, reason = "a schema")]
pub(super) enum LaneWord {
    Left,
    Right,
    Keep,
}
