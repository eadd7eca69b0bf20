"""The evaluation's files: every episode, the means with their intervals, tables, a plot."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tractrix.evaluate.statistics import LEAST_PAIRS, paired

Figures = Mapping[str, npt.NDArray[Any]]
"""Figures of a decider in a scenario, each with a number per seed."""
Results = Mapping[str, Mapping[str, Figures]]
"""By scenario, then by decider."""
Row = Mapping[str, Any]
"""A decider in a scenario."""

REFERENCE = "rules:50"
"""The paper's aggressive rule: differences are to it."""
CEILING = "ceiling"
"""The planner that knows the true drivers: an upper bound, no competitor."""
PAPER = {
    "table2-dense-12.5": ((38.9, 2.84), (28.5, 6.23), (24.5, 6.98), (24.0, 6.16)),
    "table2-dense-15": ((30.9, 3.06), (20.1, 6.89), (18.8, 7.13), (17.3, 6.24)),
    "table2-medium-12.5": ((14.1, 4.58), (13.8, 5.09), (6.6, 8.93), (8.0, 6.22)),
    "table2-medium-15": ((4.4, 5.00), (1.6, 4.02), (1.6, 8.99), (1.4, 6.30)),
    "table2-sparse-12.5": ((5.9, 2.55), (3.4, 2.83), (4.4, 2.99), (3.4, 3.02)),
    "table2-sparse-15": ((1.0, 0.40), (1.0, 0.40), (10.0, 0.50), (1.0, 0.77)),
}
"""Table II of the paper: delta speed in % and lane changes of `PAPER_DECIDERS`. The 10.0 % of the
last row stands there, between two cells of 1.0 %."""
PAPER_DECIDERS = ("rules:150", "rules:100", "rules:50", "dqn")
"""The paper's conservative, neutral and aggressive rule, and its network."""

MEANS = (
    "delta_speed_frac",
    "lane_changes",
    "aborted",
    "refused",
    "hard_braking_caused",
    "fuel_g_km",
)
"""Figures of an episode whose means and paired differences are reported."""
SHOWN = {
    "delta_speed_frac": ("delta speed, %", 100.0),
    "lane_changes": ("lane changes", 1.0),
    "fuel_g_km": ("fuel, g/km", 1.0),
    "aborted": ("aborted", 1.0),
    "refused": ("refused", 1.0),
    "hard_braking_caused": ("hard braking caused", 1.0),
    "collisions": ("collisions", 1.0),
    "ego_caused_collisions": ("of these caused", 1.0),
    "distance_m": ("km", 1e-3),
    "kept_gain_frac": ("of the ceiling's gain, %", 100.0),
}
"""Columns of the table: heading and factor; one without a number stays away."""


def summary(results: Results) -> list[dict[str, Any]]:
    """A row for every scenario and decider.

    `lane_changes`, `aborted`, `refused` and `hard_braking_caused` are per episode, `collisions`,
    `ego_caused_collisions` and `distance_m` of all episodes. `minus_rules_50` is the mean paired
    difference of delta speed with its 95 % interval (Student's t), `paired` those of all figures with
    the bootstrap's. `kept_gain_frac` is the gain over the reference as a share of the ceiling's.
    """
    rows = []
    for scenario, by_decider in results.items():
        reference = _figures(by_decider[REFERENCE])
        for decider, found in by_decider.items():
            figures = _figures(found)
            row: dict[str, Any] = {"scenario": scenario, "decider": decider}
            row["seeds"] = len(found["seed"])
            row |= {name: float(values.mean()) for name, values in figures.items()}
            row["collisions"] = int(found["collided"].sum())
            row["ego_caused_collisions"] = int(found["collision_caused"].sum())
            row["distance_m"] = float(found["distance_m"].sum())
            row["minus_rules_50"], row["paired"] = None, {}
            if row["seeds"] >= LEAST_PAIRS:
                for name, values in figures.items():
                    difference = paired(values, reference[name])
                    row["paired"][name] = {
                        "mean": difference.mean,
                        "t": difference.t,
                        "bootstrap": difference.bootstrap,
                    }
                delta = row["paired"]["delta_speed_frac"]
                low, high = delta["t"]
                row["minus_rules_50"] = {
                    "mean": delta["mean"],
                    "low": low,
                    "high": high,
                }
            rows.append(row)
    for row in rows:
        row["kept_gain_frac"] = _kept(rows, row["decider"], row["scenario"])
    return rows


def _figures(found: Figures) -> dict[str, npt.NDArray[np.float64]]:
    """The figures that are there, by episode."""
    with np.errstate(invalid="ignore"):
        fuel_g_km = found["fuel_g"] / (found["distance_m"] / 1000.0)
    known = {**found, "fuel_g_km": fuel_g_km}
    figures = {name: known[name].astype(np.float64) for name in MEANS}
    return {
        name: values for name, values in figures.items() if np.isfinite(values).all()
    }


def _kept(rows: Sequence[Row], decider: str, scenario: str | None) -> float | None:
    """The gain of a decider over the reference by that of the ceiling; of all scenarios for None."""
    ceilings = [row["decider"] for row in rows if kind(row["decider"]) == CEILING]
    if decider == REFERENCE or not ceilings:
        return None
    reference, ours, best = (
        np.mean(
            [
                row["delta_speed_frac"]
                for row in rows
                if row["decider"] == word and scenario in (None, row["scenario"])
            ]
        )
        for word in (REFERENCE, decider, ceilings[0])
    )
    return float((reference - ours) / (reference - best)) if reference > best else None


def kind(decider: str) -> str:
    """What a decider is, without its file, distance or base."""
    return decider.partition(":")[0]


def markdown(rows: Sequence[Row]) -> str:
    """One table: deciders by scenario, the paper's cells last."""
    shown = {
        name: head
        for name, head in SHOWN.items()
        if any(row.get(name) is not None for row in rows)
    }
    heads = [head for head, _ in shown.values()]
    lines = [
        f"| scenario | decider | {' | '.join(heads)} | paper: delta speed, %, and changes |",
        "|---" * (len(shown) + 3) + "|",
    ]
    for row in rows:
        cells = [_cell(row, name, factor) for name, (_, factor) in shown.items()]
        cell = _paper(row["scenario"], row["decider"])
        paper = f"{cell[0]:.1f}; {cell[1]:.2f}" if cell else ""
        name = f"{row['scenario']} | {row['decider']}"
        lines.append(f"| {name} | {' | '.join(cells)} | {paper} |")
    lines.append("")
    lines.append(
        f"In brackets: the 95 % interval (t) of the mean paired difference to {REFERENCE}."
    )
    for decider in dict.fromkeys(row["decider"] for row in rows):
        share = _kept(rows, decider, None)
        if share is not None and kind(decider) != CEILING:
            text = f"{decider}: {100 * share:.0f} % of the ceiling's gain in the mean of the scenarios."
            lines.append(text)
    return "\n".join(lines) + "\n"


def _paper(scenario: str, decider: str) -> tuple[float, float] | None:
    """The paper's cell beside ours."""
    cells = dict(zip(PAPER_DECIDERS, PAPER.get(scenario, ()), strict=False))
    return cells.get("dqn" if kind(decider) == "dqn" else decider)


def _cell(row: Row, name: str, factor: float) -> str:
    value = row.get(name)
    if value is None:
        return ""
    if isinstance(value, int):
        return str(value)
    text = f"{factor * value:.{0 if name in ('distance_m', 'kept_gain_frac') else 2}f}"
    compared = name in ("delta_speed_frac", "lane_changes", "fuel_g_km")
    if compared and row["decider"] != REFERENCE and name in row["paired"]:
        low, high = (factor * x for x in row["paired"][name]["t"])
        text += f" ({low:+.2f} to {high:+.2f})"
    return text


def write(
    results: Results, rows: Sequence[Row], about: Mapping[str, Any], out: Path
) -> None:
    """Writes `table2.json`, `table2.csv`, `table2.md` and `episodes.csv`; `rows` sum up `results`."""
    out.mkdir(parents=True, exist_ok=True)
    document = {**about, "reference": REFERENCE, "rows": rows}
    (out / "table2.json").write_text(json.dumps(document, indent=1) + "\n")
    (out / "table2.md").write_text(markdown(rows))
    with (out / "table2.csv").open("w", newline="") as file:
        flat = [
            {
                **{
                    k: v
                    for k, v in row.items()
                    if k not in ("minus_rules_50", "paired")
                },
                **{
                    f"minus_rules_50_{k}": v
                    for k, v in (row["minus_rules_50"] or {}).items()
                },
            }
            for row in rows
        ]
        table = csv.DictWriter(file, list(flat[0]))
        table.writeheader()
        table.writerows(flat)
    with (out / "episodes.csv").open("w", newline="") as file:
        lines = csv.writer(file)
        for scenario, by_decider in results.items():
            for decider, figures in by_decider.items():
                if file.tell() == 0:
                    lines.writerow(["scenario", "decider", *figures])
                columns = (column.tolist() for column in figures.values())
                episodes = zip(*columns, strict=True)
                lines.writerows([scenario, decider, *one] for one in episodes)


def plot(rows: Sequence[Row], file: Path) -> None:
    """The front of delta speed over lane changes, a field per scenario."""
    from matplotlib.figure import Figure

    scenarios = list(dict.fromkeys(row["scenario"] for row in rows))
    deciders = list(dict.fromkeys(row["decider"] for row in rows))
    figure = Figure(figsize=(11, 7), layout="constrained")
    fields = figure.subplots(2, -(-len(scenarios) // 2), squeeze=False).T.ravel()
    for row in rows:
        field = fields[scenarios.index(row["scenario"])]
        decider = row["decider"]
        color = f"C{deciders.index(decider)}"
        mark = "*" if kind(decider) == CEILING else "o"
        x, y = row["lane_changes"], 100 * row["delta_speed_frac"]
        field.plot(x, y, mark, color=color, label=decider.split("/")[-1])
        cell = _paper(row["scenario"], decider)
        if cell:
            field.plot(cell[1], cell[0], "o", color=color, mfc="none")
        field.set(title=row["scenario"], xlabel="lane changes", ylabel="delta speed, %")
    fields[0].plot([], [], "o", color="gray", mfc="none", label="hollow: the paper's")
    fields[0].legend(fontsize="small")
    figure.savefig(file)
