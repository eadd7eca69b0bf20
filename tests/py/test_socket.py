"""The WebSocket as a page of the server uses it: hello, channels, commands and their answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from playwright.sync_api import Page
from running import running

TALK = """async ([said, enough_ms, answers, frames]) => {
    const opens = performance.now();
    const socket = new WebSocket(`ws://${location.host}/ws`);
    const heard = [];
    socket.onmessage = (event) => heard.push([performance.now(), JSON.parse(event.data)]);
    await new Promise((open) => { socket.onopen = open; });
    for (const words of said) socket.send(typeof words === "string" ? words : JSON.stringify(words));
    const count = (...kinds) => heard.filter(([, m]) => kinds.includes(m.kind)).length;
    const lacks = () => count("ack", "refused") < answers || count("frame") < frames;
    const began = performance.now(), over = () => performance.now() - began;
    while (over() < enough_ms || (lacks() && over() < 20000)) {
        await new Promise((soon) => setTimeout(soon, 20));
    }
    socket.close();
    heard.push([performance.now(), { kind: "listened", s: 1e-3 * (performance.now() - opens) }]);
    return heard;
}"""


def talk(
    page: Page, *said: Any, enough_ms: int = 100, frames: int = 0
) -> list[tuple[float, Any]]:
    """What a viewer hears, with the time in ms, until all it says is answered and the frames are in."""
    heard: list[tuple[float, Any]] = page.evaluate(
        TALK, [list(said), enough_ms, len(said), frames]
    )
    return heard


def kinds(heard: list[tuple[float, Any]], kind: str) -> list[Any]:
    """The messages of a kind."""
    return [message for _, message in heard if message["kind"] == kind]


def most_frames(heard: list[tuple[float, Any]], rate_hz: float) -> float:
    """What comes at that rate while was listened, which a busy machine draws out."""
    return 1.25 * rate_hz * float(kinds(heard, "listened")[0]["s"]) + 4.0


def test_a_viewer_is_greeted_chooses_its_channels_and_commands(
    server: Path, page: Page, tmp_path: Path
) -> None:
    with running(server, tmp_path, "--decider", "external", "--seed", "1") as run:
        page.goto(run.url)
        page.wait_for_selector("#state:text-is('running')")
        # On a busy machine the first plan takes its time
        heard = talk(page, enough_ms=800, frames=2)
        hello = heard[0][1]
        assert (hello["kind"], hello["session"]) == ("hello", "default")
        assert hello["subscribed"] == ["frames", "strip", "events"]
        assert 2 <= len(kinds(heard, "frame")) <= most_frames(heard, 20)
        first = kinds(heard, "events")[0]["events"][0]
        assert (first["number"], first["event"], first["seed"]) == (0, "run_began", 1)

        slow = {"action": "subscribe", "channel": "frames", "rate_hz": 4, "id": "slow"}
        quiet = {"action": "unsubscribe", "channel": "strip", "id": 2}
        heard = talk(page, slow, quiet, enough_ms=2000, frames=2)
        answers = {ack["id"]: ack for ack in kinds(heard, "ack")}
        assert answers["slow"]["subscribed"] == ["frames", "strip", "events"]
        assert answers[2]["subscribed"] == ["frames", "events"]
        assert 2 <= len(kinds(heard, "frame")) <= most_frames(heard, 4)
        assert kinds(heard, "lost") == [], "what was not wanted is not lost"

        pause = {"action": "pause", "id": {"mine": 1}}
        step = {"action": "step", "ticks": 300, "wait": True, "id": 7}
        heard = talk(page, pause, step, enough_ms=500)
        paused, stepped = kinds(heard, "ack")
        assert (paused["id"], paused["state"]) == ({"mine": 1}, "paused")
        assert (stepped["id"], stepped["tick"]) == (7, paused["tick"] + 300)
        states = [
            e["state"]
            for m in kinds(heard, "events")
            for e in m["events"]
            if e["event"] == "state"
        ]
        assert states[-1] == "paused"

        wrong = [
            ({"action": "fly", "id": 1}, 400, "unknown_action"),
            ({"action": "step", "ticks": 0, "id": 1}, 400, "wrong_value"),
            (
                {"action": "subscribe", "channel": "frames", "rate_hz": 900, "id": 1},
                400,
                "wrong_body",
            ),
            ({"action": "subscribe", "channel": "gossip", "id": 1}, 400, "wrong_body"),
            ("nonsense", 400, "not_an_object"),
        ]
        for words, status, code in wrong:
            refused = kinds(talk(page, words), "refused")
            assert len(refused) == 1, words
            assert (refused[0]["status"], refused[0]["type"]) == (
                status,
                f"urn:tractrix:{code}",
            )
        talk(page, {"action": "play"})
        playing = talk(page, {"action": "step", "ticks": 1, "id": 1})
        assert kinds(playing, "refused")[0]["type"] == "urn:tractrix:wrong_state"

        events = run.get("/api/v1/events")
        again = run.get(f"/api/v1/events?since={events['next']}")
        assert events["next"] >= 4 and len(again["events"]) <= 2
        frames = run.get("/api/v1/frames")
        assert 1 < len(frames["frames"]) <= 200
        assert len(run.get(f"/api/v1/frames?since={frames['next']}")["frames"]) <= 10
        entities = run.get("/api/v1/entities")
        assert entities["ego"]["speed_m_s"] > 1.0 and len(entities["vehicles"]) > 3
        assert run.finish() == 0
