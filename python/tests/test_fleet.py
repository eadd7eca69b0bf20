"""A fleet's diagnoses: resumed, the same however they are computed."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import signal
import threading
import time
from pathlib import Path

import pytest
import tractrix

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
WAIT_S = 300.0

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("pyarrow") is None, reason="pyarrow is not installed"
)


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    """Two trucks, one with a week in order and one in which something is wrong, one with a week
    that cannot be read."""
    root = tmp_path / "fleet"
    shutil.copytree(EXAMPLES / "baseline", root / "kite" / "2026-w40")
    shutil.copytree(EXAMPLES / "drives", root / "kite" / "2026-w41")
    shutil.copytree(EXAMPLES / "baseline", root / "kite" / "baseline")
    shutil.copytree(EXAMPLES / "drives", root / "merlin" / "2026-w40")
    for torn in (root / "merlin" / "2026-w40").glob("*.parquet"):
        torn.write_bytes(torn.read_bytes()[:500])
    return root


def results(out: Path) -> dict[str, str]:
    units = out / "units"
    return {
        str(p.relative_to(units)): p.read_text() for p in sorted(units.rglob("*.json"))
    }


def workers() -> list[int]:
    """Processes that this one has started to compute a week."""
    found = [p.read_text() for p in Path("/proc/self/task").glob("*/children")]
    pids = [int(pid) for words in found for pid in words.split()]
    return [
        p for p in pids if b"tractrix._fleet" in Path(f"/proc/{p}/cmdline").read_bytes()
    ]


def test_a_killed_worker_loses_nothing_and_a_second_call_computes_nothing(
    fleet: Path, tmp_path: Path
) -> None:
    from pyarrow import parquet

    whole = tractrix.diagnose_many(
        fleet, truck="reference", out=tmp_path / "two", processes=2
    )
    by_week = {(r["truck"], r["week"]): r for r in whole}
    assert by_week["kite", "2026-w40"]["verdict"] == "nothing_to_explain"
    assert by_week["kite", "2026-w41"]["cause"]
    assert "parquet" in by_week["merlin", "2026-w40"]["error"]
    table = parquet.read_table(tmp_path / "two" / "causes.parquet").to_pylist()
    assert table == whole
    page = (tmp_path / "two" / "summary.html").read_text()
    assert "2 trucks, 2 weeks" in page and "<svg" in page and "http" not in page

    killed: list[int] = []

    def kill_one() -> None:
        end = time.monotonic() + WAIT_S
        while not killed and time.monotonic() < end:
            for child in workers():
                os.kill(child, signal.SIGKILL)
                killed.append(child)
                return
            time.sleep(0.01)

    killer = threading.Thread(target=kill_one)
    killer.start()
    again = tractrix.diagnose_many(
        fleet, truck="reference", out=tmp_path / "one", processes=1
    )
    killer.join()
    assert killed, "a worker was killed"
    assert again == whole
    assert results(tmp_path / "one") == results(tmp_path / "two")

    # finished weeks are kept, one that is gone or of other inputs is computed again
    marks = {p: p.stat().st_mtime_ns for p in (tmp_path / "one").rglob("*.json")}
    gone = tmp_path / "one" / "units" / "merlin" / "2026-w40.json"
    gone.unlink()
    assert (
        tractrix.diagnose_many(fleet, truck="reference", out=tmp_path / "one") == whole
    )
    assert gone.exists()
    assert all(p.stat().st_mtime_ns == mark for p, mark in marks.items() if p != gone)
    result = json.loads(gone.read_text())
    gone.write_text(json.dumps(result | {"inputs_sha256": "of other drives"}))
    assert (
        tractrix.diagnose_many(fleet, truck="reference", out=tmp_path / "one") == whole
    )
    assert json.loads(gone.read_text()) == result


def test_what_is_no_fleet_is_named(fleet: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"TRUCK/WEEK/drives\.toml"):
        tractrix.diagnose_many(
            tmp_path / "fleet" / "kite", truck="reference", out=tmp_path
        )
    with pytest.raises(ValueError, match=r"kite/truck\.toml: no such file"):
        tractrix.diagnose_many(fleet, out=tmp_path / "none")
    with pytest.raises(FileNotFoundError):
        tractrix.diagnose_many(tmp_path / "nowhere", truck="reference", out=tmp_path)
    with pytest.raises(ValueError, match="processes = 0"):
        tractrix.diagnose_many(
            fleet, truck="reference", out=tmp_path / "none", processes=0
        )


@pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="ray is not installed"
)
def test_ray_gives_the_same(fleet: Path, tmp_path: Path) -> None:
    here = tractrix.diagnose_many(fleet, truck="reference", out=tmp_path / "here")
    there = tractrix.diagnose_many(
        fleet, truck="reference", out=tmp_path / "there", ray=True
    )
    assert here == there
    assert results(tmp_path / "here") == results(tmp_path / "there")
