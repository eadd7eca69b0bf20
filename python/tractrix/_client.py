"""A running `sim-server`, asked over its HTTP API. Needs httpx: `tractrix[client]`."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import httpx


class Refused(Exception):
    """The server refused something.

    Attributes:
        status: Status of the answer.
        code: What was wrong, for programs: the last part of the problem's `type`, `wrong_state`,
            `wrong_value`, ...
    """

    def __init__(self, status: int, code: str, why: str) -> None:
        super().__init__(why)
        self.status = status
        self.code = code


@dataclass(frozen=True)
class Acted:
    """A command that has acted."""

    tick: int
    """Ticks driven in this run."""
    time_s: float
    """Simulation time, s."""
    state: Literal["stopped", "playing", "paused", "quitting"]
    """The state that it left."""


class Client:
    """A `sim-server run` or `sim-server serve`, by its address.

    with tractrix.Client("http://127.0.0.1:8080") as client:
        session = client.session()
        session.pause()
        session.reset(seed=7)
        session.step(1000)
        print(session.state()["ego"]["speed_m_s"])
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8080",
        *,
        timeout_s: float = 600.0,
        token: str | None = None,
    ) -> None:
        """Asks nothing yet.

        Args:
            url: Address of the server, as it prints it.
            timeout_s: Longest wait for an answer. A step is answered when it is driven.
            token: What is in the server's `--token-file`, if it has one.
        """
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._http = httpx.Client(
            base_url=url, timeout=timeout_s, headers=headers, trust_env=False
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def health(self) -> dict[str, Any]:
        """Version and revision of the server.

        Raises:
            httpx.TransportError: Nobody answers there.
        """
        return self._get("/api/v1/health")

    def wait_until_ready(self, timeout_s: float = 60.0) -> None:
        """Returns when there is a run to look at: a server answers before its first tick is driven.

        Raises:
            Refused: There is still none after `timeout_s` (`no_tick_yet`).
            httpx.TransportError: Nobody answers there.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            try:
                self._get("/api/v1/ready")
            except Refused as refused:
                if refused.code != "no_tick_yet" or time.monotonic() >= deadline:
                    raise
                time.sleep(0.02)
            else:
                return

    def sessions(self) -> list[Session]:
        """The sessions of the server."""
        return [
            Session(self, s["id"]) for s in self._get("/api/v1/sessions")["sessions"]
        ]

    def session(self, session_id: str = "default") -> Session:
        """One session.

        Raises:
            Refused: There is no such session (`no_session`).
        """
        return Session(self, self._get(f"/api/v1/sessions/{session_id}")["id"])

    def create(
        self,
        scenario: str | None = None,
        *,
        toml: str | None = None,
        seed: int | None = None,
        state: Literal["stopped", "paused", "playing"] = "stopped",
        pace: float | Literal["realtime", "max"] = "realtime",
        **changes: Any,
    ) -> Session:
        """Begins a session, with a recording of its own.

        Args:
            scenario: Name of a built-in scenario; or
            toml: the text of a scenario. It names what is built in, or files below the server's
                `--assets`.
            seed: Seed of everything that is drawn at random; otherwise the scenario's.
            state: Standing still, or playing.
            pace: Simulated seconds per second.
            **changes: As the options of the command line: `road`, `truck`, `payload_kg`,
                `duration_s`, `allow_off_road`, `traffic`, `mode`, `decider`, `speed_planner`,
                `vehicle` (`direct`, or over a `bus` in memory).

        Raises:
            Refused: `too_many_sessions`, `unusable`, `outside`, `wrong_body`.
        """
        named = {"scenario": scenario, "toml": toml, "seed": seed}
        wanted = {key: value for key, value in named.items() if value is not None}
        body = {**wanted, "state": state, "pace": pace, **changes}
        return Session(self, self._post("/api/v1/sessions", body)["id"])

    def scenarios(self) -> list[dict[str, Any]]:
        """Names and descriptions of the built-in scenarios."""
        found: list[dict[str, Any]] = self._get("/api/v1/scenarios")["scenarios"]
        return found

    def runs(self) -> list[Run]:
        """What sessions have left, the newest first."""
        return [Run(self, r["name"]) for r in self._get("/api/v1/runs")["runs"]]

    def run(self, name: str) -> Run:
        """One run.

        Raises:
            Refused: There is no such run (`no_run`).
        """
        return Run(self, self._get(f"/api/v1/runs/{name}")["name"])

    def compare(self, a: str, b: str) -> dict[str, Any]:
        """Whether two runs are the same bit for bit, by their names: `ticks_different`,
        `first_difference`, `other_scene_s`."""
        return self._get(f"/api/v1/compare?a={a}&b={b}")

    def plan(self, **trip: Any) -> Job:
        """Plans a trip: `truck`, `road`, `mass_kg`, `set_speed_m_s`, `speed_min_m_s`,
        `speed_max_m_s`, `trip_time_s`, `eco_roll`. A job with the files of `sim-server plan`."""
        return Job(self, self._post("/api/v1/plan", trip)["id"])

    def diagnose(self, **drives: Any) -> Job:
        """Diagnoses drives: `truck`, `drives` (a folder among the server's assets) or `run`,
        `baseline`, `hold_out`. A job with the files of `sim-server diagnose`."""
        return Job(self, self._post("/api/v1/diagnose", drives)["id"])

    def _delete(self, path: str) -> None:
        answer = self._http.delete(path)
        if not answer.is_success:
            _answer(answer)

    def _download(self, path: str, to: Path) -> None:
        with self._http.stream("GET", path) as answer, to.open("xb") as file:
            if not answer.is_success:
                answer.read()
                _answer(answer)
            for part in answer.iter_bytes():
                file.write(part)

    def _get(self, path: str) -> dict[str, Any]:
        return _answer(self._http.get(path))

    def _post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        return _answer(self._http.post(path, json=body))


def _answer(answer: httpx.Response) -> dict[str, Any]:
    try:
        body: dict[str, Any] = answer.json()
    except ValueError:
        body = {"type": "urn:tractrix:no_json", "detail": "the answer is no JSON"}
        raise _refused(answer, body) from None
    if answer.is_success:
        return body
    raise _refused(answer, body)


def _refused(answer: httpx.Response, body: dict[str, Any]) -> Refused:
    code = str(body.get("type", "")).rpartition(":")[2]
    return Refused(answer.status_code, code, str(body.get("detail", "")))


class Run:
    """A run that a session has left, or is leaving."""

    def __init__(self, client: Client, name: str) -> None:
        self._client = client
        self.name = name
        """Name of the run."""
        self._path = f"/api/v1/runs/{name}"

    def info(self) -> dict[str, Any]:
        """Size and time of the recording, whether it is still `recording`, the `summary`."""
        return self._client._get(self._path)

    def strip(self) -> dict[str, Any]:
        """Columns over the distance."""
        return self._client._get(f"{self._path}/strip")

    def frames(self, from_s: float, to_s: float) -> list[dict[str, Any]]:
        """Frames of a stretch of simulation time, four a second, 600 at most."""
        path = f"{self._path}/frames?from_s={from_s}&to_s={to_s}"
        found: list[dict[str, Any]] = self._client._get(path)["frames"]
        return found

    def download(self, to: str | Path) -> None:
        """Writes the recording into a new file; of a run under way its finished part."""
        self._client._download(f"{self._path}/recording", Path(to))

    def report(self, to: str | Path) -> None:
        """Writes the report, a page in one file, into a new file."""
        self._client._download(f"{self._path}/report", Path(to))

    def remove(self) -> None:
        """Removes the run's files from the server."""
        self._client._delete(self._path)


class Job:
    """A command that the server carries out."""

    def __init__(self, client: Client, job_id: str) -> None:
        self._client = client
        self.id = job_id
        """Name of the job."""
        self._path = f"/api/v1/jobs/{job_id}"

    def info(self) -> dict[str, Any]:
        """`status` (`queued`, `running`, `done`, `failed`, `cancelled`, `timed_out`), what it
        `said` last or `why` it failed, its `files`."""
        return self._client._get(self._path)

    def wait(self, timeout_s: float = 1800.0) -> dict[str, Any]:
        """Waits until the job is over; its `info`.

        Raises:
            TimeoutError: It is not over in time.
        """
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            info = self.info()
            if info["status"] not in ("queued", "running"):
                return info
            time.sleep(0.1)
        raise TimeoutError(f"job {self.id} is not over after {timeout_s} s")

    def json(self, name: str) -> dict[str, Any]:
        """One of its files that is JSON: `plan.json`, `diagnosis.json`."""
        return self._client._get(f"{self._path}/files/{name}")

    def download(self, name: str, to: str | Path) -> None:
        """Writes one of its files into a new file."""
        self._client._download(f"{self._path}/files/{name}", Path(to))

    def cancel(self) -> None:
        """Ends the job, and removes its files from the server."""
        self._client._delete(self._path)


class Session:
    """A run and those that follow it. Every command answers when it has acted.

    All commands raise `Refused`; its `code` is that of the API (docs/server.md).
    """

    def __init__(self, client: Client, session_id: str) -> None:
        self._client = client
        self.id = session_id
        """Name of the session."""
        self._path = f"/api/v1/sessions/{session_id}"

    def info(self) -> dict[str, Any]:
        """State, scenario, seed and length of a tick (`tick_s`)."""
        return self._client._get(self._path)

    def state(self) -> dict[str, Any]:
        """The latest frame, 20 a second of wall time: run, ego, road, plan, neighbours."""
        return self._client._get(f"{self._path}/state")

    def summary(self) -> dict[str, Any]:
        """The summary so far, of the latest frame; the final one after the end."""
        return self._client._get(f"{self._path}/summary")

    def bus(self) -> dict[str, Any]:
        """Messages with rate, age and signals, addresses and faults of a truck on a bus."""
        return self._client._get(f"{self._path}/bus")

    def road(self) -> dict[str, Any]:
        """Lane borders, markings, profile, the truck's lengths."""
        return self._client._get(f"{self._path}/road")

    def play(self) -> Acted:
        """Goes on."""
        return self._control(action="play")

    def pause(self) -> Acted:
        """Stands still between two ticks."""
        return self._control(action="pause")

    def step(self, ticks: int = 1, *, wait: bool = True) -> Acted:
        """In a pause: drives ticks, 1 to 1,000,000; with `wait` the answer comes when they are
        driven (lockstep)."""
        return self._control(action="step", ticks=ticks, wait=wait)

    def step_until(self, time_s: float, *, wait: bool = True) -> Acted:
        """In a pause: drives to the first tick at or behind a simulation time, s."""
        return self._control(action="step_until", time_s=time_s, wait=wait)

    def pause_at(self, time_s: float) -> Acted:
        """Stands still at the first tick at or behind a simulation time, s, when it comes there."""
        return self._control(action="pause_at", time_s=time_s)

    def snapshot(self, name: str) -> Acted:
        """Keeps the world as it is now, under a name (lower-case letters, digits, hyphens)."""
        return self._control(action="snapshot", name=name)

    def restore(self, name: str) -> Acted:
        """Goes on from where the world was kept, with a recording of its own."""
        return self._control(action="restore", name=name)

    def reset(self, seed: int | None = None) -> Acted:
        """Back to the start, with a recording of its own; with the same seed or another one."""
        more = {} if seed is None else {"seed": seed}
        return self._control(action="reset", **more)

    def stop(self) -> Acted:
        """Back to the start, standing still."""
        return self._control(action="stop")

    def pace(self, pace: float | Literal["realtime", "max"]) -> Acted:
        """Simulated seconds per second."""
        return self._control(action="pace", pace=pace)

    def set_speed(self, speed_m_s: float) -> Acted:
        """The driver's set speed, m/s, 0 to 40."""
        return self._control(action="set_speed", speed_m_s=speed_m_s)

    def lane_change(self, to: Literal["left", "right", "keep"]) -> Acted:
        """Wishes a lane change (`--decider external`); the safety gate decides."""
        return self._control(action="lane_change", to=to)

    def set_decider(self, decider: str) -> Acted:
        """Another decider: `keep`, `rules:METRES`, `mobil`, `rollout`, `dqn`, `external`."""
        return self._control(action="set_decider", decider=decider)

    def set_speed_planner(
        self, speed_planner: Literal["cruise", "predictive"]
    ) -> Acted:
        """Another source of the reference speed."""
        return self._control(action="set_speed_planner", speed_planner=speed_planner)

    def external(self, accel_m_s2: float, road_wheel_rad: float) -> Acted:
        """Drives the truck: acceleration along the road, angle of the front wheels (positive:
        left). Without another call within 0.2 s of simulation time the truck stops in its lane."""
        return self._control(
            action="external", accel_m_s2=accel_m_s2, road_wheel_rad=road_wheel_rad
        )

    def release(self) -> Acted:
        """Gives the truck back to its stack."""
        return self._control(action="release")

    def fault(self, fault: str, on: bool = True) -> Acted:
        """Breaks something, or mends it: `localisation`, `perception`; over a bus `wheel_speeds`
        and the control units (`engine`, `brakes`, `steering`, ...)."""
        return self._control(action="fault", fault=fault, on=on)

    def quit(self) -> Acted:
        """Ends the run and the session; with `run` the program too."""
        return self._control(action="quit")

    def end(self) -> None:
        """Ends the session; its summary is written when this returns."""
        self._client._delete(self._path)

    def _control(self, **command: Any) -> Acted:
        answer = self._client._post(f"{self._path}/control", command)
        return Acted(answer["tick"], answer["time_s"], answer["state"])
