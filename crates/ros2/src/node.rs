//! The node: its topics, commands and services, and the two threads that serve them. There is no
//! `Spinner`: that of `ros2-client` 0.12 subscribes `/clock` with a wrong type, which other nodes
//! then see.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use futures::channel::oneshot;
use futures::future::{LocalBoxFuture, join_all, select};
use futures::{FutureExt, StreamExt};
use recording::{BUS_FRAMES, Listener, TOPICS, Topic};
use ros2_client::action::ActionServerQosPolicies;
use ros2_client::builtin_interfaces::Time;
use ros2_client::dds::rustdds::{self, DomainParticipant};
use ros2_client::log::LogLevel;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::rosout::RosoutRaw;
use ros2_client::{
    ActionTypeName, Context, Message, MessageTypeName, Name, NodeLoggingHandle, NodeName,
    NodeOptions, Publisher, QosProfile, Server, ServiceMapping, ServiceTypeName, Subscription,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::autoware::{Autoware, Names};
use crate::bytes::Encoded;
use crate::error::Ros2Error;
use crate::feed::{Feed, Outlet, clock_ns, feed};
use crate::interfaces::command::{Asks, Bool, Control, Float64, Text};
use crate::network::Network;
use crate::room::Room;
use crate::services::{self, Answer};
use crate::simulator::{Refused, Simulator};
use crate::steps;

/// Other programs of the domain are known after so long.
const DISCOVERY: Duration = Duration::from_millis(1200);
const DISCOVERY_STEP: Duration = Duration::from_millis(50);
/// Messages that a late or slow subscriber still gets.
const DEPTH: usize = 100;
/// Of latched topics: the pieces of a long road.
const LATCHED_DEPTH: usize = 64;
/// Complaints about commands go out this often at most.
const COMPLAINT_PERIOD: Duration = Duration::from_secs(1);

/// A node of a ROS 2 domain that shows a run and takes commands for it.
pub struct Node {
    feed: Feed,
    stop: Arc<AtomicBool>,
    stop_services: Option<oneshot::Sender<()>>,
    threads: Vec<JoinHandle<()>>,
}

impl Node {
    /// Joins the domain as `/tractrix` and starts serving, with the frames of the bus of this name if
    /// there is one. Takes 1.2 s: another program's clock on the domain must be noticed.
    ///
    /// # Errors
    /// [`Ros2Error::ClockTaken`], or what the middleware says.
    pub fn start(
        network: Network,
        names: Names,
        bus: Option<&str>,
        simulator: Arc<dyn Simulator>,
    ) -> Result<Self, Ros2Error> {
        let participant = network.join()?;
        refuse_second_clock(&participant, network)?;
        let context = Context::from_domain_participant(participant.clone());
        let context = context.map_err(|e| network.failure("context", e))?;
        let mut setup = Setup::new(&context, participant, network)?;
        let log = Arc::new(setup.node.logging_handle());
        let publishers = setup.publishers(bus)?;
        let autoware = (names == Names::Autoware).then(|| setup.autoware()).transpose()?;
        let loops = setup.loops(&simulator, &log)?;
        let (feed, outlet) = feed(wall_clock());
        let stop = Arc::new(AtomicBool::new(false));
        let (stop_services, stopped) = oneshot::channel();
        let node = setup.node;
        let serve = move || {
            let all = join_all(loops.into_iter().map(|start| start())).map(drop);
            futures::executor::block_on(select(std::pin::pin!(all), stopped));
            drop(node);
        };
        let threads = vec![
            spawn(serve),
            spawn({
                let stop = Arc::clone(&stop);
                move || publish(&outlet, &publishers, autoware.as_ref(), &log, &stop)
            }),
        ];
        Ok(Self { feed, stop, stop_services: Some(stop_services), threads })
    }

    /// What a recording tells the node.
    #[must_use]
    pub fn listener(&self) -> Listener {
        self.feed.listener()
    }

    /// Messages that the network was too slow for.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.feed.dropped()
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(stop) = self.stop_services.take() {
            let _ = stop.send(());
        }
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "a node owns its threads")]
fn spawn(run: impl FnOnce() + Send + 'static) -> JoinHandle<()> {
    std::thread::spawn(run)
}

#[expect(clippy::disallowed_methods, reason = "the network lives in wall time")]
fn wall_clock() -> Instant {
    Instant::now()
}

/// Two clocks on one domain would tear the time of every node that follows it.
#[expect(clippy::disallowed_methods, reason = "discovery takes wall time")]
fn refuse_second_clock(participant: &DomainParticipant, network: Network) -> Result<(), Ros2Error> {
    let until = wall_clock() + DISCOVERY;
    while wall_clock() < until {
        std::thread::sleep(DISCOVERY_STEP);
        let writers = participant.discovered_writers();
        if writers.iter().any(|w| w.publication_topic_data.topic_name == "rt/clock") {
            return Err(Ros2Error::ClockTaken { domain_id: network.domain_id });
        }
    }
    Ok(())
}

/// A message loop that is made in its own thread: the middleware's streams stay in one.
type Loop = Box<dyn FnOnce() -> LocalBoxFuture<'static, ()> + Send>;

/// A node under construction.
struct Setup {
    node: ros2_client::Node,
    participant: DomainParticipant,
    network: Network,
}

impl Setup {
    fn new(
        context: &Context,
        participant: DomainParticipant,
        network: Network,
    ) -> Result<Self, Ros2Error> {
        let name = NodeName::new("/", "tractrix").map_err(|e| network.failure("node", e))?;
        let node = context.new_node(name, NodeOptions::new());
        let node = node.map_err(|e| network.failure("node", format!("{e:?}")))?;
        Ok(Self { node, participant, network })
    }

    /// A publisher for each topic of a recording that is not the stack's own, and for the frames of
    /// a bus.
    fn publishers(
        &mut self,
        bus: Option<&str>,
    ) -> Result<Vec<(Topic, Publisher<Encoded>)>, Ros2Error> {
        let topics = TOPICS.into_iter().filter(|t| !t.name.starts_with("/stack/"));
        let named = topics.map(|topic| (topic, topic.name.to_owned()));
        let frames = bus.map(|bus| (BUS_FRAMES, frames_name(bus)));
        let publish = |(topic, name): (Topic, String)| Ok((topic, self.publisher(&topic, &name)?));
        named.chain(frames).map(publish).collect()
    }

    /// Publishers under Autoware's names.
    fn autoware(&mut self) -> Result<Autoware, Ros2Error> {
        let status = |kind| ("autoware_vehicle_msgs", kind);
        let odometry = ("nav_msgs", "Odometry");
        Ok(Autoware {
            kinematic_state: self.under("/localization/kinematic_state", odometry)?,
            velocity: self.under("/vehicle/status/velocity_status", status("VelocityReport"))?,
            steering: self.under("/vehicle/status/steering_status", status("SteeringReport"))?,
            gear: self.under("/vehicle/status/gear_status", status("GearReport"))?,
            control_mode: self
                .under("/vehicle/status/control_mode", status("ControlModeReport"))?,
        })
    }

    fn under<M: Serialize>(
        &mut self,
        name: &str,
        kind: (&str, &str),
    ) -> Result<Publisher<M>, Ros2Error> {
        let qos = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .history(History::KeepLast { depth: DEPTH });
        let made = self.topic(name, kind, &qos)?;
        let publisher = self.node.create_publisher(&made, None);
        publisher.map_err(|e| self.network.failure(name, e))
    }

    fn publisher(&mut self, topic: &Topic, name: &str) -> Result<Publisher<Encoded>, Ros2Error> {
        let kind = topic.type_name.split_once("/msg/").unwrap_or_default();
        let reliable = QosProfile::publisher_default().reliability_reliable(WhenFull::Fail);
        let qos = match topic.is_latched {
            true => reliable
                .durability(Durability::TransientLocal)
                .history(History::KeepLast { depth: LATCHED_DEPTH }),
            false => reliable.history(History::KeepLast { depth: DEPTH }),
        };
        let made = self.topic(name, kind, &qos)?;
        let publisher = self.node.create_publisher(&made, None);
        publisher.map_err(|e| self.network.failure(name, e))
    }

    fn topic(
        &mut self,
        name: &str,
        (package, kind): (&str, &str),
        qos: &QosProfile,
    ) -> Result<rustdds::Topic, Ros2Error> {
        let failure = |e: &dyn std::fmt::Display| self.network.failure(name, e);
        let full_name = Name::parse(name).map_err(|e| failure(&e))?;
        let kind = MessageTypeName::new(package, kind);
        self.node.create_topic(&full_name, kind, qos).map_err(|e| failure(&e))
    }

    /// A loop for each command and each service.
    fn loops(
        &mut self,
        simulator: &Arc<dyn Simulator>,
        log: &Arc<NodeLoggingHandle>,
    ) -> Result<Vec<Loop>, Ros2Error> {
        let s = simulator;
        Ok(vec![
            self.command::<Float64>("/command/set_speed", ("std_msgs", "Float64"), s, log)?,
            self.command::<Text>("/command/lane_change", ("std_msgs", "String"), s, log)?,
            self.command::<Bool>("/command/external_control", ("std_msgs", "Bool"), s, log)?,
            self.command::<Control>(
                "/control/command/control_cmd",
                ("autoware_control_msgs", "Control"),
                s,
                log,
            )?,
            self.service("get_simulator_features", "GetSimulatorFeatures", s, services::features)?,
            self.service("get_simulation_state", "GetSimulationState", s, services::state)?,
            self.service("set_simulation_state", "SetSimulationState", s, services::set_state)?,
            self.service("reset_simulation", "ResetSimulation", s, services::reset)?,
            self.service("step_simulation", "StepSimulation", s, services::step)?,
            self.simulate_steps(s)?,
            self.service("get_entities", "GetEntities", s, services::entities)?,
            self.service("get_entities_states", "GetEntitiesStates", s, services::entities_states)?,
            self.service("get_entity_state", "GetEntityState", s, services::entity_state)?,
            self.service("load_world", "LoadWorld", s, services::load_world)?,
            self.service("get_current_world", "GetCurrentWorld", s, services::current_world)?,
            self.service("get_available_worlds", "GetAvailableWorlds", s, services::worlds)?,
        ])
    }

    fn command<M: Asks + DeserializeOwned + Send + 'static>(
        &mut self,
        name: &'static str,
        kind: (&str, &str),
        simulator: &Arc<dyn Simulator>,
        log: &Arc<NodeLoggingHandle>,
    ) -> Result<Loop, Ros2Error> {
        let qos = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let topic = self.topic(name, kind, &qos)?;
        let subscription: Subscription<M> = self
            .node
            .create_subscription(&topic, None)
            .map_err(|e| self.network.failure(name, e))?;
        let (simulator, log) = (Arc::clone(simulator), Arc::clone(log));
        Ok(Box::new(move || {
            async move { obey(&subscription, &*simulator, name, &log).await }.boxed_local()
        }))
    }

    /// The action `SimulateSteps`.
    fn simulate_steps(&mut self, simulator: &Arc<dyn Simulator>) -> Result<Loop, Ros2Error> {
        let what = "simulate_steps";
        let reliable = || QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let latched = reliable()
            .durability(Durability::TransientLocal)
            .history(History::KeepLast { depth: 1 });
        let qos = ActionServerQosPolicies {
            goal_service: reliable(),
            result_service: reliable(),
            cancel_service: reliable(),
            feedback_publisher: reliable().reliability_reliable(WhenFull::Fail),
            status_publisher: latched.reliability_reliable(WhenFull::Fail),
        };
        let name = Name::new("/", what).map_err(|e| self.network.failure(what, e))?;
        let kind = ActionTypeName::new("simulation_interfaces", "SimulateSteps");
        let server = self
            .node
            .create_action_server(ServiceMapping::Enhanced, &name, &kind, qos)
            .map_err(|e| self.network.failure(what, e))?;
        let server = steps::Server::new(server);
        let simulator = Arc::clone(simulator);
        Ok(Box::new(move || async move { steps::serve(&server, &*simulator).await }.boxed_local()))
    }

    fn service<Req, Resp>(
        &mut self,
        name: &'static str,
        kind: &str,
        simulator: &Arc<dyn Simulator>,
        answer: impl AsyncFn(&dyn Simulator, Req) -> Resp + Send + 'static,
    ) -> Result<Loop, Ros2Error>
    where
        Req: Message + Clone + Send + 'static,
        Resp: Message + Answer + Send + 'static,
    {
        let qos = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let full_name = Name::new("/", name).map_err(|e| self.network.failure(name, e))?;
        let kind = ServiceTypeName::new("simulation_interfaces", kind);
        let server: Server<Req, Resp> = self
            .node
            .create_server(ServiceMapping::Enhanced, &full_name, &kind, qos.clone(), qos)
            .map_err(|e| self.network.failure(name, e))?;
        let (simulator, room) = (Arc::clone(simulator), Room::new(&self.participant, name));
        Ok(Box::new(move || {
            async move {
                let mut requests = server.receive_request_stream();
                while let Some(request) = requests.next().await {
                    // What cannot be read has no sender to answer
                    let Ok((id, request)) = request else { continue };
                    let response = answer(&*simulator, request).await;
                    let response = services::fitting(response, room.bytes());
                    let _ = server.async_send_response(id, response).await;
                }
            }
            .boxed_local()
        }))
    }
}

/// The topic of the frames of a bus: a name of ROS has letters, digits and underscores.
fn frames_name(bus: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("/can/{}/frames", bus.chars().map(plain).collect::<String>())
}

/// Carries out the commands of a topic; says on `/rosout` why not.
async fn obey<M: Asks + DeserializeOwned + 'static>(
    commands: &Subscription<M>,
    simulator: &dyn Simulator,
    name: &str,
    log: &NodeLoggingHandle,
) {
    let mut complained: Option<Instant> = None;
    let mut received = std::pin::pin!(commands.async_stream());
    while let Some(message) = received.next().await {
        let Ok((message, _)) = message else { continue };
        let why = match message.request() {
            Ok(request) => match simulator.ask(request).await {
                Ok(()) => continue,
                Err(
                    Refused::Unsupported(why)
                    | Refused::IncorrectState(why)
                    | Refused::NotFound(why)
                    | Refused::Failed(why),
                ) => why,
            },
            Err(why) => why,
        };
        let now = wall_clock();
        if complained.is_none_or(|at| now.duration_since(at) >= COMPLAINT_PERIOD) {
            complained = Some(now);
            say(log, LogLevel::Warn, &format!("{name}: {why}"));
        }
    }
}

fn say(log: &NodeLoggingHandle, level: LogLevel, text: &str) {
    log.rosout_raw(Time::now(), level, log.base_name(), text, file!(), "", line!());
}

/// Publishes what the run says until it is told to stop.
fn publish(
    outlet: &Outlet,
    publishers: &[(Topic, Publisher<Encoded>)],
    autoware: Option<&Autoware>,
    log: &NodeLoggingHandle,
    stop: &AtomicBool,
) {
    let mut last_ns = i64::MIN;
    while !stop.load(Ordering::Relaxed) {
        for message in outlet.next(wall_clock) {
            if let Some(now_ns) = clock_ns(&message) {
                if now_ns < last_ns {
                    let text = format!("time starts again at {:.2} s", now_ns as f64 * 1e-9);
                    say(log, LogLevel::Info, &text);
                }
                last_ns = now_ns;
            }
            if let Some(autoware) = autoware {
                autoware.say(&message);
            }
            let to = publishers.iter().find(|(topic, _)| *topic == message.topic);
            if let Some((_, publisher)) = to {
                // A reader that acknowledges nothing loses messages, not the run
                let _ = publisher.publish(Encoded(message.cdr));
            }
        }
    }
}
