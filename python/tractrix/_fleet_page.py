"""The page of a fleet: every cause over the weeks, a line for each truck."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

_COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b")
_FIRST = ("rolling_resistance", "dragging_brake", "brake", "fan")
"""What wears comes first."""
_WIDTH, _HEIGHT, _LEFT, _TOP = 720, 260, 70, 20
_STYLE = (
    "body{font:15px sans-serif;max-width:60em;margin:2em auto}"
    "td,th{padding:.2em .8em;text-align:left}.bad{color:#b00}svg text{font:11px sans-serif}"
)
_Z_90 = 1.645
"""Half of a 90 % interval, standard deviations."""


def page(rows: Sequence[dict[str, Any]]) -> str:
    """A self-contained page."""
    weeks = sorted({row["week"] for row in rows})
    trucks = sorted({row["truck"] for row in rows})
    kinds = {(r["cause"], r["parameter"], r["unit"]) for r in rows if r["cause"]}
    parts = [
        "<!doctype html><meta charset=utf-8><title>Fleet</title>",
        f"<style>{_STYLE}</style><h1>{len(trucks)} trucks, {len(weeks)} weeks</h1>",
        "<p>Every cause that was named, with its 90 % interval; a week in which it was not named "
        "has no point. " + _legend(trucks) + "</p>",
    ]
    for cause, parameter, unit in sorted(kinds, key=_rank):
        points = [
            r for r in rows if r["cause"] == cause and r["parameter"] == parameter
        ]
        title = f"{cause}: {parameter}" + (
            f" ({unit})" if unit not in ("", "1") else ""
        )
        parts.append(f"<h2>{escape(title)}</h2>{_chart(points, weeks, trucks)}")
    parts.append(_table(rows, weeks, trucks))
    return "\n".join(parts)


def _rank(kind: tuple[str, str, str]) -> tuple[int, str, str]:
    place = [i for i, start in enumerate(_FIRST) if kind[0].startswith(start)]
    return (place[0] if place else len(_FIRST), kind[0], kind[1])


def _colour(trucks: Sequence[str], truck: str) -> str:
    return _COLOURS[trucks.index(truck) % len(_COLOURS)]


def _legend(trucks: Sequence[str]) -> str:
    marks = [
        f'<span style="color:{_colour(trucks, t)}">● {escape(t)}</span>' for t in trucks
    ]
    return " ".join(marks)


def _chart(
    points: Sequence[dict[str, Any]], weeks: Sequence[str], trucks: Sequence[str]
) -> str:
    ends = [r["value"] + z * r["sigma"] for r in points for z in (-_Z_90, _Z_90)]
    low, high = min([0.0, *ends]), max([0.0, *ends])
    span = (high - low) or 1.0

    def x(week: str) -> float:
        return _LEFT + (_WIDTH - _LEFT - 20) * (weeks.index(week) + 0.5) / len(weeks)

    def y(value: float) -> float:
        return float(_TOP + (_HEIGHT - 2 * _TOP) * (high - value) / span)

    drawn = [f'<svg width="{_WIDTH}" height="{_HEIGHT}" role="img">']
    for value in (low, 0.0, high):
        at = f"{y(value):.1f}"
        drawn.append(
            f'<line x1="{_LEFT}" x2="{_WIDTH}" y1="{at}" y2="{at}" stroke="#ccc"/>'
        )
        drawn.append(f'<text x="4" y="{at}">{value:.3g}</text>')
    for week in weeks[:: max(1, len(weeks) // 12)]:
        drawn.append(
            f'<text x="{x(week) - 14:.1f}" y="{_HEIGHT - 4}">{escape(week)}</text>'
        )
    for truck in trucks:
        own = sorted(
            (r for r in points if r["truck"] == truck), key=lambda r: str(r["week"])
        )
        colour = _colour(trucks, truck)
        line = " ".join(f"{x(r['week']):.1f},{y(r['value']):.1f}" for r in own)
        drawn.append(f'<polyline points="{line}" fill="none" stroke="{colour}"/>')
        for r in own:
            at, half = f"{x(r['week']):.1f}", _Z_90 * r["sigma"]
            drawn.append(
                f'<line x1="{at}" x2="{at}" y1="{y(r["value"] - half):.1f}" '
                f'y2="{y(r["value"] + half):.1f}" stroke="{colour}"/>'
                f'<circle cx="{at}" cy="{y(r["value"]):.1f}" r="4" fill="{colour}"/>'
            )
    return "".join(drawn) + "</svg>"


def _table(
    rows: Sequence[dict[str, Any]], weeks: Sequence[str], trucks: Sequence[str]
) -> str:
    cells = ["<h2>Weeks</h2><table><tr><th>truck<th>" + "<th>".join(map(escape, weeks))]
    for truck in trucks:
        cells.append(f"<tr><th>{escape(truck)}")
        for week in weeks:
            own = [r for r in rows if r["truck"] == truck and r["week"] == week]
            errors = [r["error"] for r in own if r["error"]]
            causes = list(dict.fromkeys(r["cause"] for r in own if r["cause"]))
            words = "; ".join(errors) or ", ".join(causes)
            words = words or (own[0]["verdict"] or "" if own else "")
            kind = ' class="bad"' if errors else ""
            cells.append(f"<td{kind}>{escape(words.replace('_', ' '))}")
    return "".join(cells) + "</table>"
