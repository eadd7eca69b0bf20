"""Where the program is, and a run of it for all tests that only read its files."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from browsing import FLAGS, opened
from playwright.sync_api import Browser, Page, sync_playwright

WORKSPACE = Path(__file__).resolve().parents[2]


def find_server() -> Path:
    """The release binary that cargo built."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", WORKSPACE / "target"))
    return target / "release" / "sim-server"


@pytest.fixture(scope="session")
def server() -> Path:
    """The program; tests are skipped where it has not been built."""
    program = find_server()
    if not program.exists():
        pytest.skip(f"{program} does not exist: cargo build --release -p sim-server")
    return program


@pytest.fixture(scope="session")
def short_run(server: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run of 20 simulated seconds."""
    folder = tmp_path_factory.mktemp("short_run")
    command: list[str | Path] = [
        server,
        "run",
        "--headless",
        "--duration",
        "20",
        "--seed",
        "7",
        "--out",
        folder,
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return folder


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
    """A page that fails the test on any error of a script, the console or a request.

    Without the page's policy, which forbids the `eval` of Playwright's waiting functions.
    """
    yield from opened(browser, bypass_csp=True)


@pytest.fixture
def strict_page(browser: Browser) -> Iterator[Page]:
    """As `page`, under the policy that a user's browser follows."""
    yield from opened(browser, bypass_csp=False)
