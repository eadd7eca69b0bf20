"""What a reader without a mouse, or with weak eyes, meets on every page; as axe-core's rules ask."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page
from running import Run, serving

PAGES = ("/runs", "/scenario", "/compare", "/bus")

FINDINGS = """() => {
  const found = [], seen = (e) => e.offsetParent !== null && getComputedStyle(e).visibility === 'visible';
  const words = (e) => e.outerHTML.slice(0, 120);
  const ids = [...document.querySelectorAll('[id]')].map(e => e.id);
  for (const id of new Set(ids.filter((id, i) => ids.indexOf(id) !== i))) found.push('two of id ' + id);
  if (!document.documentElement.lang) found.push('no language');
  if (!document.title) found.push('no title');
  if (document.querySelectorAll('main').length !== 1) found.push('not one main');
  if (document.querySelectorAll('h1').length !== 1) found.push('not one h1');
  for (const e of document.querySelectorAll('button, a[href], input, select, textarea, summary')) {
    if (!seen(e)) continue;
    const name = e.textContent.trim() || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby')
      || e.labels?.length;
    if (!name) found.push('no name: ' + words(e));
    if (e.tabIndex < 0 && !e.disabled) found.push('not by keyboard: ' + words(e));
  }
  for (const e of document.querySelectorAll('img, canvas, svg'))
    if (seen(e) && !(e.alt || e.getAttribute('aria-label') || e.closest('[aria-hidden=true], [role=img], [aria-label]')))
      found.push('picture without words: ' + words(e));
  const paint = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
  const rgba = (c) => { paint.clearRect(0, 0, 1, 1); paint.fillStyle = c; paint.fillRect(0, 0, 1, 1);
    return [...paint.getImageData(0, 0, 1, 1).data]; };
  const light = (c) => { const [r, g, b] = c.map(v => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const behind = (e) => { for (; e; e = e.parentElement) {
    const c = rgba(getComputedStyle(e).backgroundColor); if (c[3] === 255) return c; } return [255, 255, 255, 255]; };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let t; (t = texts.nextNode());) {
    const e = t.parentElement;
    if (!t.textContent.trim() || !seen(e) || e.closest('script, style, svg, [disabled], [aria-disabled=true]')) continue;
    const [a, b] = [light(rgba(getComputedStyle(e).color)), light(behind(e))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    // WCAG 2.1, success criterion 1.4.3
    if (ratio < 4.5) found.push('contrast ' + ratio.toFixed(2) + ': ' + words(e));
  }
  return found;
}"""


@pytest.fixture(scope="module")
def site(server: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    with serving(server, tmp_path_factory.mktemp("site") / "runs") as site:
        yield site


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("path", PAGES)
def test_everything_has_a_name_contrast_and_a_place_in_the_order_of_keys(
    site: Run, strict_page: Page, path: str, scheme: Any
) -> None:
    strict_page.emulate_media(color_scheme=scheme)
    strict_page.goto(site.url + path)
    strict_page.wait_for_load_state("networkidle")
    assert strict_page.evaluate(FINDINGS) == []


def test_what_a_page_may_not_have_is_found(site: Run, strict_page: Page) -> None:
    strict_page.goto(site.url + "/runs")
    strict_page.evaluate(
        """() => {
          const add = (kind, also) => document.querySelector('main').append(
            Object.assign(document.createElement(kind), also));
          add('button', {});
          add('button', {textContent: 'Skipped', tabIndex: -1});
          add('p', {id: 'twin'});
          add('p', {id: 'twin', textContent: 'Pale'});
          add('h1', {textContent: 'Another'});
          const pale = document.getElementById('twin').nextElementSibling.style;
          pale.color = '#999'; pale.backgroundColor = '#aaa';
        }"""
    )
    found = [line.split(":")[0] for line in strict_page.evaluate(FINDINGS)]
    assert found[:2] == ["two of id twin", "not one h1"]
    assert found[2:4] == ["no name", "not by keyboard"]
    assert [line.split()[0] for line in found[4:]] == ["contrast"]
