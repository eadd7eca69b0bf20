"""The dashboard in a real browser: it loads, the truck moves, the plots fill, the controls work."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
WAIT_MS = 30_000


class Run:
    """A run under way and the address of its dashboard."""

    def __init__(self, process: subprocess.Popen[str], url: str) -> None:
        self.process = process
        self.url = url

    def get(self, path: str) -> Any:
        """A JSON answer of the API."""
        with urllib.request.urlopen(self.url + path, timeout=10) as answer:
            return json.load(answer)

    def finish(self) -> int:
        """Stops the run as Ctrl-C does and waits for it."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout=60)


@contextmanager
def running(server: Path, folder: Path, *options: str) -> Iterator[Run]:
    """Starts a run with a dashboard on a free port."""
    command: list[str | Path] = [
        server,
        "run",
        "--port",
        "0",
        "--out",
        folder,
        *options,
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            line = process.stderr.readline()
            address = re.search(r"http://127\.0\.0\.1:\d+", line)
            assert address is not None, line
            yield Run(process, address.group())
        finally:
            process.kill()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Headless Chromium; tests are skipped where there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no chromium")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page that fails the test on any error of a script, the console or a request."""
    tab = browser.new_page(viewport={"width": 1440, "height": 960})
    tab.set_default_timeout(WAIT_MS)
    wrong: list[str] = []
    tab.on(
        "console",
        lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None,
    )
    tab.on("pageerror", lambda e: wrong.append(str(e)))
    tab.on("requestfailed", lambda r: wrong.append(r.url))
    yield tab
    tab.close()
    assert wrong == []


def shown(page: Page, element: str) -> float:
    """The number in a tile."""
    return float(page.inner_text(f"#{element}").replace("−", "-"))


def clock_s(page: Page) -> float:
    """The simulated time in the header, s."""
    minutes, seconds = page.inner_text("#time").split(":")
    return 60.0 * float(minutes) + float(seconds)


def test_the_truck_moves_and_the_plots_fill(
    server: Path, page: Page, tmp_path: Path
) -> None:
    with running(server, tmp_path, "--pace", "20") as run:
        page.goto(run.url)
        page.wait_for_function(
            "document.getElementById('state').textContent === 'running'"
        )
        start_km, before = shown(page, "station"), page.locator("#view").screenshot()
        page.wait_for_function(
            "document.querySelectorAll('#strips .scatterlayer .trace').length === 7"
        )
        page.wait_for_function(
            "document.getElementById('strips').data?.find(t => t.name === 'speed').x.length > 150"
        )
        assert shown(page, "station") > start_km + 1.0
        assert 20.0 < shown(page, "speed") < 95.0
        assert page.locator("#view").screenshot() != before
        traces = page.evaluate(
            "Object.fromEntries(document.getElementById('strips').data.map(t => [t.name, t.y]))"
        )
        assert traces["fuel"] == sorted(traces["fuel"]) and traces["fuel"][-1] > 0.1
        assert min(traces["speed"]) > 20.0 and max(traces["gear"]) == 12
        picture = Path(os.environ.get("DASHBOARD_PICTURE", tmp_path / "dashboard.png"))
        page.screenshot(path=picture)
        assert picture.stat().st_size > 30_000
        state = run.get("/api/v1/state")
        assert state["schema"] == 1 and state["run"]["state"] == "running"
        assert run.finish() == 0
        page.wait_for_function(
            "document.getElementById('state').textContent === 'finished'"
        )
        assert page.is_disabled("#play")
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["end_reason"] == "interrupted" and summary["collisions"] == 0


def settled_time_s(run: Run) -> float:
    """Time of a paused run, s: telemetry trails the run by a frame, so ask until it stays."""
    last = -1.0
    for _ in range(100):
        now = float(run.get("/api/v1/state")["time_s"])
        if now == last:
            return now
        last = now
        time.sleep(0.2)
    raise AssertionError(f"the run does not stay paused: {last} s")


def test_pause_step_play_and_pace_do_what_they_say(
    server: Path, page: Page, tmp_path: Path
) -> None:
    with running(server, tmp_path, "--duration", "30") as run:
        page.goto(run.url)
        page.wait_for_function(
            "document.getElementById('state').textContent === 'running'"
        )
        page.click("#play")
        page.wait_for_function(
            "document.getElementById('state').textContent === 'paused'"
        )
        stopped_s = settled_time_s(run)
        page.click("#step")
        stepped_s = stopped_s
        for _ in range(100):
            stepped_s = settled_time_s(run)
            if stepped_s != stopped_s:
                break
        assert stepped_s == pytest.approx(stopped_s + 0.1, abs=1e-9)
        page.select_option("#pace", "10")
        page.click("#play")
        page.wait_for_function(
            "document.getElementById('state').textContent === 'running'"
        )
        page.wait_for_function(
            "document.getElementById('factor').textContent.startsWith('10')"
        )
        page.select_option("#pace", "max")
        page.wait_for_function(
            "document.getElementById('state').textContent === 'finished'"
        )
        assert clock_s(page) == pytest.approx(30.0, abs=0.06)
        assert run.process.wait(timeout=30) == 0
    assert (
        json.loads((tmp_path / "summary.json").read_text())["end_reason"] == "time_over"
    )


def test_a_late_viewer_gets_the_plots_from_the_start(
    server: Path, page: Page, tmp_path: Path
) -> None:
    with running(
        server, tmp_path, "--pace", "max", "--duration", "60", "--keep-open"
    ) as run:
        page.wait_for_timeout(1500)
        page.goto(run.url)
        page.wait_for_function(
            "document.getElementById('state').textContent === 'finished'"
        )
        page.wait_for_function(
            "document.getElementById('strips').data?.find(t => t.name === 'speed').x.length > 50"
        )
        first = page.evaluate("document.getElementById('strips').data[2].x[0]")
        assert first < 0.06
        assert run.get("/api/v1/summary")["end_reason"] == "time_over"
        assert run.finish() == 0


def test_the_page_fits_a_small_screen(server: Path, page: Page, tmp_path: Path) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    with running(server, tmp_path, "--pace", "10") as run:
        page.goto(run.url)
        page.wait_for_function(
            "document.querySelectorAll('#strips .trace').length === 7"
        )
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= 390


def test_a_lane_change_is_wished_on_the_page(
    server: Path, tmp_path: Path, page: Page
) -> None:
    options = ["highway-empty", "--decider", "external", "--pace", "5"]
    with running(server, tmp_path, *options) as run:
        page.goto(run.url)
        page.click("#left")
        for _ in range(WAIT_MS // 100):
            if run.get("/api/v1/state")["run"]["lane_changes"] > 0:
                return
            page.wait_for_timeout(100)
        pytest.fail("no lane change was driven")


def test_other_web_sites_cannot_ask(server: Path, tmp_path: Path) -> None:
    with running(server, tmp_path) as run:
        for header, value in [
            ("Host", "evil.example"),
            ("Origin", "http://evil.example"),
        ]:
            request = urllib.request.Request(
                run.url + "/api/v1/state", headers={header: value}
            )
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request, timeout=10)
            assert refused.value.code == 403
        body = b'{"action": "fly"}'
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(run.url + "/api/v1/control", body, timeout=10)
        assert refused.value.code == 400
        assert "fly" in json.load(refused.value)["error"]


def test_the_report_of_the_trucks_diagnosis_is_linked_and_served(
    server: Path, tmp_path: Path, page: Page
) -> None:
    truck = tmp_path / "reference.extended.toml"
    overlay = {"value": 6.8, "source": "test"}
    lines = [f"{key} = {json.dumps(value)}" for key, value in overlay.items()]
    head = 'schema = 1\nbase = "reference"\nname = "extended"\n'
    truck.write_text(
        head + '[set."resistance.drag_area_m2"]\n' + "\n".join(lines) + "\n"
    )
    icon = '<link rel="icon" href="data:,">'
    (tmp_path / "report.html").write_text(f"<!doctype html>{icon}<h1>Air drag</h1>")
    options = ["highway-empty", "--truck", str(truck)]
    with running(server, tmp_path / "run", *options) as run:
        page.goto(run.url)
        page.wait_for_selector("#strips .trace", state="attached")
        page.click("#report")
        assert page.inner_text("h1") == "Air drag"
    with running(server, tmp_path / "plain", "highway-empty") as run:
        page.goto(run.url)
        page.wait_for_selector("#strips .trace", state="attached")
        assert page.is_hidden("#report")
