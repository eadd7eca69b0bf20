"""Tabs of a browser that must not see an error."""

from __future__ import annotations

from collections.abc import Iterator

from playwright.sync_api import Browser, Page, ViewportSize

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
LEFT = "net::ERR_ABORTED"  # a request under way when its page is left


def opened(browser: Browser, bypass_csp: bool) -> Iterator[Page]:
    """A tab that must not see an error."""
    size: ViewportSize = {"width": 1440, "height": 960}
    tab = browser.new_page(viewport=size, bypass_csp=bypass_csp)
    tab.set_default_timeout(WAIT_MS)
    wrong: list[str] = []
    tab.on(
        "console",
        lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None,
    )
    tab.on("pageerror", lambda e: wrong.append(str(e)))
    tab.on(
        "requestfailed", lambda r: wrong.append(r.url) if r.failure != LEFT else None
    )
    yield tab
    tab.close()
    assert wrong == []


def contrast(page: Page, element: str) -> float:
    """Contrast of an element's text on its ground (WCAG 2.2)."""
    script = """(selector) => {
      const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
      const light = (c) => c.slice(0, 3).map((v) => v / 255)
        .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
      let node = document.querySelector(selector);
      const text = rgb(getComputedStyle(node).color);
      let ground = rgb(getComputedStyle(node).backgroundColor);
      while (ground[3] === 0) {
        node = node.parentElement;
        ground = rgb(getComputedStyle(node).backgroundColor);
      }
      const [a, b] = [light(text), light(ground)].sort((x, y) => y - x);
      return (a + 0.05) / (b + 0.05);
    }"""
    return float(page.evaluate(script, element))
