"""Logs and the table of messages in the forms that independent decoders take."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Frame = tuple[int, int, int, bytes]
"""PGN, source, destination and bytes."""


def read_log(text: str) -> Iterator[Frame]:
    """The frames with 29-bit identifiers, in their order."""
    for line in text.splitlines():
        identifier, data = line.split()[2].split("#")
        if len(identifier) != 8:
            continue
        raw = int(identifier, 16)
        pgn, specific = raw >> 8 & 0x3FF00, raw >> 8 & 0xFF
        if pgn >> 8 & 0xFF >= 240:
            pgn, specific = pgn | specific, 0xFF
        yield pgn, raw & 0xFF, specific, bytes.fromhex(data)


def pgn_of(message: Any) -> int:
    pgn = int(message.frame_id) >> 8 & 0x3FFFF
    return pgn & 0x3FF00 if pgn >> 8 & 0xFF < 240 else pgn


def annex_of(dbc: Any, folder: Path) -> Path:
    """The table as the digital annex that pretty_j1939 reads."""
    groups: dict[str, Any] = {}
    parameters: dict[str, Any] = {}
    for message in dbc.messages:
        groups[str(pgn_of(message))] = {
            "Label": message.name,
            "Name": message.name,
            "SPNs": [signal.spn for signal in message.signals],
            "SPNStartBits": [signal.start for signal in message.signals],
        }
        for signal in message.signals:
            parameters[str(signal.spn)] = {
                "Name": signal.name,
                "Resolution": signal.scale,
                "Offset": signal.offset,
                "Units": signal.unit or "count",
                "SPNLength": signal.length,
                "OperationalLow": -math.inf,
                "OperationalHigh": math.inf,
            }
    annex = {
        "J1939PGNdb": groups,
        "J1939SPNdb": parameters,
        "J1939SATabledb": {},
        "J1939BitDecodings": {},
    }
    path = folder / "annex.json"
    path.write_text(json.dumps(annex))
    return path
