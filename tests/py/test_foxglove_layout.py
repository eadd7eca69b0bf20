"""The layout for Foxglove and Lichtblick names what a recording has."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from conftest import WORKSPACE
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

LAYOUT = json.loads((WORKSPACE / "docs" / "foxglove-layout.json").read_text())
PANELS = {
    "3D",
    "CallService",
    "DiagnosticSummary",
    "Plot",
    "Publish",
    "StateTransitions",
    "map",
}
# As the program has them: `foxglove_live/commands.rs`; `tests/foxglove` calls them.
SERVICES = {"/play", "/pause", "/step", "/reset"}


def panels(at: Any) -> list[str]:
    """The panels of a part of the layout."""
    if isinstance(at, str):
        return [at]
    assert at["direction"] in {"row", "column"} and 0 < at["splitPercentage"] < 100
    return panels(at["first"]) + panels(at["second"])


def test_every_panel_is_placed_once_and_has_its_settings() -> None:
    placed = panels(LAYOUT["layout"])
    assert sorted(placed) == sorted(LAYOUT["configById"])
    assert {panel.split("!")[0] for panel in placed} == PANELS


def test_what_the_panels_show_is_in_a_recording(short_run: Path) -> None:
    shown: dict[str, set[str]] = {}
    for panel, settings in LAYOUT["configById"].items():
        paths = [path["value"] for path in settings.get("paths", [])]
        for topic, _, name in (path.partition(".") for path in paths):
            shown.setdefault(topic, set()).add(name)
        topics = [*settings.get("topics", {}), settings.get("topicToRender")]
        topics.append(settings.get("followTopic"))
        for topic in filter(None, topics):
            shown.setdefault(topic, set())
        if panel.startswith("CallService"):
            assert settings["serviceName"] in SERVICES
            json.loads(settings["requestPayload"])
        if panel.startswith("3D"):
            assert settings["followTf"] == "base_link"
    assert len(shown) >= 6
    with (short_run / "run.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        seen: dict[str, Any] = {}
        for _, channel, _, message in reader.iter_decoded_messages():
            seen.setdefault(channel.topic, message)
    for topic, names in shown.items():
        assert topic in seen
        for name in names:
            assert hasattr(seen[topic], name), f"{topic}.{name}"
