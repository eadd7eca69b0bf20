"""Logs of real trucks, decoded by the program and by two independent decoders.

cantools reads the DBC that is written from the table of messages; it knows no states and turns
"error" into a number, so it is asked only where a raw value is data. pretty_j1939 gets the same
table and has the states of the standard; it also puts transported messages together.
"""

from __future__ import annotations

import csv
import gzip
import math
import os
import re
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from j1939_peers import annex_of, pgn_of, read_log

cantools = pytest.importorskip("cantools")
describe = pytest.importorskip("pretty_j1939.describe")
bitstring = pytest.importorskip("bitstring")

WORKSPACE = Path(__file__).resolve().parents[2]
LOGS = WORKSPACE / "tests" / "data" / "j1939"
NAMES = [
    "t270_normal",
    "t270_tsc1",
    "t270_address_claim",
    "css_truck_idle",
    "uthp_modern_parked",
]
# Logs and a DBC that may not be redistributed; used where they lie beside the workspace.
BESIDE = [
    path
    for path in (
        WORKSPACE / "../shared/data/j1939_logs",
        WORKSPACE / "../../shared/data/j1939_logs",
    )
    if path.is_dir()
]


@pytest.fixture(scope="session")
def logs() -> dict[str, str]:
    return {
        name: gzip.decompress((LOGS / f"{name}.log.gz").read_bytes()).decode()
        for name in NAMES
    }


@pytest.fixture(scope="session")
def dbc() -> Any:
    """The table of messages, as cantools reads it."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", WORKSPACE / "target"))
    program = target / "release" / "examples" / "dbc"
    if not program.exists():
        pytest.skip(f"{program} does not exist: cargo build --release --examples")
    text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return cantools.database.load_string(text, "dbc")


@pytest.fixture(scope="session")
def definitions() -> dict[tuple[str, int], dict[str, str]]:
    """Rows of the table by message and SPN."""
    with (WORKSPACE / "crates/j1939/table/signals.csv").open() as file:
        return {(row["message"], int(row["spn"])): row for row in csv.DictReader(file)}


def decoded(server: Path, log: str) -> tuple[list[list[str]], str]:
    """Rows and summary of `sim-server decode`."""
    command = [str(server), "decode", "-", "--format", "csv"]
    done = subprocess.run(
        command, check=True, capture_output=True, input=log, text=True
    )
    rows = list(csv.reader(done.stdout.splitlines()))
    assert ",".join(rows[0]) == (
        "time_s,channel,pgn,message,sa,da,signal,unit,value,state"
    )
    return rows[1:], done.stderr


def last_data(length: int, limit: str) -> int:
    """The last raw value that is data (SAE J1939-71, table 1)."""
    if limit:
        return int(limit)
    if length == 1:
        return 1
    if length < 8:
        return (1 << length) - 3
    return (0xFB << length - 8) - 1


def state_of(raw: int, length: int, limit: str) -> str:
    """The state of a raw value, written down again from the standard's table."""
    if raw <= last_data(length, limit):
        return "value"
    if length < 8:
        top = raw - 2**length + 0x100
        return {0xFF: "not available", 0xFE: "error"}.get(top, "reserved")
    return {0xFB: "parameter specific", 0xFE: "error", 0xFF: "not available"}.get(
        raw >> (length - 8), "reserved"
    )


@pytest.mark.parametrize("name", NAMES)
def test_every_signal_of_every_frame_is_what_cantools_says_or_a_state(
    server: Path,
    logs: dict[str, str],
    dbc: Any,
    definitions: dict[tuple[str, int], dict[str, str]],
    name: str,
) -> None:
    messages = {pgn_of(m): m for m in dbc.messages if m.length <= 8}
    single = {str(pgn) for pgn in messages}
    rows = iter([row for row in decoded(server, logs[name])[0] if row[2] in single])
    states: Counter[str] = Counter()
    frames = 0
    for pgn, sa, da, data in read_log(logs[name]):
        message = messages.get(pgn)
        if message is None:
            continue
        frames += 1
        word = int.from_bytes(data, "little")
        values = message.decode(data)
        for signal in message.signals:
            row = next(rows)
            assert row[2:7] == [
                str(pgn),
                message.name,
                str(sa),
                str(da),
                signal.name,
            ]
            raw = word >> signal.start & 2**signal.length - 1
            limit = definitions[message.name, signal.spn]["data_max"]
            state = state_of(raw, signal.length, limit)
            assert row[9] == state, (row, raw)
            states[state] += 1
            if state == "value":
                expected = float(values[signal.name])
                assert math.isclose(
                    float(row[8]), expected, rel_tol=1e-12, abs_tol=1e-12
                ), row
            else:
                assert row[8] == "", row
    assert next(rows, None) is None
    assert frames > 5000
    assert states["value"] > 10 * frames / 4
    assert states["not available"] > frames
    print(f"{name}: {frames} frames, {dict(states)}")


PRETTY_STATES = {
    describe.ERROR_VAL: "error",
    describe.SPECIFIC_VAL: "parameter specific",
    describe.RESERVED_VAL: "reserved",
}


# The last log lost frames. pretty_j1939 has no time limit: it makes one message of the packets of two
# announcements, more than a second apart.
JOINED = {"uthp_modern_parked": 1}


@pytest.mark.parametrize("name", NAMES)
def test_whole_logs_agree_with_pretty_j1939(
    server: Path,
    logs: dict[str, str],
    dbc: Any,
    definitions: dict[tuple[str, int], dict[str, str]],
    tmp_path: Path,
    name: str,
) -> None:
    messages = {pgn_of(m): m for m in dbc.messages}
    single = {str(pgn) for pgn, m in messages.items() if m.length <= 8}
    annex = str(annex_of(dbc, tmp_path))
    describer = describe.get_describer(da_json=annex)
    reader = describer.da_describer
    rows, summary = decoded(server, logs[name])
    ours = iter([row for row in rows if row[2] in single])
    transported = [row for row in rows if row[3] in ("EC1", "RC")]
    transported_values = iter(transported)
    complete = 0

    def compare(row: list[str], pgn: int, bits: Any, signal: Any) -> None:
        value = reader.get_spn_value(
            bits, signal.spn, pgn, is_complete_message=True, validate=False
        )
        if definitions[row[3], signal.spn]["data_max"]:
            # the definition has other states than the width
            return
        if math.isnan(value):
            assert row[9] == "not available", row
        elif value in PRETTY_STATES:
            assert row[9] == PRETTY_STATES[value], row
        else:
            assert row[9] == "value", row
            assert math.isclose(float(row[8]), value, rel_tol=1e-12, abs_tol=1e-12), (
                row,
                value,
            )

    for pgn, sa, da, data in read_log(logs[name]):
        if pgn in (0xEC00, 0xEB00):
            describer(data, 6 << 26 | pgn << 8 | da << 8 | sa)
            for found in describer.transport_messages:
                if not found["is_last_packet"]:
                    continue
                complete += 1
                message = messages.get(found["PGN"])
                if message is None:
                    continue
                bits = bitstring.Bits(bytes=found["data"])
                for signal in message.signals:
                    row = next(transported_values)
                    assert row[6] == signal.name and row[4] == str(found["SA"])
                    if signal.start + signal.length <= len(bits):
                        compare(row, found["PGN"], bits, signal)
                    else:
                        assert row[9] == "not available", row
        elif str(pgn) in single:
            bits = bitstring.Bits(bytes=data)
            for signal in messages[pgn].signals:
                compare(next(ours), pgn, bits, signal)
    assert next(ours, None) is None and next(transported_values, None) is None
    said = re.search(r"(\d+) transported, (\d+) of them broken off", summary)
    assert said is not None, summary
    assert int(said[1]) - int(said[2]) == complete - JOINED.get(name, 0), summary


@pytest.mark.skipif(not BESIDE, reason="a DBC that may not be redistributed")
def test_the_table_is_that_of_another_dbc(dbc: Any) -> None:
    """Bits and steps of a DBC in the bus's own units, made by others from the standard."""
    other = cantools.database.load_file(
        BESIDE[0] / "j1939_truck.dbc", encoding="utf-8", strict=False
    )
    turn = math.tau
    si = {
        "rpm": (turn / 60, 0.0),
        "%": (0.01, 0.0),
        "ppm": (1e-6, 0.0),
        "km/h": (1 / 3.6, 0.0),
        "kPa": (1e3, 0.0),
        "°C": (1.0, 273.15),
        "kg/h": (1 / 3600, 0.0),
        "deg": (turn / 360, 0.0),
        "km": (1e3, 0.0),
        "cm": (1e-2, 0.0),
        "mm": (1e-3, 0.0),
        "min": (60.0, 0.0),
        "h": (3600.0, 0.0),
        "days": (86400.0, 0.0),
        "l": (1e-3, 0.0),
        "l/h": (1e-3 / 3600, 0.0),
        "km/L": (1e6, 0.0),
        "r": (turn, 0.0),
        "km?¹": (1e-3, 0.0),
        "%/rpm": (0.01 * 60 / turn, 0.0),
    }
    theirs = {pgn_of(message): message for message in other.messages}
    compared = 0
    for message in dbc.messages:
        if pgn_of(message) not in theirs:
            continue
        signals = {
            (signal.start, signal.length): signal
            for signal in theirs[pgn_of(message)].signals
        }
        for signal in message.signals:
            if signal.start + signal.length > 64:
                continue  # theirs ends with the first frame
            same = signals[signal.start, signal.length]
            factor, zero = si.get(same.unit or "", (1.0, 0.0))
            scale, offset = same.scale * factor, same.offset * factor + zero
            assert math.isclose(signal.scale, scale, rel_tol=1e-9), signal
            assert math.isclose(signal.offset, offset, rel_tol=1e-9, abs_tol=1e-9), (
                signal
            )
            compared += 1
    assert compared > 580


@pytest.mark.skipif(not BESIDE, reason="a log that may not be redistributed")
def test_a_steering_wheel_that_moves(server: Path) -> None:
    log = (BESIDE[0] / "kw_mx13_2015_idle_steer.log").read_text()
    angles = [
        float(row[8])
        for row in decoded(server, log)[0]
        if row[3] == "VDC2" and row[6] == "steering_wheel_rad" and row[9] == "value"
    ]
    assert len(angles) > 10_000
    assert min(angles) == pytest.approx(-1.22, abs=0.01)
    assert max(angles) == pytest.approx(0.44, abs=0.01)
