"""The program `sim-server`, whose results the package's are compared with."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

WORKSPACE = Path(__file__).resolve().parents[2]


def program() -> Path:
    """Where it is; tests are skipped where it has not been built."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", WORKSPACE / "target"))
    found = target / "release" / "sim-server"
    if not found.exists():
        pytest.skip(f"{found} does not exist: cargo build --release -p sim-server")
    return found


def sim_server(*arguments: str | Path) -> str:
    """Its output."""
    run = subprocess.run(
        [program(), *arguments], check=True, capture_output=True, text=True, timeout=300
    )
    return run.stdout
