"""The diagnosis of drives, as the program has it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import tractrix
from program import sim_server

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DRIVES, BASELINE = EXAMPLES / "drives", EXAMPLES / "baseline"


def test_drives_are_diagnosed_as_by_the_program(tmp_path: Path) -> None:
    example = tmp_path / "program"
    which: list[str | Path] = ["--drives", DRIVES, "--baseline", BASELINE]
    options = ["--truck", "reference", "--seed", "2", "--out"]
    sim_server("diagnose", *options, example, *which)
    expected = json.loads((example / "diagnosis.json").read_text())
    out = tmp_path / "package"
    found = tractrix.diagnose("reference", DRIVES, baseline=BASELINE, seed=2, out=out)
    assert found["causes"][0]["id"] == "air_drag", "what the tutorial's drives hide"
    # the two may have been built at different revisions
    for one in (found, expected):
        assert one.pop("git_revision")
    assert found == expected
    extended = expected["extended_truck"]
    assert (out / extended).read_text() == (example / extended).read_text()
    assert json.loads((out / "diagnosis.json").read_text())["seed"] == 2
    truck = out / extended
    assert tractrix.World("flat", truck=truck, duration_s=1).run()["distance_m"] > 0.0


def test_what_cannot_be_diagnosed_is_named(tmp_path: Path) -> None:
    cases: list[tuple[type[Exception], str | None, dict[str, Any]]] = [
        (ValueError, "scania", {"truck": "scania"}),
        (FileNotFoundError, "nowhere", {"truck": "nowhere/truck.toml"}),
        (FileNotFoundError, "nowhere", {"drives": "nowhere"}),
        (FileNotFoundError, r"drives\.toml", {"drives": tmp_path}),
        (FileNotFoundError, "nowhere", {"baseline": "nowhere"}),
        (ValueError, "drive_99", {"hold_out": ["drive_99"]}),
        (ValueError, "seed = -1", {"seed": -1}),
        (TypeError, "sequence of names", {"hold_out": "drive_1"}),
        (TypeError, None, {"hold_out": [1]}),
        (TypeError, None, {"drives": 3}),
    ]
    for kind, named, change in cases:
        arguments: dict[str, Any] = {"truck": "reference", "drives": DRIVES} | change
        with pytest.raises(kind, match=named):
            tractrix.diagnose(**arguments)
