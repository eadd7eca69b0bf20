"""Scenarios: what is driven."""

from __future__ import annotations

import json
import os
from typing import Any

from tractrix import _native


def scenarios() -> dict[str, str]:
    """The built-in scenarios: name and what it is for."""
    return dict(_native.scenario_list())


def scenario(name: str | os.PathLike[str]) -> dict[str, Any]:
    """A built-in scenario or a scenario file (`.toml`), to be changed and given to `World`.

    The keys are those of the file, with all defaults filled in:

        jam = tractrix.scenario("dense-15")
        jam["stack"]["set_speed_m_s"] = 18.0
        world = tractrix.World(jam)

    Raises `ValueError` for a name or content that cannot be used, `FileNotFoundError` for a file
    that is not there.
    """
    found: dict[str, Any] = json.loads(_native.scenario_json(os.fspath(name)))
    return found
