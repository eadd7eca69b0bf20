"""The blueprint for Rerun names what a recording has, and Rerun takes it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import tractrix
from program import sim_server
from tractrix import _rerun


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of two simulated seconds."""
    folder = tmp_path_factory.mktemp("run")
    sim_server("run", "--headless", "--duration", "2", "--out", folder)
    return folder / "run.mcap"


def test_its_curves_are_fields_of_the_recording(recording: Path) -> None:
    pytest.importorskip("pandas")
    for curves in _rerun.CURVES.values():
        assert len(curves) <= len(_rerun.COLORS)
        for topic, field, _ in curves:
            assert field in tractrix.read_run(recording, topic), f"{topic}.{field}"


def test_rerun_takes_the_blueprint_and_has_its_sources(
    recording: Path, tmp_path: Path
) -> None:
    reason = "rerun-sdk is not installed (490 MB): pip install 'tractrix[rerun]'"
    pytest.importorskip("rerun", reason=reason)
    blueprint = tmp_path / "truck.rbl"
    tractrix.rerun_blueprint().save("tractrix", blueprint)
    program = Path(sys.executable).with_name("rerun")

    def rerun(*arguments: str | Path) -> str:
        done = subprocess.run(
            [program, *arguments], check=True, capture_output=True, timeout=120
        )
        return done.stdout.decode()

    rerun("rrd", "verify", blueprint)
    shown = rerun("rrd", "print", "-vvv", blueprint)
    converted = tmp_path / "run.rrd"
    rerun("mcap", "convert", recording, "-o", converted)
    there = rerun("rrd", "print", converted)
    for name, curves in _rerun.CURVES.items():
        assert name in shown
        for topic, _, _ in curves:
            assert f"{_rerun.TYPES[topic]}:message" in there
