"""A viewer of Foxglove's protocol (`foxglove.sdk.v1`), after its published description."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

TIMEOUT_S = 30.0


@dataclass(frozen=True)
class Said:
    """A message of a topic."""

    topic: str
    time_ns: int
    data: bytes


@dataclass(frozen=True)
class Playing:
    """What the player of a recording says of itself."""

    status: str
    time_ns: int
    speed: float
    did_seek: bool
    request: str


@dataclass
class Viewer:
    """A connection, and what came over it so far."""

    socket: ClientConnection
    info: list[dict[str, Any]] = field(default_factory=list)
    channels: dict[str, dict[str, Any]] = field(default_factory=dict)
    services: dict[str, dict[str, Any]] = field(default_factory=dict)
    statuses: list[str] = field(default_factory=list)
    messages: list[Said] = field(default_factory=list)
    times_ns: list[int] = field(default_factory=list)
    answers: dict[int, dict[str, Any]] = field(default_factory=dict)
    asked: dict[str, dict[str, Any]] = field(default_factory=dict)
    told: dict[str, Any] = field(default_factory=dict)
    states: list[Playing] = field(default_factory=list)
    calls: int = 0

    def until(self, is_so: Callable[[], bool]) -> None:
        """Takes what comes until something is so."""
        while not is_so():
            self.take(self.socket.recv(timeout=TIMEOUT_S))

    def drain(self) -> None:
        """Takes what comes until nothing comes for a second."""
        with suppress(TimeoutError):
            while True:
                self.take(self.socket.recv(timeout=1.0))

    def take(self, said: str | bytes) -> None:
        """Takes one message of the server."""
        if isinstance(said, bytes):
            self._take_binary(said)
            return
        message = json.loads(said)
        match message["op"]:
            case "serverInfo":
                self.info.append(message)
            case "advertise":
                self.channels |= {c["topic"]: c for c in message["channels"]}
            case "advertiseServices":
                self.services |= {s["name"]: s for s in message["services"]}
            case "status":
                self.statuses.append(message["message"])
            case "serviceCallFailure":
                self.answers[message["callId"]] = {"failure": message["message"]}
            case "parameterValues":
                values = {p["name"]: p["value"] for p in message["parameters"]}
                if "id" in message:
                    self.asked[message["id"]] = values
                else:
                    self.told |= values

    def _take_binary(self, said: bytes) -> None:
        match said[0]:
            case 1:
                subscription, time_ns = struct.unpack_from("<IQ", said, 1)
                topics = {c["id"]: topic for topic, c in self.channels.items()}
                self.messages.append(Said(topics[subscription], time_ns, said[13:]))
            case 2:
                self.times_ns.extend(struct.unpack_from("<Q", said, 1))
            case 3:
                _, call, length = struct.unpack_from("<III", said, 1)
                assert said[13 : 13 + length] == b"json"
                self.answers[call] = json.loads(said[13 + length :])
            case 5:
                status, at, speed, seek, length = struct.unpack_from("<BQfBI", said, 1)
                assert len(said) == 19 + length
                word = ("playing", "paused", "buffering", "ended")[status]
                request = said[19:].decode()
                self.states.append(Playing(word, at, speed, bool(seek), request))

    def subscribe_all(self) -> None:
        """Wants every topic; a subscription has the number of its channel."""
        wanted = [{"id": c["id"], "channelId": c["id"]} for c in self.channels.values()]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def call(self, service: str, **keys: object) -> dict[str, Any]:
        """The answer of a service; of one that refuses `failure` with its words."""
        self.calls += 1
        call = self.calls
        head = struct.pack("<BIII", 2, self.services[service]["id"], call, 4)
        self.socket.send(head + b"json" + json.dumps(keys).encode())
        self.until(lambda: call in self.answers)
        return self.answers[call]

    def parameters(self, *names: str) -> dict[str, Any]:
        """Values of these parameters, or of all."""
        return self._ask_for({"op": "getParameters", "parameterNames": names})

    def set_parameters(self, **values: object) -> dict[str, Any]:
        """What parameters are once they have been set."""
        wanted = [{"name": name, "value": value} for name, value in values.items()]
        return self._ask_for({"op": "setParameters", "parameters": wanted})

    def subscribe_parameters(self, *names: str) -> None:
        """Wants to be told when they change."""
        wanted = {"op": "subscribeParameterUpdates", "parameterNames": names}
        self.socket.send(json.dumps(wanted))

    def _ask_for(self, question: dict[str, Any]) -> dict[str, Any]:
        self.calls += 1
        number = str(self.calls)
        self.socket.send(json.dumps(question | {"id": number}))
        self.until(lambda: number in self.asked)
        return self.asked[number]

    def control(
        self, command: str, speed: float = 1.0, seek_ns: int | None = None
    ) -> Playing:
        """Plays or pauses a recording; what its player answers."""
        self.calls += 1
        request = f"request {self.calls}"
        has_seek = seek_ns is not None
        body = struct.pack(
            "<BBfBQ", 3, command == "pause", speed, has_seek, seek_ns or 0
        )
        self.socket.send(body + struct.pack("<I", len(request)) + request.encode())
        self.until(lambda: any(state.request == request for state in self.states))
        return next(state for state in self.states if state.request == request)

    def publish(self, number: int, topic: str, data: object) -> None:
        """Says something on a channel of its own."""
        channel = {"id": number, "topic": topic, "encoding": "json", "schemaName": ""}
        self.socket.send(json.dumps({"op": "advertise", "channels": [channel]}))
        body = json.dumps({"data": data}).encode()
        self.socket.send(struct.pack("<BI", 1, number) + body)


@contextmanager
def connected(url: str, has_services: bool = True) -> Iterator[Viewer]:
    """A viewer with the channels and services that the server has."""
    wanted = [Subprotocol("foxglove.sdk.v1")]
    with connect(url, subprotocols=wanted, max_size=None, close_timeout=1) as socket:
        viewer = Viewer(socket)
        viewer.until(
            lambda: bool(viewer.channels) and bool(viewer.services) == has_services
        )
        yield viewer
