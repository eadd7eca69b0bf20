"""What the simulation gets wrong on measured drives, and why."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

from tractrix import _native
from tractrix._arguments import path, whole


def diagnose(
    truck: str | os.PathLike[str],
    drives: str | os.PathLike[str],
    *,
    baseline: str | os.PathLike[str] | None = None,
    hold_out: Sequence[str] = (),
    table_effect: bool = False,
    seed: int = 1,
    out: str | os.PathLike[str] | None = None,
) -> dict[str, Any]:
    """Names what the simulation gets wrong on measured drives, as `sim-server diagnose`.

    Args:
        truck: The truck file that the simulation uses, or a built-in name.
        drives: Folder of measured drives: `drives.toml` and one table per drive.
        baseline: Drives of the same truck and logger that are in order: noise and
            tolerances are learned from them.
        hold_out: Names of drives on which the gain is measured. Default: the last
            quarter, if there are four.
        table_effect: Adds what is left without a name to the extended truck, as a table
            over the signal that it follows, if that helps on every drive held out.
        seed: Seed of the intervals of the gain.
        out: Folder for `diagnosis.json` and the extended truck file.

    Returns:
        The contents of `diagnosis.json`: `verdict`, `causes` in order of evidence,
        `gain`, ...

    Raises:
        ValueError: Drives or a truck that cannot be used; the text names the key, column
            or value.
        FileNotFoundError: A folder or file that is not there.

    The work runs on all cores; other Python threads go on.
    """
    if isinstance(hold_out, str):
        raise TypeError("hold_out is a sequence of names, not one text")
    found: dict[str, Any] = json.loads(
        _native.diagnose_json(
            os.fspath(truck),
            os.fspath(drives),
            baseline=path(baseline),
            hold_out=list(hold_out),
            table_effect=bool(table_effect),
            seed=whole("seed", seed),
            out=path(out),
        )
    )
    return found
