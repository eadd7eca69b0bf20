"""A ROS 2 node of another make (rclpy) watches and commands a run: `--ros2`.

Runs in the environment that `peer.sh` makes; SIM_SERVER names the program.
"""

import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from autoware_vehicle_msgs.msg import (
    ControlModeReport,
    GearReport,
    SteeringReport,
    VelocityReport,
)
from nav_msgs.msg import Odometry
from peers import (
    DISCOVERY_S,
    DOMAIN,
    RELIABLE,
    SERVER,
    TOPICS,
    Peer,
    joined,
    ns,
    program,
    running,
)
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from simulation_interfaces.action import SimulateSteps
from simulation_interfaces.msg import (
    EntityCategory,
    EntityFilters,
    Resource,
    Result,
    SimulationState,
)
from simulation_interfaces.srv import (
    GetAvailableWorlds,
    GetCurrentWorld,
    GetEntities,
    GetEntitiesStates,
    GetEntityState,
    GetSimulatorFeatures,
    LoadWorld,
    ResetSimulation,
    SetSimulationState,
)
from std_msgs.msg import Float64, String
from visualization_msgs.msg import MarkerArray


def groups(all_of_them: list[str], of: int) -> Iterator[list[str]]:
    for start in range(0, len(all_of_them), of):
        yield all_of_them[start : start + of]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ros2") / "out"


@pytest.fixture(scope="module")
def run(folder: Path) -> Iterator[subprocess.Popen[str]]:
    options = ["--decider", "external", "--ros2-names", "autoware"]
    with running("highway", *options, "--out", str(folder)) as run:
        yield run


@pytest.fixture(scope="module")
def peer(run: subprocess.Popen[str]) -> Iterator[Peer]:
    with joined() as peer:
        yield peer


def test_every_topic_is_heard_with_one_type(peer: Peer) -> None:
    peer.until(lambda: all(peer.heard[name] for name in TOPICS), "every topic")
    types = dict(peer.node.get_topic_names_and_types())
    for name, (kind, _) in TOPICS.items():
        package = kind.__module__.split(".")[0]
        assert types[name] == [f"{package}/msg/{kind.__name__}"], name
    assert ("tractrix", "/") in peer.node.get_node_names_and_namespaces()


def stamp_ns(message: Any) -> int:
    """When a message was true, wherever its type keeps that."""
    if isinstance(message, Clock):
        return ns(message.clock)
    if isinstance(message, MarkerArray):
        return ns(message.markers[0].header.stamp)
    return ns(message.header.stamp)


def test_no_tick_is_missing_and_the_others_come_at_their_rates(peer: Peer) -> None:
    """Counts are of stamps: what has arrived by now differs from topic to topic (504 for 500 once)."""
    ticks = ("/clock", "/odom", "/imu", "/truck/state", "/truck/plan")
    slower = {"/scene": 10, "/markers": 10, "/fix": 10, "/diagnostics": 100}
    names = [*ticks, *slower]
    peer.until(lambda: all(peer.heard[name] for name in names), "every topic")
    since_ns = max(stamp_ns(peer.heard[name][-1]) for name in names)
    end_ns = since_ns + 5_000_000_000
    peer.until(
        lambda: all(
            stamp_ns(peer.heard[name][-1]) >= end_ns + 10_000_000 * slower.get(name, 1)
            for name in names
        ),
        "5 s of the run",
    )
    for name in names:
        stamps = [
            stamp
            for stamp in map(stamp_ns, peer.heard[name])
            if since_ns < stamp <= end_ns
        ]
        every = slower.get(name, 1)
        steps = {b - a for a, b in itertools.pairwise(stamps)}
        assert steps == {10_000_000 * every}, (name, steps)
        assert len(stamps) == 500 // every, name


def test_the_truck_is_seen_under_autowares_names_too(peer: Peer) -> None:
    names = {
        "/localization/kinematic_state": Odometry,
        "/vehicle/status/velocity_status": VelocityReport,
        "/vehicle/status/steering_status": SteeringReport,
        "/vehicle/status/gear_status": GearReport,
        "/vehicle/status/control_mode": ControlModeReport,
    }
    heard: dict[str, list[Any]] = {name: [] for name in names}
    made = [
        peer.node.create_subscription(kind, name, heard[name].append, RELIABLE)
        for name, kind in names.items()
    ]
    peer.until(lambda: all(len(all_of) > 100 for all_of in heard.values()), "Autoware")
    for subscription in made:
        peer.node.destroy_subscription(subscription)
    odometry, velocity, steering, gear, mode = heard.values()
    states = {ns(state.header.stamp): state for state in peer.heard["/truck/state"]}
    places = {ns(odom.header.stamp): odom for odom in peer.heard["/odom"]}
    assert all(odom == places[ns(odom.header.stamp)] for odom in odometry[:100])
    for said in velocity[:100]:
        state = states[ns(said.header.stamp)]
        assert said.header.frame_id == "base_link"
        assert said.longitudinal_velocity == pytest.approx(state.speed_m_s, rel=1e-6)
        assert said.lateral_velocity == pytest.approx(state.lateral_speed_m_s, abs=1e-6)
        assert said.heading_rate == pytest.approx(state.yaw_rate_rad_s, abs=1e-6)
    for said in steering[:100]:
        state = states[ns(said.stamp)]
        assert said.steering_tire_angle == pytest.approx(state.road_wheel_rad, abs=1e-6)
    for said in gear[:100]:
        neutral = states[ns(said.stamp)].gear == 0
        assert said.report == (GearReport.NEUTRAL if neutral else GearReport.DRIVE)
    assert {said.mode for said in mode} == {ControlModeReport.AUTONOMOUS}


def test_another_nodes_clock_follows_the_run(peer: Peer) -> None:
    follower = Node(
        "follower", parameter_overrides=[Parameter("use_sim_time", value=True)]
    )
    peer.executor.add_node(follower)
    peer.until(
        lambda: follower.get_clock().now().nanoseconds > 0, "sim time", DISCOVERY_S
    )
    peer.until(
        lambda: (
            abs(follower.get_clock().now().nanoseconds - peer.clock_ns()) < 50_000_000
        ),
        "the same time",
    )
    peer.executor.remove_node(follower)
    follower.destroy_node()


def test_only_what_works_is_a_feature(peer: Peer) -> None:
    features = peer.call(GetSimulatorFeatures, "/get_simulator_features").features
    assert sorted(features.features) == [
        8,
        10,
        20,
        24,
        25,
        26,
        31,
        32,
        33,
        40,
        41,
        44,
        45,
    ]


def test_pause_step_and_play(peer: Peer) -> None:
    assert peer.state() == SimulationState.STATE_PLAYING
    refused = peer.step(10)
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert "pause" in refused.error_message
    assert peer.set_state(SimulationState.STATE_PAUSED).result == Result.RESULT_OK
    again = peer.set_state(SimulationState.STATE_PAUSED)
    assert again.result == SetSimulationState.Response.ALREADY_IN_TARGET_STATE
    before = peer.settled_clock_ns()
    assert peer.step(10).result == Result.RESULT_OK
    assert peer.settled_clock_ns() == before + 100_000_000
    assert peer.step(1).result == Result.RESULT_OK
    assert peer.settled_clock_ns() == before + 110_000_000
    assert peer.step(0).result == Result.RESULT_OPERATION_FAILED
    assert peer.step(2**63).result == Result.RESULT_OPERATION_FAILED
    assert peer.set_state(77).result == SetSimulationState.Response.INCORRECT_TRANSITION
    assert peer.set_state(SimulationState.STATE_PLAYING).result == Result.RESULT_OK
    peer.until(lambda: peer.clock_ns() > before + 500_000_000, "it goes on")


def test_steps_are_an_action_with_feedback_that_can_be_cancelled(peer: Peer) -> None:
    client = ActionClient(peer.node, SimulateSteps, "/simulate_steps")
    peer.until(client.server_is_ready, "the action", DISCOVERY_S)
    peer.wait(1.0)
    progress: list[Any] = []

    def send(steps: int) -> Any:
        progress.clear()
        future = client.send_goal_async(
            SimulateSteps.Goal(steps=steps),
            feedback_callback=lambda said: progress.append(said.feedback),
        )
        peer.until(future.done, "the goal's answer")
        assert future.result().accepted
        return future.result()

    def ended(goal: Any) -> tuple[int, Any]:
        future = goal.get_result_async()
        peer.until(future.done, "the result")
        return future.result().status, future.result().result.result

    status, result = ended(send(10))
    assert status == GoalStatus.STATUS_ABORTED
    assert result.result == Result.RESULT_OPERATION_FAILED
    assert "not paused" in result.error_message
    peer.set_state(SimulationState.STATE_PAUSED)
    before_ns = peer.settled_clock_ns()
    status, result = ended(send(35))
    assert (status, result.result) == (GoalStatus.STATUS_SUCCEEDED, Result.RESULT_OK)
    assert peer.settled_clock_ns() == before_ns + 350_000_000
    seen = [(p.completed_steps, p.remaining_steps) for p in progress]
    assert seen == [(10, 25), (20, 15), (30, 5), (35, 0)]
    # A thousand seconds, of which the first are driven
    goal = send(100_000)
    peer.until(lambda: len(progress) >= 3, "feedback")
    cancel = goal.cancel_goal_async()
    peer.until(cancel.done, "the cancellation")
    assert len(cancel.result().goals_canceling) == 1
    status, result = ended(goal)
    assert status == GoalStatus.STATUS_CANCELED and "cancelled" in result.error_message
    driven_ns = peer.settled_clock_ns() - before_ns - 350_000_000
    assert driven_ns == progress[-1].completed_steps * 10_000_000 < 10**12
    # A result that nobody fetches does not keep the next goal waiting
    send(10)
    peer.until(lambda: bool(progress), "feedback")
    peer.wait(0.2)
    assert ended(send(0))[0] == GoalStatus.STATUS_ABORTED
    assert ended(send(10))[0] == GoalStatus.STATUS_SUCCEEDED
    client.destroy()
    assert peer.set_state(SimulationState.STATE_PLAYING).result == Result.RESULT_OK


def test_entities_are_those_of_the_topics(peer: Peer) -> None:
    peer.set_state(SimulationState.STATE_PAUSED)
    peer.settled_clock_ns()
    found = peer.call(GetEntities, "/get_entities")
    assert found.result.result == Result.RESULT_OK
    assert found.entities[0] == "ego" and len(found.entities) > 1
    others = [EntityCategory(category=EntityCategory.CATEGORY_DYNAMIC_OBJECT)]
    for names in groups(found.entities[1:], 4):
        some = EntityFilters(filter="|".join(names), categories=others)
        states = peer.call(GetEntitiesStates, "/get_entities_states", filters=some)
        assert states.result.result == Result.RESULT_OK
        assert list(states.entities) == list(names) and len(states.states) == len(names)
    everybody = peer.call(GetEntitiesStates, "/get_entities_states")
    if len(everybody.states) != len(found.entities):
        # The middleware cannot send more at once
        assert everybody.result.result == Result.RESULT_OPERATION_FAILED
        assert "ask for fewer" in everybody.result.error_message
    ego = peer.call(GetEntityState, "/get_entity_state", entity="ego")
    odom = peer.heard["/odom"][-1]
    assert ego.state.header.stamp == odom.header.stamp
    assert ego.state.pose.position == odom.pose.pose.position
    speed = (ego.state.twist.linear.x**2 + ego.state.twist.linear.y**2) ** 0.5
    assert abs(speed - abs(odom.twist.twist.linear.x)) < 0.05
    ghost = peer.call(GetEntityState, "/get_entity_state", entity="ghost")
    assert ghost.result.result == Result.RESULT_NOT_FOUND
    peer.set_state(SimulationState.STATE_PLAYING)


def test_set_speed_and_lane_change_reach_the_truck(peer: Peer) -> None:
    set_speed = peer.node.create_publisher(Float64, "/command/set_speed", 10)
    lane_change = peer.node.create_publisher(String, "/command/lane_change", 10)
    peer.until(
        lambda: (
            set_speed.get_subscription_count()
            > 0
            < lane_change.get_subscription_count()
        ),
        "its ears",
        DISCOVERY_S,
    )
    set_speed.publish(Float64(data=15.0))
    peer.until(
        lambda: peer.heard["/truck/plan"][-1].reference_speed_m_s < 19.0,
        "a lower reference speed",
    )
    set_speed.publish(Float64(data=float("nan")))
    peer.until(
        lambda: any("set speed nan" in m.msg.lower() for m in peer.heard["/rosout"]),
        "a complaint",
    )

    def changes() -> bool:
        plan = peer.heard["/truck/plan"][-1]
        if plan.maneuver == "keep_lane" and time.monotonic() > changes.next:  # type: ignore[attr-defined]
            changes.next = time.monotonic() + 0.5  # type: ignore[attr-defined]
            lane_change.publish(String(data="left"))
        return plan.maneuver not in ("keep_lane", "") or plan.refusal != ""

    changes.next = 0.0  # type: ignore[attr-defined]
    peer.until(changes, "a lane change or its refusal")


def test_a_reset_starts_time_again_and_says_so(peer: Peer, folder: Path) -> None:
    assert peer.clock_ns() > 5_000_000_000
    partly = peer.call(ResetSimulation, "/reset_simulation", scope=1)
    assert partly.result.result == Result.RESULT_FEATURE_UNSUPPORTED
    done = peer.call(ResetSimulation, "/reset_simulation", scope=0)
    assert done.result.result == Result.RESULT_OK
    peer.until(lambda: peer.clock_ns() < 5_000_000_000, "a new time")
    peer.until(
        lambda: any("time starts again" in m.msg for m in peer.heard["/rosout"]),
        "a word on /rosout",
    )
    assert (folder / "summary.json").exists() and (folder / "run-2").is_dir()


def test_worlds_are_loaded_by_name_or_text_but_not_from_files(peer: Peer) -> None:
    worlds = peer.call(GetAvailableWorlds, "/get_available_worlds").worlds
    assert {"flat", "highway"} <= {world.name for world in worlds}

    def load(uri: str = "", text: str = "") -> Any:
        resource = Resource(uri=uri, resource_string=text)
        return peer.call(LoadWorld, "/load_world", world_resource=resource)

    wrong = load(uri="/etc/passwd").result
    assert (
        wrong.result == Result.RESULT_OPERATION_FAILED
        and "/etc/passwd" in wrong.error_message
    )
    assert load().result.result == LoadWorld.Response.NO_RESOURCE
    text = subprocess.run(
        [SERVER, "scenario", "show", "flat"], capture_output=True, text=True, check=True
    ).stdout
    outside = text.replace('"builtin:flat"', '"/etc/hostname.csv"')
    assert outside != text
    refused = load(text=outside).result
    assert (
        refused.result == Result.RESULT_OPERATION_FAILED
        and "road" in refused.error_message
    )
    assert peer.call(GetCurrentWorld, "/get_current_world").world.name == "highway"
    loaded = load(uri="flat")
    assert loaded.result.result == Result.RESULT_OK and loaded.world.name == "flat"
    assert peer.state() == SimulationState.STATE_STOPPED
    assert peer.step(1).result == Result.RESULT_OPERATION_FAILED
    assert peer.set_state(SimulationState.STATE_PAUSED).result == Result.RESULT_OK
    assert peer.step(100).result == Result.RESULT_OK
    assert peer.settled_clock_ns() == 990_000_000


def test_a_second_program_on_the_domain_is_refused(peer: Peer, folder: Path) -> None:
    out = folder.parent / "second"
    second = program("flat", "--headless", "--ros2", "--out", str(out))
    _, words = second.communicate(timeout=60)
    assert second.returncode == 2 and f"domain {DOMAIN}" in words, words
    assert not out.exists()


def test_quitting_ends_the_program_with_its_summary(
    peer: Peer, run: subprocess.Popen[str], folder: Path
) -> None:
    assert peer.set_state(SimulationState.STATE_QUITTING).result == Result.RESULT_OK
    assert run.wait(timeout=30) == 0
    summary = json.loads((folder / "run-3" / "summary.json").read_text())
    assert summary["duration_s"] == pytest.approx(0.99), "the last of 100 ticks"
    # The world that was loaded and stepped over ROS 2 is that of the command line, bit for bit
    alone = folder.parent / "alone"
    words = ["run", "flat", "--headless", "--duration", "1", "--out", str(alone)]
    subprocess.run([SERVER, *words], check=True, capture_output=True, timeout=60)
    same = json.loads((alone / "summary.json").read_text())
    assert summary["state_hash"] == same["state_hash"]


def test_a_domain_that_cannot_be_is_named(tmp_path: Path) -> None:
    environment = os.environ | {"ROS_DOMAIN_ID": "300"}
    for name in ("LD_LIBRARY_PATH", "PYTHONPATH"):
        environment.pop(name, None)
    answer = subprocess.run(
        [SERVER, "run", "flat", "--headless", "--ros2", "--out", str(tmp_path / "out")],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert answer.returncode == 2
    assert answer.stderr.strip().endswith(
        "ROS_DOMAIN_ID=300: expected a number from 0 to 232"
    )


def test_every_entity_comes_at_once_to_who_is_reached_over_loopback_alone(
    tmp_path: Path,
) -> None:
    """The middleware cannot send an answer in fragments: it must fit into one datagram."""
    here, domain = Path(__file__).parent, DOMAIN + 100
    over_loopback = {
        "FASTDDS_DEFAULT_PROFILES_FILE": str(here / "loopback.xml"),
        # Otherwise Fast DDS takes the transports of its own
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "ROS_DOMAIN_ID": str(domain),
    }
    with running("dense-15", "--out", str(tmp_path / "out"), domain=domain):
        asked = subprocess.run(
            [sys.executable, here / "entities.py"],
            env=os.environ | over_loopback,
            check=True,
            capture_output=True,
            text=True,
            timeout=90,
        )
    found = json.loads(asked.stdout)
    assert found["words"] == ""
    assert found["states"] == found["named"] > 15, found
