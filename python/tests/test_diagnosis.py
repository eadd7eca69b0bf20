"""The diagnosis of drives, as the program has it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import tractrix
from program import sim_server


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Drives of a truck with a hidden effect, and what the program says of them."""
    folder = tmp_path_factory.mktemp("example")
    sim_server("diagnose", "--example", "--seed", "2", "--out", folder)
    return folder


def test_drives_are_diagnosed_as_by_the_program(example: Path, tmp_path: Path) -> None:
    expected = json.loads((example / "diagnosis.json").read_text())
    hidden = expected.pop("hidden")
    found = tractrix.diagnose(
        "reference",
        example / "drives",
        baseline=example / "baseline",
        seed=2,
        out=tmp_path,
    )
    assert found["causes"][0]["id"] == hidden["id"]
    # the two may have been built at different revisions
    for one in (found, expected):
        assert one.pop("git_revision")
    assert found == expected
    extended = expected["extended_truck"]
    assert (tmp_path / extended).read_text() == (example / extended).read_text()
    assert json.loads((tmp_path / "diagnosis.json").read_text())["seed"] == 2
    truck = tmp_path / extended
    assert tractrix.World("flat", truck=truck, duration_s=1).run()["distance_m"] > 0.0


def test_what_cannot_be_diagnosed_is_named(example: Path, tmp_path: Path) -> None:
    drives = example / "drives"
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
        arguments: dict[str, Any] = {"truck": "reference", "drives": drives} | change
        with pytest.raises(kind, match=named):
            tractrix.diagnose(**arguments)
