"""What other web sites, impolite clients and crowds can do to a run: nothing."""

from __future__ import annotations

import contextlib
import http.server
import json
import os
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from running import Run, running

FOREIGN = """<!doctype html><title>elsewhere</title>
<form id="form" method="post" enctype="text/plain" target="frame"
      action="TARGET/api/v1/control"><input name='{"action":"quit","a":"' value='"}'></form>
<iframe name="frame" id="frame"></iframe>
<iframe id="page" src="TARGET/"></iframe>
<img id="picture" src="TARGET/api/v1/state">
<script src="TARGET/api/v1/state"></script>"""

ATTACKS = """async (target) => {
    const of = async (what) => { try { return await what(); } catch (e) { return e.name; } };
    const text = { method: "POST", mode: "no-cors", body: '{"action":"quit"}' };
    const json = { method: "POST", body: '{"action":"quit"}', headers: { "Content-Type": "application/json" } };
    const socket = () => new Promise((done) => {
        const socket = new WebSocket(target.replace("http", "ws") + "/ws");
        socket.onopen = () => done("open");
        socket.onerror = () => done("refused");
    });
    document.getElementById("form").submit();
    return {
        opaque: await of(async () => (await fetch(target + "/api/v1/control", text)).type),
        json: await of(async () => (await fetch(target + "/api/v1/control", json)).status),
        read: await of(async () => (await fetch(target + "/api/v1/state")).status),
        end: await of(async () => (await fetch(target + "/api/v1/sessions/default", { method: "DELETE" })).status),
        socket: await socket(),
    };
}"""


@pytest.fixture
def run(server: Path, tmp_path: Path) -> Iterator[Run]:
    with running(server, tmp_path / "out", "flat", "--keep-open") as run:
        yield run


@contextlib.contextmanager
def elsewhere(target: str) -> Iterator[int]:
    """Another web site; its port."""

    class Site(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(FOREIGN.replace("TARGET", target).encode())

        def log_message(self, *_: object) -> None:
            pass

    site = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Site)
    threading.Thread(target=site.serve_forever, daemon=True).start()
    yield site.server_port
    site.shutdown()


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1"])
def test_another_site_neither_reads_nor_commands(
    run: Run, browser: Browser, name: str
) -> None:
    """`localhost` is another site than 127.0.0.1, another port of it another origin."""
    with elsewhere(run.url) as port:
        page = browser.new_page(bypass_csp=True)
        page.goto(f"http://{name}:{port}/")
        got = page.evaluate(ATTACKS, run.url)
        assert got["opaque"] in ("opaque", "TypeError")
        assert got["json"] == got["read"] == got["end"] == "TypeError"
        assert got["socket"] == "refused"
        framed = page.frame_locator("#page").locator("#speed")
        assert framed.count() == 0, "the page shows in no frame"
        assert page.evaluate("document.getElementById('picture').naturalWidth") == 0
        page.close()
    assert run.get("/api/v1/sessions/default")["state"] == "playing"
    assert run.process.poll() is None


def ask(run: Run, request: str) -> str:
    """The first line of an answer."""
    port = int(run.url.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=30) as client:
        client.sendall(request.encode())
        return client.makefile("rb").readline().decode()


def test_names_that_lead_here_and_paths_that_lead_out_are_refused(run: Run) -> None:
    host = run.url.removeprefix("http://")
    for wrong in ("evil.example", "127.0.0.1.nip.io", "", "0.0.0.0", "[::]"):
        said = ask(run, f"GET /api/v1/state HTTP/1.1\r\nHost: {wrong}\r\n\r\n")
        assert " 403 " in said or " 400 " in said, wrong
    for path in (
        "/../etc/passwd",
        "/assets/../../etc/passwd",
        "/api/v1/runs/../../etc/passwd/recording",
        "/api/v1/runs/..%2f..%2fetc/recording",
        "/api/v1/runs/%00/recording",
        "/assets/%2e%2e/app.js",
    ):
        said = ask(run, f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n")
        assert " 404 " in said or " 400 " in said, path


def test_the_program_listens_on_this_computer_alone(run: Run) -> None:
    listed = subprocess.run(
        ["ss", "-Hltnup"], capture_output=True, text=True, check=True
    )
    own = [
        line for line in listed.stdout.splitlines() if f"pid={run.process.pid}," in line
    ]
    places = [line.split()[4].rpartition(":")[0] for line in own]
    assert places == ["127.0.0.1"]


def resources(run: Run) -> tuple[int, int]:
    """Memory, kB, and descriptors."""
    status = Path(f"/proc/{run.process.pid}/status").read_text()
    memory = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return int(memory.split()[1]), len(os.listdir(f"/proc/{run.process.pid}/fd"))


def test_ten_thousand_connections_cost_nothing_that_stays(
    server: Path, tmp_path: Path
) -> None:
    with running(server, tmp_path / "out", "flat", "--pace", "5") as run:
        port = int(run.url.rpartition(":")[2])
        time.sleep(2.0)
        memory_kb, descriptors = resources(run)
        most = 0
        for _ in range(20):
            opened = []
            for _ in range(500):
                with contextlib.suppress(OSError):
                    opened.append(socket.create_connection(("127.0.0.1", port), 5))
            most = max(most, resources(run)[1])
            for client in opened:
                client.close()
        assert most <= descriptors + 64 + 16

        def impolite(number: int) -> str:
            words = [
                f"GET /api/v1/state HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n",
                "GET / HTTP/1.1\r\n" + "X: y\r\n" * 5000,
                "\x00\xff\x16\x03\x01" * 50,
                (
                    f"POST /api/v1/control HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Type: application/json\r\n"
                    'Content-Length: 99\r\n\r\n{"action":'
                ),
            ]
            with contextlib.suppress(OSError):
                return ask(run, words[number % len(words)])
            return "closed"

        with ThreadPoolExecutor(100) as crowd:
            answers = list(crowd.map(impolite, range(400)))
        assert any(" 200 " in answer for answer in answers)
        deadline = time.monotonic() + 30.0
        while resources(run)[1] > descriptors + 5 and time.monotonic() < deadline:
            time.sleep(0.2)
        after_kb, left = resources(run)
        assert left <= descriptors + 5
        assert after_kb < memory_kb + 60_000, "a run grows by its strips and frames"
        before = run.get("/api/v1/state")["time_s"]
        time.sleep(1.0)
        assert run.get("/api/v1/state")["time_s"] > before, "the run goes on"
        assert run.finish() == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["end_reason"] == "interrupted"
