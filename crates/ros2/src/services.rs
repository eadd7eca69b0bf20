//! From a request of `simulation_interfaces` to its answer. Nothing here knows the network.

use byteorder::LittleEndian;
use serde::Serialize;

use crate::interfaces::geometry::{Header, Pose, Quaternion, Stamp, Twist, Vector3};
use crate::interfaces::simulation::{
    Done, Empty, EntityCategory, EntityFilters, EntityState, Features, Filtered, FindWorlds,
    LoadWorld, Names, OfEntity, OneState, OneWorld, Outcome, Reset, Resource, SetState,
    SimulationState, SimulatorFeatures, StateNow, States, Step, TagsFilter, WorldResource, Worlds,
};
use crate::simulator::{Entities, Entity, Refused, Request, Simulator, State, World, WorldSource};

/// Steps of one request, at most.
pub(crate) const MAX_STEPS: u64 = 1_000_000;
/// What works, as numbered in `msg/SimulatorFeatures`: entity categories and states, reset, state
/// getting, setting and pause, single and multiple steps, their action, worlds by name and text, the current one,
/// the available ones.
const FEATURES: [u16; 13] = [8, 10, 20, 24, 25, 26, 31, 32, 33, 40, 41, 44, 45];
const CATEGORY_ROBOT: u8 = 1;
const CATEGORY_DYNAMIC_OBJECT: u8 = 4;
/// Scopes of a reset that are all there is to reset: time and state, with or without what was
/// spawned (nothing can be).
const WHOLE_SCOPES: [u8; 4] = [0, 3, 7, 255];

/// An answer that can say why it says nothing else.
pub(crate) trait Answer: Serialize {
    fn refused(result: Outcome) -> Self;
}

macro_rules! answers {
    ($($name:ident)*) => {
        $(impl Answer for $name {
            fn refused(result: Outcome) -> Self {
                Self { result, ..Self::default() }
            }
        })*
    };
}
answers!(StateNow Names States OneState OneWorld Worlds);

impl Answer for Done {
    fn refused(result: Outcome) -> Self {
        Self { result }
    }
}

impl Answer for Features {
    fn refused(_: Outcome) -> Self {
        Self::default()
    }
}

pub(crate) async fn features(_: &dyn Simulator, _: Empty) -> Features {
    let features = SimulatorFeatures {
        features: FEATURES.to_vec(),
        spawn_formats: Vec::new(),
        custom_info: concat!("Tractrix ", env!("CARGO_PKG_VERSION")).to_owned(),
    };
    Features { features }
}

pub(crate) async fn state(simulator: &dyn Simulator, _: Empty) -> StateNow {
    let state = SimulationState { state: simulator.state() as u8 };
    StateNow { state, result: Outcome::ok() }
}

pub(crate) async fn set_state(simulator: &dyn Simulator, wish: SetState) -> Done {
    let wish = wish.state.state;
    if wish == simulator.state() as u8 {
        let why = "the simulation is in this state already";
        return Done { result: Outcome::error(Outcome::ALREADY_IN_TARGET_STATE, why) };
    }
    let request = match wish {
        w if w == State::Stopped as u8 => Request::Stop,
        w if w == State::Playing as u8 => Request::Play,
        w if w == State::Paused as u8 => Request::Pause,
        w if w == State::Quitting as u8 => Request::Quit,
        _ => {
            let why = format!("state {wish} cannot be set: see LoadWorld");
            return Done { result: Outcome::error(Outcome::INCORRECT_TRANSITION, why) };
        }
    };
    let mut result = outcome(simulator.ask(request).await);
    if result.result == Outcome::INCORRECT_STATE {
        result.result = Outcome::STATE_TRANSITION_ERROR;
    }
    Done { result }
}

pub(crate) async fn reset(simulator: &dyn Simulator, wish: Reset) -> Done {
    if !WHOLE_SCOPES.contains(&wish.scope) {
        let why = format!("scope {}: time and state can only be reset together", wish.scope);
        return Done { result: Outcome::error(Outcome::FEATURE_UNSUPPORTED, why) };
    }
    Done { result: outcome(simulator.ask(Request::Reset).await) }
}

/// Outside a pause the interface asks for `RESULT_OPERATION_FAILED`.
pub(crate) async fn step(simulator: &dyn Simulator, wish: Step) -> Done {
    let ticks = wish.steps;
    if !(1..=MAX_STEPS).contains(&ticks) {
        let why = format!("steps = {ticks}: expected 1 to {MAX_STEPS}");
        return Done { result: Outcome::error(Outcome::OPERATION_FAILED, why) };
    }
    let mut result = outcome(simulator.ask(Request::Step { ticks }).await);
    if result.result == Outcome::INCORRECT_STATE {
        result.result = Outcome::OPERATION_FAILED;
    }
    Done { result }
}

pub(crate) async fn entities(simulator: &dyn Simulator, wish: Filtered) -> Names {
    match filtered(simulator.entities(), &wish.filters) {
        Ok(found) => {
            let entities = found.all.into_iter().map(|e| e.name).collect();
            Names { result: Outcome::ok(), entities }
        }
        Err(result) => Names { result, ..Names::default() },
    }
}

pub(crate) async fn entities_states(simulator: &dyn Simulator, wish: Filtered) -> States {
    match filtered(simulator.entities(), &wish.filters) {
        Ok(found) => {
            let states = found.all.iter().map(|e| state_of(found.time_ns, e)).collect();
            let entities = found.all.into_iter().map(|e| e.name).collect();
            States { result: Outcome::ok(), states, entities }
        }
        Err(result) => States { result, ..States::default() },
    }
}

pub(crate) async fn entity_state(simulator: &dyn Simulator, wish: OfEntity) -> OneState {
    let now = simulator.entities();
    match now.all.iter().find(|e| e.name == wish.entity) {
        Some(found) => OneState { result: Outcome::ok(), state: state_of(now.time_ns, found) },
        None => {
            let why = format!("no entity {:?}", shortened(&wish.entity));
            let result = Outcome::error(Outcome::NOT_FOUND, why);
            OneState { result, ..OneState::default() }
        }
    }
}

pub(crate) async fn load_world(simulator: &dyn Simulator, wish: LoadWorld) -> OneWorld {
    let Resource { uri, resource_string } = wish.world_resource;
    let source = match (uri.is_empty(), resource_string.is_empty()) {
        (false, _) => WorldSource::Name(uri),
        (true, false) => WorldSource::Toml(resource_string),
        (true, true) => {
            let why = "neither uri (a scenario's name) nor resource_string (its TOML text)";
            let result = Outcome::error(Outcome::NO_RESOURCE, why);
            return OneWorld { result, ..OneWorld::default() };
        }
    };
    match simulator.ask(Request::Load(source)).await {
        Ok(()) => current_world(simulator, Empty::default()).await,
        Err(why) => OneWorld { result: outcome(Err(why)), ..OneWorld::default() },
    }
}

pub(crate) async fn current_world(simulator: &dyn Simulator, _: Empty) -> OneWorld {
    match simulator.world() {
        Some(world) => OneWorld { result: Outcome::ok(), world: resource(world) },
        None => {
            let result = Outcome::error(Outcome::NO_WORLD_LOADED, "no scenario is loaded");
            OneWorld { result, ..OneWorld::default() }
        }
    }
}

pub(crate) async fn worlds(simulator: &dyn Simulator, wish: FindWorlds) -> Worlds {
    if !wish.additional_sources.is_empty() || wish.filter != TagsFilter::default() {
        let why = "there are no sources beside the built-in scenarios, and no tags";
        let result = Outcome::error(Outcome::FEATURE_UNSUPPORTED, why);
        return Worlds { result, ..Worlds::default() };
    }
    // Without the descriptions, or they would fit nowhere: GetCurrentWorld has them
    let short = |world: World| resource(World { description: String::new(), ..world });
    let worlds = simulator.worlds().into_iter().map(short).collect();
    Worlds { result: Outcome::ok(), worlds }
}

/// The answer, or that it is longer than so many bytes.
pub(crate) fn fitting<T: Answer>(answer: T, most_bytes: usize) -> T {
    let bytes = cdr_encoding::to_vec::<T, LittleEndian>(&answer).map_or(usize::MAX, |b| b.len());
    if bytes <= most_bytes {
        return answer;
    }
    let why = format!(
        "the answer has {bytes} bytes, the middleware sends you at most {most_bytes}: ask for \
         fewer (filters), listen to /scene, or be reached over loopback alone"
    );
    T::refused(Outcome::error(Outcome::OPERATION_FAILED, why))
}

fn resource(world: World) -> WorldResource {
    WorldResource {
        world_resource: Resource { uri: world.name.clone(), resource_string: String::new() },
        name: world.name,
        description: world.description,
        tags: Vec::new(),
    }
}

fn outcome(answer: Result<(), Refused>) -> Outcome {
    match answer {
        Ok(()) => Outcome::ok(),
        Err(Refused::Unsupported(why)) => Outcome::error(Outcome::FEATURE_UNSUPPORTED, why),
        Err(Refused::IncorrectState(why)) => Outcome::error(Outcome::INCORRECT_STATE, why),
        Err(Refused::NotFound(why)) => Outcome::error(Outcome::NOT_FOUND, why),
        Err(Refused::Failed(why)) => Outcome::error(Outcome::OPERATION_FAILED, why),
    }
}

/// The bodies that a filter lets through.
fn filtered(mut now: Entities, filters: &EntityFilters) -> Result<Entities, Outcome> {
    if !filters.tags.tags.is_empty() || filters.bounds.kind != 0 {
        let why = "entities have no tags, and are not found by bounds";
        return Err(Outcome::error(Outcome::FEATURE_UNSUPPORTED, why));
    }
    if !filters.categories.is_empty() {
        now.all.retain(|e| filters.categories.contains(&category(e)));
    }
    if !filters.filter.is_empty() {
        let pattern = name_pattern(&filters.filter)?;
        now.all.retain(|e| pattern.is_match(&e.name));
    }
    Ok(now)
}

/// The whole name must match.
fn name_pattern(text: &str) -> Result<regex::Regex, Outcome> {
    const MAX_BYTES: usize = 1 << 16;
    let whole = format!("^(?:{text})$");
    regex::RegexBuilder::new(&whole).size_limit(MAX_BYTES).build().map_err(|_| {
        let why = format!("filter {:?} is no regular expression", shortened(text));
        Outcome::error(Outcome::OPERATION_FAILED, why)
    })
}

fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

fn category(entity: &Entity) -> EntityCategory {
    let is_ego = entity.name == "ego" || entity.name.starts_with("ego/");
    EntityCategory { category: if is_ego { CATEGORY_ROBOT } else { CATEGORY_DYNAMIC_OBJECT } }
}

/// Pose in the map frame; twist and acceleration in it too, as the interface wants them.
fn state_of(time_ns: i64, entity: &Entity) -> EntityState {
    let (sin, cos) = entity.yaw_rad.sin_cos();
    let in_map = |[ahead, left]: [f64; 2]| Vector3 {
        x: cos * ahead - sin * left,
        y: sin * ahead + cos * left,
        z: 0.0,
    };
    let [x, y, z] = entity.position_m;
    let (sin, cos) = (0.5 * entity.yaw_rad).sin_cos();
    EntityState {
        header: Header { stamp: Stamp::of(time_ns), frame_id: "map".to_owned() },
        pose: Pose {
            position: Vector3 { x, y, z },
            orientation: Quaternion { x: 0.0, y: 0.0, z: sin, w: cos },
        },
        twist: Twist {
            linear: in_map(entity.speed_m_s),
            angular: Vector3 { x: 0.0, y: 0.0, z: entity.yaw_rate_rad_s },
        },
        acceleration: Twist { linear: in_map(entity.accel_m_s2), ..Twist::default() },
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use futures::FutureExt;
    use futures::executor::block_on;
    use futures::future::BoxFuture;

    use super::*;
    use crate::interfaces::simulation::Bounds;

    /// A simulation that stands, writes down what it is asked, and gives a prepared answer.
    struct Standing {
        state: State,
        answer: Result<(), Refused>,
        asked: Mutex<Vec<Request>>,
    }

    impl Standing {
        fn in_state(state: State, answer: Result<(), Refused>) -> Self {
            Self { state, answer, asked: Mutex::default() }
        }
    }

    impl Simulator for Standing {
        fn ask(&self, request: Request) -> BoxFuture<'static, Result<(), Refused>> {
            self.asked.lock().unwrap().push(request);
            futures::future::ready(self.answer.clone()).boxed()
        }

        fn state(&self) -> State {
            self.state
        }

        fn world(&self) -> Option<World> {
            None
        }

        fn worlds(&self) -> Vec<World> {
            vec![World { name: "flat".to_owned(), description: "a flat road".to_owned() }]
        }

        fn entities(&self) -> Entities {
            let at = |name: &str, yaw_rad| Entity {
                name: name.to_owned(),
                position_m: [1.0, 2.0, 3.0],
                yaw_rad,
                speed_m_s: [10.0, 0.0],
                yaw_rate_rad_s: 0.1,
                accel_m_s2: [0.5, 1.0],
            };
            let all = vec![at("ego", std::f64::consts::FRAC_PI_2), at("vehicle/7", 0.0)];
            Entities { time_ns: 1_250_000_000, all }
        }
    }

    /// A step outside a pause is an operation that failed, whatever the simulation calls it; so is
    /// one without end, which is not even asked for.
    #[test]
    fn a_step_needs_a_pause_and_an_end() {
        let why = || Err(Refused::IncorrectState("playing".to_owned()));
        let playing = Standing::in_state(State::Playing, why());
        let done = block_on(step(&playing, Step { steps: 10 }));
        assert_eq!(done.result.result, Outcome::OPERATION_FAILED);
        for steps in [0, MAX_STEPS + 1, u64::MAX] {
            let done = block_on(step(&playing, Step { steps }));
            assert_eq!(done.result.result, Outcome::OPERATION_FAILED);
            assert!(done.result.error_message.contains(&steps.to_string()));
        }
        assert_eq!(*playing.asked.lock().unwrap(), [Request::Step { ticks: 10 }]);
    }

    #[test]
    fn states_are_set_once_and_only_those_that_can_be() {
        let wish = |state| SetState { state: SimulationState { state } };
        let paused = Standing::in_state(State::Paused, Ok(()));
        for (state, result) in [
            (1, Outcome::OK),
            (2, Outcome::ALREADY_IN_TARGET_STATE),
            (0, Outcome::OK),
            (4, Outcome::INCORRECT_TRANSITION),
            (77, Outcome::INCORRECT_TRANSITION),
        ] {
            assert_eq!(block_on(set_state(&paused, wish(state))).result.result, result, "{state}");
        }
        assert_eq!(*paused.asked.lock().unwrap(), [Request::Play, Request::Stop]);
        let scope = |scope| block_on(reset(&paused, Reset { scope })).result.result;
        assert_eq!([scope(0), scope(255)], [Outcome::OK; 2]);
        assert_eq!([scope(1), scope(2)], [Outcome::FEATURE_UNSUPPORTED; 2]);
    }

    #[test]
    fn entities_are_found_by_name_and_category_and_seen_in_the_map() {
        let now = Standing::in_state(State::Paused, Ok(()));
        let names = |filters| block_on(entities(&now, Filtered { filters }));
        assert_eq!(names(EntityFilters::default()).entities, ["ego", "vehicle/7"]);
        let filter = |text: &str| EntityFilters { filter: text.to_owned(), ..Default::default() };
        assert_eq!(names(filter("vehicle/.*")).entities, ["vehicle/7"]);
        assert!(names(filter("vehicle")).entities.is_empty(), "the whole name");
        assert_eq!(names(filter("(")).result.result, Outcome::OPERATION_FAILED);
        let endless = "(".repeat(5_000) + &")".repeat(5_000);
        assert_eq!(names(filter(&endless)).result.result, Outcome::OPERATION_FAILED);
        let categories = vec![EntityCategory { category: CATEGORY_ROBOT }];
        assert_eq!(names(EntityFilters { categories, ..Default::default() }).entities, ["ego"]);
        let bounds = Bounds { kind: 3, points: Vec::new() };
        let by_bounds = names(EntityFilters { bounds, ..Default::default() });
        assert_eq!(by_bounds.result.result, Outcome::FEATURE_UNSUPPORTED);
        let ego = block_on(entity_state(&now, OfEntity { entity: "ego".to_owned() })).state;
        assert!((ego.twist.linear.y - 10.0).abs() < 1e-12 && ego.twist.linear.x.abs() < 1e-12);
        assert!((ego.acceleration.linear.x + 1.0).abs() < 1e-12, "left is -x here");
        let none = block_on(entity_state(&now, OfEntity { entity: "x".repeat(9_000) }));
        assert_eq!(none.result.result, Outcome::NOT_FOUND);
        assert!(none.result.error_message.len() < 100);
    }

    /// What the network would lose in silence is refused in words.
    #[test]
    fn an_answer_that_does_not_fit_is_refused() {
        let name = |i| "x".repeat(i);
        let names = |n: usize| Names { result: Outcome::ok(), entities: vec![name(28); n] };
        assert_eq!(fitting(names(35), 1_300).entities.len(), 35);
        assert_eq!(fitting(names(400), 60_000).entities.len(), 400);
        let refused = fitting(names(40), 1_300);
        assert_eq!(refused.result.result, Outcome::OPERATION_FAILED);
        assert!(refused.result.error_message.contains("filters"), "{refused:?}");
    }

    #[test]
    fn worlds_come_by_name_or_as_text() {
        let now = Standing::in_state(State::Stopped, Ok(()));
        let load = |uri: &str, text: &str| {
            let world_resource = Resource { uri: uri.to_owned(), resource_string: text.to_owned() };
            let wish = LoadWorld { world_resource, ..LoadWorld::default() };
            block_on(load_world(&now, wish)).result.result
        };
        assert_eq!(load("", ""), Outcome::NO_RESOURCE);
        assert_eq!(load("flat", ""), Outcome::NO_WORLD_LOADED, "it says what is loaded now");
        load("", "schema = 1");
        let asked = [
            Request::Load(WorldSource::Name("flat".to_owned())),
            Request::Load(WorldSource::Toml("schema = 1".to_owned())),
        ];
        assert_eq!(*now.asked.lock().unwrap(), asked);
        assert_eq!(block_on(worlds(&now, FindWorlds::default())).worlds[0].name, "flat");
    }
}
