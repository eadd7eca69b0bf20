"""The evaluation's files: every episode, the means with their intervals, tables, a plot."""

from __future__ import annotations

import csv
import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tractrix.evaluate.statistics import LEAST_PAIRS, paired

Figures = Mapping[str, npt.NDArray[Any]]
"""Figures of a decider in a scenario, each with a number per seed."""
Results = Mapping[str, Mapping[str, Figures]]
"""By scenario, then by decider."""

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
PAPER_DECIDERS = ("rules:150", "rules:100", "rules:50", "learned")
"""The paper's conservative, neutral and aggressive rule, and its network."""

SHOWN = {
    "delta_speed_frac": ("delta speed, %", 100.0),
    "lane_changes": ("lane changes", 1.0),
    "aborted": ("aborted", 1.0),
    "refused": ("refused", 1.0),
    "hard_braking_caused": ("hard braking caused", 1.0),
    "collided": ("collisions", 1.0),
}
"""Figures of an episode in the tables: heading and factor."""
COMPARED = ("delta_speed_frac", "lane_changes")
"""Those whose intervals the table shows; the others' are in `results.json`."""


def summary(results: Results, reference: str) -> dict[str, Any]:
    """Means of every decider, and its paired differences to `reference`."""
    table: dict[str, Any] = {}
    for scenario, by_decider in results.items():
        rows = table[scenario] = {}
        for decider, figures in by_decider.items():
            row: dict[str, Any] = {}
            for name in SHOWN:
                values = figures[name].astype(np.float64)
                row[name] = {"mean": float(values.mean())}
                if decider != reference and len(values) >= LEAST_PAIRS:
                    other = by_decider[reference][name].astype(np.float64)
                    difference = dataclasses.asdict(paired(values, other))
                    row[name]["minus_reference"] = difference
            rows[decider] = row
    return table


def markdown(table: Mapping[str, Any], reference: str) -> str:
    """One table: deciders by scenario, the paper's cells last."""
    heads = [head for head, _ in SHOWN.values()]
    lines = [
        f"| scenario | decider | {' | '.join(heads)} | paper: delta speed, %, and changes |",
        "|---" * (len(SHOWN) + 3) + "|",
    ]
    for scenario, rows in table.items():
        cells = dict(zip(PAPER_DECIDERS, PAPER.get(scenario, ()), strict=False))
        for decider, row in rows.items():
            shown = [
                _cell(row[name], factor, name in COMPARED)
                for name, (_, factor) in SHOWN.items()
            ]
            learned = decider.startswith("dqn:")
            cell = cells.get("learned" if learned else decider)
            paper = f"{cell[0]:.1f}; {cell[1]:.2f}" if cell else ""
            lines.append(f"| {scenario} | {decider} | {' | '.join(shown)} | {paper} |")
    lines.append("")
    lines.append(
        f"In brackets: the 95 % interval (t) of the mean paired difference to {reference}."
    )
    return "\n".join(lines) + "\n"


def _cell(row: Mapping[str, Any], factor: float, compared: bool) -> str:
    text = f"{factor * row['mean']:.2f}"
    if compared and "minus_reference" in row:
        low, high = (factor * x for x in row["minus_reference"]["t"])
        text += f" ({low:+.2f} to {high:+.2f})"
    return text


def write(
    results: Results,
    table: Mapping[str, Any],
    reference: str,
    about: Mapping[str, Any],
    out: Path,
) -> None:
    """Writes `results.json`, `episodes.csv` and `table.md`; `table` is the summary of `results`."""
    out.mkdir(parents=True, exist_ok=True)
    document = {**about, "reference": reference, "scenarios": table}
    (out / "results.json").write_text(json.dumps(document, indent=1) + "\n")
    with (out / "episodes.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        for scenario, by_decider in results.items():
            for decider, figures in by_decider.items():
                if file.tell() == 0:
                    rows.writerow(["scenario", "decider", *figures])
                columns = (column.tolist() for column in figures.values())
                episodes = zip(*columns, strict=True)
                rows.writerows([scenario, decider, *row] for row in episodes)
    (out / "table.md").write_text(markdown(table, reference))


def plot(table: Mapping[str, Any], file: Path) -> None:
    """The front of delta speed over lane changes, a field per scenario; the paper's cells hollow."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7), layout="constrained")
    fields = figure.subplots(2, -(-len(table) // 2), squeeze=False).T.ravel()
    deciders = list(dict.fromkeys(d for rows in table.values() for d in rows))
    for field, (scenario, rows) in zip(fields, table.items(), strict=False):
        for decider, row in rows.items():
            color = f"C{deciders.index(decider)}"
            x, y = row["lane_changes"]["mean"], 100 * row["delta_speed_frac"]["mean"]
            field.plot(x, y, "o", color=color, label=decider.split("/")[-1])
            for of, cell in zip(PAPER_DECIDERS, PAPER.get(scenario, ()), strict=False):
                if of == decider or (of == "learned" and decider.startswith("dqn:")):
                    field.plot(cell[1], cell[0], "o", color=color, mfc="none")
        field.set(title=scenario, xlabel="lane changes", ylabel="delta speed, %")
    fields[0].legend(fontsize="small")
    figure.savefig(file)
