"""The command line of a trainer."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from tractrix.train._command import command


@dataclasses.dataclass(frozen=True)
class _Settings:
    scenarios: tuple[str, ...] = ("flat",)
    rounds: int = 3


def test_a_folder_that_holds_a_training_is_refused_unless_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    begun: list[tuple[Any, ...]] = []

    class Training:
        def __init__(self, settings: _Settings, out: Path, **own: Any) -> None:
            begun.append((settings, out, own["resume"]))

        def run(self, until: int | None = None) -> None:
            (tmp_path / "checkpoint.pt").write_bytes(b"trained")

    def train(*options: str) -> None:
        given = ["trainer", "--out", str(tmp_path), "--rounds", "5", *options]
        monkeypatch.setattr("sys.argv", given)
        command("trainer", "Trains.", _Settings, Training)

    train()
    with pytest.raises(SystemExit) as refused:
        train()
    assert refused.value.code == 2
    assert "--resume" in capsys.readouterr().err
    train("--resume", "--scenarios", "a", "b")
    assert begun == [
        (_Settings(rounds=5), tmp_path, False),
        (_Settings(("a", "b"), 5), tmp_path, True),
    ]
