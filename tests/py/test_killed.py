"""A run that is killed loses less than a second: `kill -9` at random times, then `recover`.

`KILLS=20 pytest -s tests/py/test_killed.py` does it so many times and prints what was lost.
"""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import time
import urllib.request
from pathlib import Path

import pytest
from running import running

KILLS = int(os.environ.get("KILLS", "3"))


def ticks_driven(url: str) -> int:
    """The ticks of the run so far, from its metrics."""
    with urllib.request.urlopen(f"{url}/api/v1/metrics", timeout=10) as answer:
        found = re.search(
            r'^tractrix_ticks_total\{session="default"\} (\d+)',
            answer.read().decode(),
            re.MULTILINE,
        )
    assert found is not None
    return int(found.group(1))


@pytest.mark.parametrize("pace", ["realtime", "20"])
def test_a_killed_run_loses_less_than_a_second_of_wall_time(
    server: Path, tmp_path: Path, pace: str
) -> None:
    """In real time that is a second of the run, twenty times as fast it is no more."""
    draws = random.Random(16)
    lost_s: list[float] = []
    for number in range(KILLS):
        folder = tmp_path / str(number)
        with running(server, folder, "--pace", pace) as run:
            time.sleep(draws.uniform(1.2, 4.0))
            driven_s = ticks_driven(run.url) * 0.01
            os.kill(run.process.pid, signal.SIGKILL)
            run.process.wait(timeout=60)
        answer = subprocess.run(
            [server, "recover", folder / "run.mcap", "--json"],
            check=True,
            capture_output=True,
            timeout=60,
        )
        report = json.loads(answer.stdout)
        assert report["was_torn"]
        lost_s.append(driven_s - 0.01 - report["last_message_time_s"])
    print(f"\npace {pace}: lost {sorted(round(s, 2) for s in lost_s)} s of the run")
    assert max(lost_s) < 1.0
