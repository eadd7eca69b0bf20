"""Recordings of the program as tables."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import tractrix
from program import sim_server


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run of five simulated seconds."""
    pytest.importorskip("pandas")
    folder = tmp_path_factory.mktemp("run")
    sim_server("run", "dense-15", "--headless", "--duration", "5", "--out", folder)
    return folder


def test_a_recording_is_the_run(run: Path) -> None:
    states = tractrix.read_run(run / "run.mcap")
    world = tractrix.World("dense-15", duration_s=5)
    for row in range(0, 500, 50):
        world.step(1 if row == 0 else 50)
        seen, ego = states.iloc[row], world.ego
        assert states.index[row] == pytest.approx(ego.time_s)
        for name in ("s_m", "d_m", "speed_m_s", "engine_speed_rpm", "gear"):
            assert seen[name] == getattr(ego, name), name
    summary = json.loads((run / "summary.json").read_text())
    driven_m = states["s_m"].iloc[-1] - states["s_m"].iloc[0]
    assert (len(states), driven_m) == (500, pytest.approx(summary["distance_m"]))
    plans = tractrix.read_run(run / "run.mcap", "/truck/plan")
    assert set(plans["maneuver"]) <= {"keep_lane", "change_left", "change_right"}


def test_every_topic_of_a_recording_is_read(tmp_path: Path) -> None:
    """That the file has every topic is `sim-server`'s own test, `every_topic`."""
    pytest.importorskip("pandas")
    from mcap.reader import make_reader

    options = ("--headless", "--vehicle", "bus", "--duration", "2")
    sim_server("run", *options, "--out", tmp_path)
    with (tmp_path / "run.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None and summary.statistics is not None
    counts = summary.statistics.channel_message_counts
    assert len(summary.channels) > 10
    for channel in summary.channels.values():
        rows = tractrix.read_run(tmp_path / "run.mcap", channel.topic)
        assert len(rows) == counts.get(channel.id, 0), channel.topic


def test_what_is_no_recording_is_named(run: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        tractrix.read_run("nowhere.mcap")
    with pytest.raises(ValueError, match="no topic /moon; there are .*/truck/state"):
        tractrix.read_run(run / "run.mcap", "/moon")
    torn = tmp_path / "torn.mcap"
    torn.write_bytes((run / "run.mcap").read_bytes()[:20_000])
    with pytest.raises(ValueError, match=r"torn\.mcap"):
        tractrix.read_run(torn)
    torn.write_text("not a recording")
    with pytest.raises(ValueError, match=r"torn\.mcap"):
        tractrix.read_run(torn)
