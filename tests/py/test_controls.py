"""The dashboard's controls in a real browser: what they ask of the run, and what is refused."""

from __future__ import annotations

import json
import os
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from browsing import WAIT_MS
from playwright.sync_api import Browser, Page, Route
from running import running, settled_time_s

SET_SPEED_IS_20 = """fetch('/api/v1/state').then(a => a.json())
    .then(state => state.run.set_speed_m_s === 20)"""


def clock_s(page: Page) -> float:
    """The simulated time in the header, s."""
    minutes, seconds = page.inner_text("#time").split(":")
    return 60.0 * float(minutes) + float(seconds)


def test_pause_step_play_and_pace_do_what_they_say(
    server: Path, page: Page, tmp_path: Path
) -> None:
    with running(server, tmp_path, "--duration", "90") as run:
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
        assert clock_s(page) == pytest.approx(90.0, abs=0.06)
        assert run.process.wait(timeout=30) == 0
    assert (
        json.loads((tmp_path / "summary.json").read_text())["end_reason"] == "time_over"
    )


def test_a_refused_lane_change_says_why(
    server: Path, page: Page, tmp_path: Path
) -> None:
    with running(server, tmp_path, "highway-empty", "--decider", "external") as run:
        page.goto(run.url)
        page.wait_for_function("!document.getElementById('right').disabled")
        assert page.is_hidden("#refusal")
        page.click("#right")
        page.wait_for_selector("#refusal", state="visible")
        said = page.inner_text("#refusal")
        assert "asked for from outside" in said
        assert "there is no lane on that side" in said


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
            post = urllib.request.Request(
                run.url + "/api/v1/control",
                body,
                headers={"Content-Type": "application/json"},
            )
            urllib.request.urlopen(post, timeout=10)
        assert refused.value.code == 400
        assert "fly" in json.load(refused.value)["detail"]


def test_a_run_is_driven_to_a_time_and_begun_again_from_the_page(
    server: Path, page: Page, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    # At the greatest pace a fast machine is at the road's end before the browser is here.
    with running(server, out, "highway-empty", "--pace", "10") as run:
        page.goto(run.url)
        page.wait_for_selector("#strips .trace", state="attached")
        page.click("#play")
        page.click(".more summary")
        page.fill("#set-speed-kmh", "72")
        page.click("#set-speed")
        page.wait_for_function(SET_SPEED_IS_20)
        page.fill("#seed", "7")
        page.click("#play")
        # Frames of the new run arrive while a slow server answers: they begin no second reload.
        asked: list[Route] = []
        page.route(run.url + "/", lambda route: asked.append(route))
        page.click("#again")
        page.wait_for_timeout(1000)
        assert len(asked) == 1
        with page.expect_navigation():
            asked[0].continue_()
        page.unroute(run.url + "/")
        page.wait_for_selector("#strips .trace", state="attached")
        page.click(".more summary")
        page.fill("#until-s", "150.5")
        page.click("#until")
        page.wait_for_function(
            "document.getElementById('time').textContent === '2:30.5'"
            " && document.getElementById('state').textContent === 'paused'"
        )
        assert (out / "run-2").is_dir()
        # The page rounds to tenths, so a frame from before the end reads as the end.
        assert settled_time_s(run) == pytest.approx(150.49)


def test_decider_planner_and_faults_are_set_on_the_page(
    server: Path, page: Page, tmp_path: Path
) -> None:
    with running(server, tmp_path / "out", "flat", "--pace", "5") as run:
        page.goto(run.url)
        page.wait_for_selector("#strips .trace", state="attached")
        page.click(".more summary")
        page.wait_for_function("document.getElementById('decider').value === 'keep'")
        page.select_option("#decider", "mobil")
        page.select_option("#speed-planner", "predictive")
        page.select_option("#fault", "perception")
        page.click("#break")
        page.wait_for_selector("#banner:has-text('Broken: perception')")
        page.wait_for_selector("#maneuver:has-text('minimal risk')")
        page.wait_for_selector("#break:has-text('Mend')")
        picture = Path(os.environ.get("SETTINGS_PICTURE", tmp_path / "settings.png"))
        page.screenshot(path=picture)
        page.click("#break")
        page.wait_for_selector("#banner", state="hidden")
        now = run.get("/api/v1/state")["run"]
        assert now["decider"] == "mobil" and now["speed_planner"] == "predictive"
        # Somebody drives, and says no more
        body = {"action": "external", "accel_m_s2": 0.0, "road_wheel_rad": 0.0}
        post = urllib.request.Request(
            run.url + "/api/v1/control",
            json.dumps(body).encode(),
            headers={"Content-Type": "application/json"},
        )
        urllib.request.urlopen(post, timeout=10)
        page.wait_for_selector("#banner:has-text('Driven from outside')")
        page.click("#release")
        page.wait_for_selector("#banner", state="hidden")


def test_a_refusal_is_shown_in_the_servers_words(
    server: Path, browser: Browser, tmp_path: Path
) -> None:
    # Not the fixture: the browser says on the console that something was refused.
    tab = browser.new_page(bypass_csp=True)
    tab.set_default_timeout(WAIT_MS)
    with running(server, tmp_path, "highway-empty") as run:
        tab.goto(run.url)
        tab.wait_for_selector("#strips .trace", state="attached")
        tab.click(".more summary")
        tab.fill("#seed", "18446744073709551616")
        tab.click("#again")
        tab.wait_for_selector("#answer:has-text('0 to 18446744073709551615')")
        tab.set_viewport_size({"width": 390, "height": 800})
        for element in (".more > div", "#answer"):
            box = tab.locator(element).bounding_box()
            assert box is not None
            assert box["x"] >= 0 and box["x"] + box["width"] <= 390, element
    tab.close()
