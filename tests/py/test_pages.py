"""Runs, Compare, Scenario and playback in a real browser, from a server without a run."""

from __future__ import annotations

import json
import math
import os
import re
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsing import contrast
from playwright.sync_api import Page, expect
from running import Run, serving

NAMELESS = """() => [...document.querySelectorAll('button, a, input, select, textarea')]
    .filter(e => e.offsetParent !== null)
    .filter(e => !(e.textContent.trim() || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby')
        || e.labels?.length))
    .map(e => e.outerHTML)"""
"""Controls that a screen reader cannot name."""


@pytest.fixture(scope="module")
def site(server: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """A server with two runs that are over, of one seed and another."""
    with serving(server, tmp_path_factory.mktemp("site") / "runs") as site:
        for seed in (1, 2):
            begin(site, scenario="medium-15", seed=seed, duration_s=60, pace="max")
        for run in ("medium-15-1", "medium-15-2"):
            while site.get(f"/api/v1/runs/{run}")["recording"]:
                pass
        yield site


def begin(site: Run, **wanted: Any) -> Any:
    """Begins a session."""
    body = json.dumps({"state": "playing", **wanted}).encode()
    asked = urllib.request.Request(
        site.url + "/api/v1/sessions", body, {"Content-Type": "application/json"}
    )
    with urllib.request.urlopen(asked, timeout=30) as answer:
        return json.load(answer)


def picture(page: Page, name: str, folder: Path) -> None:
    """Keeps what is seen."""
    page.screenshot(path=Path(os.environ.get("PAGE_PICTURES", folder)) / f"{name}.png")


def test_the_list_of_runs_leads_to_play_report_and_comparison(
    site: Run, strict_page: Page, tmp_path: Path
) -> None:
    page = strict_page
    page.goto(site.url)
    expect(page).to_have_url(site.url + "/runs")
    rows = page.locator("#runs tr")
    expect(rows).to_have_count(2)
    expect(rows.nth(0)).to_contain_text("medium-15")
    assert page.evaluate(NAMELESS) == []
    assert contrast(page, "#runs td:nth-child(2)") >= 4.5
    picture(page, "runs", tmp_path)
    page.fill("#find", "15-2")
    expect(rows).to_have_count(1)
    page.fill("#find", "")
    expect(page.locator("#compare")).to_have_attribute("aria-disabled", "true")
    for box in page.locator("#runs input").all():
        box.check()
    with page.expect_download() as begun:
        page.click("#runs tr:first-child >> text=Download")
    assert begun.value.suggested_filename.startswith("medium-15-")
    assert begun.value.path().read_bytes()[:8] == b"\x89MCAP0\r\n"
    with page.expect_popup() as opened:
        page.click("#runs tr:first-child >> text=Report")
    report = opened.value
    report.wait_for_selector("#picture .scatterlayer .trace", state="attached")
    assert "state hash" in report.inner_text("p")
    report.close()
    page.click("#compare")
    expect(page.locator("#same")).to_contain_text("The other vehicles are others from")


def test_two_runs_are_compared_with_their_residuals(
    site: Run, page: Page, tmp_path: Path
) -> None:
    page.goto(site.url + "/compare?a=medium-15-1&b=medium-15-2")
    page.wait_for_function(
        "document.querySelectorAll('#plots .scatterlayer .trace').length === 12"
    )
    traces = page.evaluate(
        "document.getElementById('plots').data.slice(0, 3).map(t => t.y)"
    )
    for a, b, residual in zip(*traces, strict=True):
        if None not in (a, b):
            assert abs(b - a - residual) < 1e-9
    summaries = [
        site.get(f"/api/v1/runs/medium-15-{seed}")["summary"] for seed in (1, 2)
    ]
    said = page.inner_text("#figures")
    for summary in summaries:
        assert summary["state_hash"] in said
        assert f"{summary['fuel_g'] / 1000:.3f}" in said
    assert page.locator("#segments tr").count() >= 1
    assert page.evaluate(NAMELESS) == []
    picture(page, "compare", tmp_path)
    page.select_option("#b", "medium-15-1")
    page.click("#pair button")
    expect(page.locator("#same")).to_have_text(re.compile("^The same bit for bit"))
    assert page.get_attribute("#same", "data-same") == "yes"


def test_a_run_that_is_over_is_played_back(
    site: Run, page: Page, tmp_path: Path
) -> None:
    page.goto(site.url + "/?run=medium-15-1")
    page.wait_for_selector("#timebar:not([hidden])")
    expect(page.locator("#at-s")).to_contain_text("of 0:59.8")
    assert page.is_hidden("#play") and page.inner_text("#differs") == ""
    page.fill("#at", "30")
    expect(page.locator("#time")).to_have_text("0:30.0")
    frame = site.get("/api/v1/runs/medium-15-1/frames?from_s=30&to_s=30.1")["frames"][0]
    speed = f"{frame['ego']['speed_m_s'] * 3.6:.1f}"
    expect(page.locator("#speed")).to_have_text(speed)
    page.select_option("#play-pace", "5")
    page.click("#play-back")
    page.wait_for_function("document.getElementById('at').value > 35")
    page.click("#play-back")
    # The list was empty until the next frame came, which a run that stands still does not bring.
    page.click("text=All values of the truck")
    expect(page.locator("#values")).to_contain_text("engine torque")
    before = page.inner_text("#values")
    page.fill("#at", "20")
    other = "before => document.getElementById('values').innerText !== before"
    page.wait_for_function(other, arg=before)
    page.fill("#at", "40")
    expect(page.locator("#time")).to_have_text("0:40.0")
    page.locator("#over >> text=time").click()
    page.wait_for_function(
        "document.getElementById('strips').layout?.xaxis.title.text === 'time, s'"
    )
    with page.expect_download() as begun:
        page.click("#picture")
    assert begun.value.suggested_filename == "tractrix-40.0-s.png"
    assert begun.value.path().read_bytes()[1:4] == b"PNG"
    picture(page, "playback", tmp_path)


def test_a_vehicle_is_clicked_followed_and_coloured(site: Run, page: Page) -> None:
    page.goto(site.url + "/?run=medium-15-1")
    page.wait_for_selector("#timebar:not([hidden])")
    page.fill("#at", "50")
    expect(page.locator("#time")).to_have_text("0:50.0")
    frame = site.get("/api/v1/runs/medium-15-1/frames?from_s=50&to_s=50.1")["frames"][0]
    ego = frame["ego"]
    near = min(
        frame["neighbours"],
        key=lambda n: (n["x_m"] - ego["x_m"]) ** 2 + (n["y_m"] - ego["y_m"]) ** 2,
    )
    # As the view draws: the truck at a third of the width, heading right
    box = page.locator("#view").bounding_box()
    assert box is not None
    for _ in range(8):
        page.click("#out")
    scale = max(box["width"], 500) / 110 * max(0.12, 1.35**-8)
    dx, dy = near["x_m"] - ego["x_m"], near["y_m"] - ego["y_m"]
    cos, sin = math.cos(ego["yaw_rad"]), math.sin(ego["yaw_rad"])
    x = box["x"] + box["width"] * 0.34 + scale * (dx * cos + dy * sin)
    y = box["y"] + box["height"] * 0.54 - scale * (dy * cos - dx * sin)
    page.wait_for_timeout(200)
    page.mouse.click(x, y)
    vehicle = page.locator("#vehicle")
    page.fill("#at", "50.25")
    expect(vehicle).to_contain_text(re.compile(r"#\d+, (car|van|truck|bus), "))
    page.click("#vehicle button")
    page.fill("#at", "50.5")
    expect(vehicle).to_contain_text("Follow the truck")
    before = page.locator("#view").screenshot()
    page.select_option("#colours", "speed")
    page.wait_for_timeout(200)
    assert page.locator("#view").screenshot() != before


def test_a_scenario_is_changed_shared_and_started(
    site: Run, page: Page, tmp_path: Path
) -> None:
    page.goto(site.url + "/scenario?scenario=flat&seed=18446744073709551615&pace=max")
    expect(page.locator("#description")).to_contain_text("Level and straight")
    assert page.input_value("#toml").startswith("schema = 1")
    assert page.evaluate(NAMELESS) == []
    page.select_option("#decider", "rules:100")
    text = page.input_value("#toml").replace('name = "flat"', 'name = "mine"')
    page.fill("#toml", text)
    assert page.is_enabled("#back")
    page.click("#share")
    shared = page.url
    assert "decider=rules%3A100" in shared and "mine" in shared
    page.goto("about:blank")
    page.goto(shared)
    expect(page.locator("#toml")).to_have_value(text)
    picture(page, "scenario", tmp_path)
    page.select_option("#begin", "paused")
    page.click("#start")
    page.wait_for_url("**/?session=*")
    expect(page.locator("#scenario")).to_have_text("mine")
    session = page.url.rpartition("=")[2]
    assert site.get(f"/api/v1/sessions/{session}")["seed"] == 2**64 - 1
    page.click("#step")
    expect(page.locator("#time")).to_have_text("0:00.1")
    page.goto(site.url + "/runs")
    page.locator(f"#sessions tr:has-text('{session}') button").click()
    page.click("#sure button[value=yes]")
    expect(page.locator("#sessions")).not_to_contain_text("mine")
    expect(page.locator("#runs")).to_contain_text("mine-18446744073709551615")


def test_a_scenario_that_cannot_be_driven_says_why(site: Run, browser: Any) -> None:
    page = browser.new_page()
    page.goto(site.url + "/scenario?scenario=flat")
    expect(page.locator("#description")).to_contain_text("Level and straight")
    page.fill("#toml", 'schema = 1\nname = "x"\nroad = "/etc/passwd"')
    page.click("#start")
    expect(page.locator("#answer")).to_contain_text("truck")
    page.close()


def test_a_run_is_deleted_only_after_a_question(site: Run, page: Page) -> None:
    begin(site, scenario="flat", seed=77, duration_s=5, pace="max")
    while site.get("/api/v1/runs/flat-77")["recording"]:
        pass
    page.goto(site.url + "/runs")
    row = page.locator("#runs tr", has_text="flat-77")
    row.locator("text=Delete").click()
    page.keyboard.press("Escape")
    expect(row).to_have_count(1)
    row.locator("text=Delete").click()
    page.click("#sure button[value=yes]")
    expect(row).to_have_count(0)
    names = [run["name"] for run in site.get("/api/v1/runs")["runs"]]
    assert "flat-77" not in names


def test_the_bus_of_a_session_is_seen_message_by_message(
    site: Run, strict_page: Page, tmp_path: Path
) -> None:
    session = begin(site, scenario="flat", vehicle="bus", pace="realtime")["id"]
    page = strict_page
    page.goto(f"{site.url}/bus?session={session}")
    engine = page.locator("#messages tr", has=page.locator("th", has_text="EEC1"))
    expect(engine).to_have_count(1)
    page.wait_for_timeout(1500)
    rate = float(engine.locator("td").nth(3).inner_text())
    assert 40.0 < rate < 110.0, rate
    engine.locator("summary").click()
    expect(engine.locator("dl.signals")).to_contain_text("engine_speed")
    # An open list of signals stays open while its values go on
    page.wait_for_timeout(1200)
    expect(engine.locator("dl.signals")).to_be_visible()
    expect(page.locator("#faults")).to_have_text("All in order.")
    assert page.locator("#claims tr").count() >= 8
    page.fill("#find", "eec2")
    expect(page.locator("#messages tr")).to_have_count(1)
    page.fill("#find", "")
    control = f"/api/v1/sessions/{session}/control"
    body = {"action": "fault", "fault": "engine", "on": True}
    asked = urllib.request.Request(
        site.url + control,
        json.dumps(body).encode(),
        {"Content-Type": "application/json"},
    )
    urllib.request.urlopen(asked, timeout=30).close()
    expect(page.locator("#faults")).to_contain_text("signal lost since")
    expect(engine.locator("td.late")).to_have_count(1)
    picture(page, "bus", tmp_path)
    page.goto(site.url + "/runs")
    end = urllib.request.Request(
        f"{site.url}/api/v1/sessions/{session}", method="DELETE"
    )
    urllib.request.urlopen(end, timeout=60).close()


@pytest.mark.parametrize("path", ["/runs", "/compare", "/scenario", "/bus"])
@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_pages_fit_and_can_be_used_by_keyboard(
    site: Run, strict_page: Page, path: str, width: int, theme: str
) -> None:
    page = strict_page
    page.emulate_media(color_scheme="light" if theme == "light" else "dark")
    page.set_viewport_size({"width": width, "height": 800})
    page.goto(site.url + path)
    page.wait_for_timeout(500)
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= width, "what is wider scrolls by itself"
    for element in ("h1", "nav a", "h2", ".panel button, .panel th"):
        assert contrast(page, element) >= 4.5, element
    reached = set()
    for _ in range(12):
        page.keyboard.press("Tab")
        reached.add(
            page.evaluate(
                "document.activeElement?.id || document.activeElement?.textContent"
            )
        )
    assert {"Live", "Runs", "Compare", "Scenario", "Bus", "theme"} <= reached
