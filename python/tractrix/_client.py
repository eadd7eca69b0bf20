"""A running `sim-server`, asked over its HTTP API. Needs httpx: `tractrix[client]`."""

from __future__ import annotations

from dataclasses import dataclass
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
    """A `sim-server`, by its address.

    with tractrix.Client("http://127.0.0.1:8080") as client:
        session = client.session()
        session.pause()
        session.reset(seed=7)
        session.step(1000)
        print(session.state()["ego"]["speed_m_s"])
    """

    def __init__(
        self, url: str = "http://127.0.0.1:8080", *, timeout_s: float = 600.0
    ) -> None:
        """Asks nothing yet.

        Args:
            url: Address of the server, as it prints it.
            timeout_s: Longest wait for an answer. A step is answered when it is driven.
        """
        self._http = httpx.Client(base_url=url, timeout=timeout_s, trust_env=False)

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

    def quit(self) -> Acted:
        """Ends the run and the program."""
        return self._control(action="quit")

    def _control(self, **command: Any) -> Acted:
        answer = self._client._post(f"{self._path}/control", command)
        return Acted(answer["tick"], answer["time_s"], answer["state"])
