"""A server is driven from Python, and the run has the bits of the same world in this process."""

import json
import re
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import tractrix
from program import program

httpx = pytest.importorskip("httpx", reason="httpx is not installed: tractrix[client]")

SEED = 2**64 - 1


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("client") / "out"


@pytest.fixture(scope="module")
def client(out: Path) -> Iterator[tractrix.Client]:
    words: list[str | Path] = [
        "run",
        "medium-15",
        "--decider",
        "external",
        "--pace",
        "max",
    ]
    words += ["--port", "0", "--keep-open", "--out", out]
    with subprocess.Popen(
        [program(), *words], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        address = re.search(r"http://[0-9.:]+", process.stderr.readline())
        assert address is not None
        with tractrix.Client(address.group()) as client:
            yield client
        process.kill()


def test_commands_act_or_are_refused_with_a_code(client: tractrix.Client) -> None:
    session = client.session()
    assert session.play().state == "playing"
    # On a loaded machine all of the requests below came before the first frame was made
    client.wait_until_ready()
    with pytest.raises(tractrix.Refused, match="pause it first") as refused:
        session.step(10)
    assert (refused.value.status, refused.value.code) == (409, "wrong_state")
    with pytest.raises(tractrix.Refused, match="pace") as refused:
        session.pace(-1.0)
    assert refused.value.code == "wrong_value"
    with pytest.raises(tractrix.Refused) as refused:
        client.session("other")
    assert refused.value.code == "no_session"
    assert session.pause().state == "paused"
    session.set_speed(20.0)
    seen = (session.state()["run"]["set_speed_m_s"] for _ in range(10_000))
    assert 20.0 in seen


def test_a_run_in_lockstep_has_the_bits_of_a_world_in_this_process(
    client: tractrix.Client, out: Path
) -> None:
    session = client.session()
    assert [s.id for s in client.sessions()] == [session.id] == ["default"]
    session.pause()
    assert session.reset(seed=SEED).tick == 0
    assert session.info()["seed"] == SEED
    assert session.step(1000).time_s == pytest.approx(10.0)
    session.lane_change("left")
    acted = session.step_until(30.0)
    assert (acted.tick, acted.state) == (3000, "paused")
    assert session.road()["length_m"] > 0
    session.stop()
    summary = json.loads((out / "run-2" / "summary.json").read_text())
    with tractrix.World("medium-15", seed=SEED, decider="external") as world:
        world.step(1000)
        world.request_lane_change("left")
        world.step(2000)
        assert summary["state_hash"] == world.summary()["state_hash"]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tractrix.Client]:
    runs = tmp_path_factory.mktemp("serve") / "runs"
    words: list[str | Path] = [
        "serve",
        "--port",
        "0",
        "--sessions",
        "2",
        "--runs",
        runs,
    ]
    with subprocess.Popen(
        [program(), *words], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        address = re.search(r"http://[0-9.:]+", process.stderr.readline())
        assert address is not None
        with tractrix.Client(address.group()) as client:
            yield client
        process.kill()


def test_a_session_is_changed_driven_and_broken_under_way(
    server: tractrix.Client,
) -> None:
    session = server.create("flat", seed=3, pace="max", vehicle="bus")
    session.pause()
    session.set_decider("mobil")
    session.set_speed_planner("predictive")
    session.step(200)
    for _ in range(50):
        session.external(-1.0, 0.0)
        session.step(2)
    session.release()
    with pytest.raises(tractrix.Refused, match="expected localisation"):
        session.fault("wings")
    session.fault("engine")
    session.step(100)
    deadline = time.monotonic() + 10.0
    while not (session.bus()["faults"] and session.state()["run"]["faults"]):
        assert time.monotonic() < deadline
    names = {message["name"] for message in session.bus()["messages"]}
    assert {"EEC1", "XBR"} <= names
    run = session.state()["run"]
    assert (run["decider"], run["speed_planner"]) == ("mobil", "predictive")
    assert run["faults"] == ["engine"] and not run["driven_from_outside"]
    name = session.info()["run"]
    session.end()
    server.run(name).remove()


def test_sessions_begin_end_and_leave_runs(
    server: tractrix.Client, tmp_path: Path
) -> None:
    assert server.sessions() == []
    assert "flat" in {scenario["name"] for scenario in server.scenarios()}
    with pytest.raises(tractrix.Refused, match="nothing") as refused:
        server.create("nothing")
    assert refused.value.code == "unusable"
    names = []
    for seed in (7, 7):
        session = server.create("medium-15", seed=seed, decider="external", pace="max")
        session.pause()
        assert session.step(500).tick == 500
        names.append(session.info()["run"])
        session.end()
    assert server.sessions() == []
    runs = [server.run(name) for name in names]
    hashes = {run.info()["summary"]["state_hash"] for run in runs}
    with tractrix.World("medium-15", seed=7, decider="external") as world:
        world.step(500)
        assert hashes == {world.summary()["state_hash"]}
    compared = server.compare(*names)
    assert (compared["ticks"], compared["ticks_different"]) == (500, 0)
    assert len(runs[0].frames(1.0, 2.0)) == 5
    runs[0].download(tmp_path / "run.mcap")
    assert len(tractrix.read_run(tmp_path / "run.mcap")) == 500
    assert {run.name for run in server.runs()} == set(names)
    runs[0].remove()
    with pytest.raises(tractrix.Refused) as refused:
        server.run(names[0])
    assert refused.value.code == "no_run"


def test_a_trip_is_planned_as_a_job(server: tractrix.Client) -> None:
    speeds = {"set_speed_m_s": 22.0, "speed_min_m_s": 20.0, "speed_max_m_s": 24.0}
    job = server.plan(
        truck="sinotruk", road="builtin:highway", mass_kg=40_000.0, **speeds
    )
    assert job.wait(120.0)["status"] == "done"
    plan = job.json("plan.json")
    assert plan["saving_frac"]["vs_set_speed"] > 0.02
    job.cancel()
    with pytest.raises(tractrix.Refused) as refused:
        job.info()
    assert refused.value.code == "no_job"


def test_nobody_answers() -> None:
    with (
        tractrix.Client("http://127.0.0.1:9") as nobody,
        pytest.raises(httpx.TransportError),
    ):
        nobody.health()
