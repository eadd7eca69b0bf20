"""Measured drives out of logs of a truck's bus."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractrix import _native
from tractrix._arguments import path as as_text

if TYPE_CHECKING:
    import can

CONTAINERS = (".asc", ".blf", ".trc", ".mf4")
"""Ends of the names of logs that are read through python-can (MF4 also through asammdf)."""


def from_log(
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    truck: str | os.PathLike[str],
    out: str | os.PathLike[str],
    map: str | os.PathLike[str] | None = None,
    start_s_m: float | None = None,
    mass_kg: float | Sequence[float] | None = None,
    dbc: str | os.PathLike[str] | None = None,
    signals: Mapping[str, str] | None = None,
    standstill_s: float = 120.0,
    min_drive_s: float = 60.0,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Makes drives of logs of a truck's bus, as `sim-server drives from-can`.

    Args:
        logs: Logs of candump (`.log`, `.log.gz`), or in a container of another tool: Vector
            ASC and BLF, PEAK TRC, ASAM MF4 (raw CAN frames, not decoded signals).
        truck: The truck that was logged: a truck file, or a built-in name.
        out: Folder for the drives, `drives.toml` and `conversion.json`.
        map: The road that was driven.
        start_s_m: Station of the road where the first drive of every log begins, m; without
            it satellite fixes (VP1) say where on the road a drive is.
        mass_kg: Mass on the load sheet, kg: one for all logs, or one for each. Default: what
            the bus says (CVW).
        dbc: What the truck's maker sends beyond the standard.
        signals: Column to signal of the DBC, `SIGNAL` or `MESSAGE.SIGNAL`, with `-` before it
            the sign is turned. Signals with a column's name, or with the number (SPN) of
            what it holds, are found without.
        standstill_s: A standstill of so long ends a drive, s.
        min_drive_s: Shorter drives are left out, s.
        overwrite: Replaces drives that are in `out`.

    Returns:
        The contents of `conversion.json`: for each log what fills each column, who else has
        it, what is missing and why, the drives, what was left out.

    Times are taken to the microsecond. TRC has tenths of a millisecond, so drives made of it
    differ where a value changed within that of a row.

    Raises:
        ValueError: A log, truck, map or DBC that cannot be used; one line that names it.
        FileNotFoundError: A file that is not there.
        ImportError: A container that needs python-can or asammdf
            (`pip install "tractrix[logs]"`).
    """
    given = [logs] if isinstance(logs, str | os.PathLike) else list(logs)
    paths = [Path(log) for log in given]
    masses = _masses(mass_kg, len(paths))
    with tempfile.TemporaryDirectory(prefix="tractrix-") as folder:
        readable = []
        for number, log in enumerate(paths):
            if log.suffix.lower() in CONTAINERS:
                text = Path(folder) / f"{number}.log"
                _as_candump(log, text)
                readable.append(text)
            else:
                readable.append(log)
        found: dict[str, Any] = json.loads(
            _native.drives_from_logs(
                [os.fspath(p) for p in readable],
                [os.fspath(p) for p in paths],
                masses,
                truck=os.fspath(truck),
                out=os.fspath(out),
                map=as_text(map),
                start_s_m=start_s_m,
                dbc=as_text(dbc),
                signals=[
                    f"{column}={name}" for column, name in (signals or {}).items()
                ],
                standstill_s=float(standstill_s),
                min_drive_s=float(min_drive_s),
                overwrite=bool(overwrite),
            )
        )
    return found


def _masses(mass_kg: float | Sequence[float] | None, logs: int) -> list[float | None]:
    if mass_kg is None:
        return [None] * logs
    if isinstance(mass_kg, int | float):
        return [float(mass_kg)] * logs
    masses = [float(m) for m in mass_kg]
    if len(masses) != logs:
        raise ValueError(f"mass_kg: {len(masses)} masses for {logs} logs")
    return list(masses)


def _as_candump(log: Path, to: Path) -> None:
    """Writes the frames of a container as lines of candump; only frames of classic CAN."""
    try:
        with to.open("w", encoding="ascii") as lines:
            for message in _messages(log):
                lines.write(_line(message))
    except (OSError, ImportError):
        raise
    except Exception as error:  # the readers raise whatever their parsers meet
        words = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{log}: {words}") from error


def _messages(log: Path) -> Iterator[can.Message]:
    """The frames of a container, in its order."""
    try:
        import can

        if log.suffix.lower() == ".mf4":
            import asammdf  # noqa: F401
    except ImportError as missing:
        hint = f'{log}: {log.suffix} is read with: pip install "tractrix[logs]"'
        raise ImportError(hint) from missing
    if not log.is_file():
        raise FileNotFoundError(f"{log}: no such file")
    if log.stat().st_size == 0:
        raise ValueError("the file is empty")
    with can.LogReader(log) as frames:
        yield from frames


def _line(message: can.Message) -> str:
    """A frame as a line of `candump -L`."""
    channel = message.channel if message.channel is not None else 0
    name = str(channel).replace(" ", "_")
    if isinstance(channel, int):
        name = f"can{channel}"
    if message.is_fd or message.is_error_frame:
        return ""
    identifier = (
        f"{message.arbitration_id:08X}"
        if message.is_extended_id
        else f"{message.arbitration_id:03X}"
    )
    content = "R" if message.is_remote_frame else bytes(message.data).hex().upper()
    return f"({max(message.timestamp, 0.0):.6f}) {name} {identifier}#{content}\n"
