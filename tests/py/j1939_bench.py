"""Time of a frame in cantools and pretty_j1939, to set beside `cargo bench -p tractrix-j1939`.

.venv/bin/python tests/py/j1939_bench.py tractrix.dbc tests/data/j1939/t270_normal.log.gz

The DBC is what `cargo run --release -p tractrix-j1939 --example dbc` prints. Both decode the single
frames of its messages to values in SI; pretty_j1939 does so signal by signal, without its text.
"""

from __future__ import annotations

import gzip
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bitstring
import cantools
from j1939_peers import annex_of, pgn_of, read_log
from pretty_j1939 import describe

REPEATS = 3


def report(name: str, frames: int, run: Callable[[], None]) -> None:
    """The shortest of some repeats: the least of what else the machine did."""
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    print(f"{name}: {min(seconds) / frames * 1e6:.2f} us a frame")


def main(dbc: str, log: str) -> None:
    database: Any = cantools.database.load_file(dbc, encoding="utf-8")
    known = {pgn_of(message): message for message in database.messages}
    text = gzip.decompress(Path(log).read_bytes()).decode()
    frames = [
        (pgn, data)
        for pgn, _, _, data in read_log(text)
        if pgn in known and known[pgn].length <= 8
    ]
    with tempfile.TemporaryDirectory() as folder:
        annex = str(annex_of(database, Path(folder)))
        describer = describe.get_describer(da_json=annex).da_describer

    def with_cantools() -> None:
        for pgn, data in frames:
            known[pgn].decode(data)

    def with_pretty_j1939() -> None:
        for pgn, data in frames:
            bits = bitstring.Bits(bytes=data)
            for signal in known[pgn].signals:
                describer.get_spn_value(bits, signal.spn, pgn, True, validate=False)

    print(f"{len(frames)} frames of {log}")
    report("cantools", len(frames), with_cantools)
    report("pretty_j1939", len(frames), with_pretty_j1939)


if __name__ == "__main__":
    main(*sys.argv[1:])
