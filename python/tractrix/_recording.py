"""Recordings of runs as tables."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


def read_run(file: str | os.PathLike[str], topic: str = "/truck/state") -> pd.DataFrame:
    """One row per tick of a recording (`run.mcap` of `sim-server run`).

    Args:
        file: The recording.
        topic: `/truck/state` (the truck and its command) or `/truck/plan` (the stack's
            decision); of other topics the fields that are numbers or words.

    Returns:
        A `pandas.DataFrame` over `time_s`, simulated seconds; the columns are the
        message's fields, with their units in their names.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is no whole recording (`sim-server recover` mends one that a crash
            has torn), or has no such topic.
        ImportError: `mcap`, `mcap-ros2-support` or pandas is missing
            (`pip install "tractrix[recordings]"`).
    """
    try:
        import pandas as pd
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory
    except ImportError as missing:
        hint = 'recordings are read with: pip install "tractrix[recordings]"'
        raise ImportError(hint) from missing
    path = Path(file)
    times_s: list[float] = []
    rows: list[dict[str, Any]] = []
    with path.open("rb") as source:
        try:
            reader = make_reader(source, decoder_factories=[DecoderFactory()])
            summary = reader.get_summary()
            topics = {c.topic for c in summary.channels.values()} if summary else set()
            if topic not in topics:
                known = ", ".join(sorted(topics))
                raise ValueError(f"{path}: no topic {topic}; there are {known}")
            for found in reader.iter_decoded_messages(topics=[topic]):
                times_s.append(found.message.log_time * 1e-9)
                rows.append(_scalars(found.decoded_message))
        except McapError as error:
            raise ValueError(f"{path}: no whole recording: {error}") from error
    return pd.DataFrame(rows, index=pd.Index(times_s, name="time_s"))


def _scalars(message: Any) -> dict[str, Any]:
    """The fields of a message that are numbers or words."""
    fields = {name: getattr(message, name) for name in message.__slots__}
    return {k: v for k, v in fields.items() if isinstance(v, bool | int | float | str)}
