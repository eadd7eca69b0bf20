"""Logs of a bus in every container become the same drives."""

from __future__ import annotations

import functools
import gzip
import importlib.util
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import tractrix

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "own_truck"
LINE = re.compile(r"\((\d+\.\d+)\) (\S+) ([0-9A-F]{8})#([0-9A-F]*)")
HOW: dict[str, Any] = {"truck": "reference", "mass_kg": 28_700, "min_drive_s": 60}


def have(*modules: str) -> bool:
    return all(importlib.util.find_spec(module) for module in modules)


needs_can = pytest.mark.skipif(not have("can"), reason="python-can is not installed")


def lines() -> Iterator[str]:
    with gzip.open(EXAMPLES / "friday.log.gz", "rt") as log:
        yield from log


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The example log in a container, which takes ten seconds to be written as MF4."""
    folder = tmp_path_factory.mktemp("written")
    return functools.cache(lambda container: write(folder / f"friday{container}"))


def write(to: Path) -> Path:
    """The example log by python-can, in the container that the name says."""
    import can

    # asammdf and Vector's containers take times since a start in the years in which there are logs
    with can.Logger(to) as out:
        for line in lines():
            found = LINE.match(line)
            assert found, line
            time_s, _, identifier, data = found.groups()
            message = can.Message(
                timestamp=float(time_s),
                arbitration_id=int(identifier, 16),
                is_extended_id=True,
                data=bytes.fromhex(data),
                channel=0,
            )
            out(message)
    return to


def tables(folder: Path) -> dict[str, list[str]]:
    return {
        file.name: file.read_text().splitlines()
        for file in sorted(folder.glob("friday*.csv"))
    }


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """The drives of the log itself."""
    folder = tmp_path_factory.mktemp("candump")
    found = tractrix.drives.from_log(EXAMPLES / "friday.log.gz", out=folder, **HOW)
    speed = next(c for c in found["logs"][0]["columns"] if c["column"] == "speed_m_s")
    assert speed["signal"] == "HRW rear wheels"
    assert found["logs"][0]["mass_kg"] == 28_700
    made = tables(folder)
    assert len(made["friday_1.csv"]) > 5_000
    return made


@needs_can
@pytest.mark.parametrize("container", [".asc", ".blf", ".mf4", ".trc"])
def test_every_container_gives_the_same_drives(
    container: str,
    tmp_path: Path,
    expected: dict[str, list[str]],
    written: Callable[[str], Path],
) -> None:
    if container == ".mf4" and not have("asammdf"):
        pytest.skip("asammdf is not installed")
    tractrix.drives.from_log(written(container), out=tmp_path / "drives", **HOW)
    made = tables(tmp_path / "drives")
    assert made.keys() == expected.keys()
    for name, rows in expected.items():
        assert len(made[name]) == len(rows)
        others = sum(a != b for a, b in zip(made[name], rows, strict=True))
        # TRC has tenths of a millisecond: a value may come a row later
        assert others <= (len(rows) // 2 if container == ".trc" else 0), (
            f"{others} rows"
        )


@needs_can
@pytest.mark.parametrize("container", [".asc", ".blf", ".mf4", ".trc"])
def test_a_container_that_is_empty_torn_or_something_else_gets_one_line(
    container: str, tmp_path: Path, written: Callable[[str], Path]
) -> None:
    if container == ".mf4" and not have("asammdf"):
        pytest.skip("asammdf is not installed")
    whole = written(container).read_bytes()
    cases = {
        "empty": b"",
        "noise": bytes(range(256)) * 40,
        "torn": whole[: len(whole) // 1000],
    }
    for name, content in cases.items():
        log = tmp_path / f"{name}{container}"
        log.write_bytes(content)
        with pytest.raises(ValueError) as error:
            tractrix.drives.from_log(log, out=tmp_path / "drives", **HOW)
        text = str(error.value)
        assert f"{name}{container}" in text and "\n" not in text, text
    assert not (tmp_path / "drives").exists()


def test_what_cannot_be_converted_is_named(tmp_path: Path) -> None:
    log = EXAMPLES / "friday.log.gz"
    cases: list[tuple[type[Exception], str, dict[str, Any]]] = [
        (FileNotFoundError, "nowhere", {"logs": "nowhere.log"}),
        (ValueError, "2 masses for 1", {"mass_kg": [1.0, 2.0]}),
        (ValueError, "mass_kg = -3", {"mass_kg": -3}),
        (ValueError, "scania", {"truck": "scania"}),
        (ValueError, "they are those of a dbc", {"signals": {"speed_m_s": "Speed"}}),
        (FileNotFoundError, "nowhere", {"dbc": "nowhere.dbc"}),
        (ValueError, "two logs are named friday", {"logs": [log, log]}),
    ]
    for kind, named, change in cases:
        arguments: dict[str, Any] = (
            {"logs": log, "out": tmp_path / "drives"} | HOW | change
        )
        with pytest.raises(kind, match=named):
            tractrix.drives.from_log(**arguments)
    tractrix.drives.from_log(log, out=tmp_path / "drives", **HOW)
    with pytest.raises(ValueError, match="overwrite"):
        tractrix.drives.from_log(log, out=tmp_path / "drives", **HOW)


def test_without_python_can_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "can", None)
    log = tmp_path / "a.blf"
    log.write_bytes(b"LOGG")
    with pytest.raises(ImportError, match=r"tractrix\[logs\]"):
        tractrix.drives.from_log(log, out=tmp_path / "drives", **HOW)
