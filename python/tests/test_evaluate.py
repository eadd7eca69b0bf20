"""The evaluation: statistics against known values, pairs of episodes, files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from tractrix.evaluate.__main__ import main
from tractrix.evaluate.deciders import decider
from tractrix.evaluate.drive import drive
from tractrix.evaluate.statistics import paired, t_quantile


def test_quantiles_of_students_t_are_those_of_the_tables() -> None:
    for degrees, wanted in ((4, 2.7764), (9, 2.2622), (19, 2.0930), (199, 1.9720)):
        assert t_quantile(0.975, degrees) == pytest.approx(wanted, rel=1e-3)
    assert t_quantile(0.025, 9) == pytest.approx(-t_quantile(0.975, 9))


def test_an_interval_of_pairs_by_hand() -> None:
    theirs = np.array([10.0, 20.0, 30.0, 40.0, 50.0])
    found = paired(theirs + [1.0, 2.0, 3.0, 4.0, 5.0], theirs)
    # Mean 3, standard deviation sqrt(2.5), standard error sqrt(0.5), t of 4 degrees 2.7764.
    assert found.mean == pytest.approx(3.0)
    assert found.t == pytest.approx((3.0 - 1.9632, 3.0 + 1.9632), rel=2e-3)
    low, high = found.bootstrap
    assert 1.5 < low < 2.0 and 4.0 < high < 4.5
    assert paired(theirs, theirs).t == (0.0, 0.0)
    with pytest.raises(ValueError, match="not pairs"):
        paired(theirs, theirs[:4])
    with pytest.raises(ValueError, match="under 5"):
        paired(theirs[:4], theirs[:4])


def test_intervals_hold_what_they_promise() -> None:
    rng = np.random.default_rng(4)
    zero = np.zeros(20)
    held = np.zeros(2)
    for _ in range(300):
        found = paired(rng.normal(1.0, 2.0, 20), zero)
        held += [low < 1.0 < high for low, high in (found.t, found.bootstrap)]
    # 95 % of 300 is 285; the bootstrap of 20 is a little narrow.
    assert held[0] >= 274 and held[1] >= 262


def test_every_decider_gets_the_same_traffic() -> None:
    scenarios, seeds = ["table2-medium-15", "table2-sparse-12.5"], [5, 6, 7]
    keep, mobil = (
        drive(decider(word)[0], scenarios, seeds, episode_s=90.0)
        for word in ("keep", "mobil")
    )
    assert keep["seed"].tolist() == mobil["seed"].tolist() == [seeds, seeds]
    assert (keep["time_s"] == mobil["time_s"]).all()
    assert (keep["lane_changes"] == 0).all() and mobil["lane_changes"].sum() > 0
    alone = drive(decider("keep")[0], scenarios[1:], seeds, episode_s=90.0)
    assert (alone["distance_m"][0] == keep["distance_m"][1]).all()
    same = (mobil["lane_changes"] == 0) & (mobil["refused"] == 0)
    assert (keep["distance_m"] == mobil["distance_m"])[same].all()


def test_the_files_of_an_evaluation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenarios = ["table2-sparse-12.5", "table2-medium-12.5"]
    given = ["--seeds", "5", "--duration-s", "60", "--out", str(tmp_path)]
    main([*given, "--deciders", "mobil,dqn", "ceiling:keep", "--scenarios", *scenarios])
    table = (tmp_path / "table2.md").read_text()
    assert capsys.readouterr().out == table
    assert "| table2-sparse-12.5 | rules:50 |" in table and "4.4; 2.99 |" in table
    assert "| 3.4; 3.02 |" in table, "the paper's network beside ours"
    results = json.loads((tmp_path / "table2.json").read_text())
    rows = {(row["scenario"], row["decider"]): row for row in results["rows"]}
    words = ["rules:50", "mobil", "dqn", "ceiling:keep"]
    assert list(rows) == [(name, word) for name in scenarios for word in words]
    with (tmp_path / "episodes.csv").open() as file:
        episodes = list(csv.DictReader(file))
    assert len(episodes) == 2 * 4 * 5

    def of(word: str, name: str = "delta_speed_frac") -> list[float]:
        return [
            float(episode[name])
            for episode in episodes
            if (episode["scenario"], episode["decider"]) == (scenarios[1], word)
        ]

    row = rows[scenarios[1], "mobil"]
    assert row["delta_speed_frac"] == pytest.approx(np.mean(of("mobil")))
    assert row["distance_m"] == pytest.approx(np.sum(of("mobil", "distance_m")))
    gained = np.mean(of("mobil")) - np.mean(of("rules:50"))
    difference = row["minus_rules_50"]
    assert difference["mean"] == pytest.approx(gained)
    assert difference["low"] <= difference["mean"] <= difference["high"]
    best = np.mean(of("ceiling:keep")) - np.mean(of("rules:50"))
    assert best < 0.0 and row["kept_gain_frac"] == pytest.approx(gained / best)
    assert rows[scenarios[1], "ceiling:keep"]["kept_gain_frac"] == pytest.approx(1.0)
    own = rows[scenarios[1], "rules:50"]
    assert own["kept_gain_frac"] is None and own["minus_rules_50"]["high"] == 0.0
    assert all(
        row["ego_caused_collisions"] <= row["collisions"] for row in rows.values()
    )
    assert results["seed"] == 0 and results["schema"] == 1
    with (tmp_path / "table2.csv").open() as file:
        flat = list(csv.DictReader(file))
    assert float(flat[5]["minus_rules_50_mean"]) == pytest.approx(gained)
    assert "fuel_g_km" not in flat[0], "a kinematic ego has no engine"


def test_the_full_truck_has_fuel_and_another_interval_another_traffic(
    tmp_path: Path,
) -> None:
    given = ["--seeds", "1", "--duration-s", "20", "--deciders", "mobil"]
    given += ["--scenarios", "table2-medium-12.5", "--fidelity", "truck"]
    main([*given, "--out", str(tmp_path / "a")])
    main([*given, "--out", str(tmp_path / "b"), "--spawn-interval-s", "0.1"])
    first, second = (
        json.loads((tmp_path / name / "table2.json").read_text())["rows"][0]
        for name in "ab"
    )
    # 8 to 120 l/100 km
    assert 70.0 < first["fuel_g_km"] < 1_000.0 and first["minus_rules_50"] is None
    assert first["delta_speed_frac"] != second["delta_speed_frac"]


def test_words_that_are_no_decider_are_named() -> None:
    with pytest.raises(ValueError, match="fast"):
        drive(decider("fast")[0], ["table2-sparse-15"], [1], episode_s=5.0)
    with pytest.raises(FileNotFoundError, match="nothing"):
        decider("dqn:nothing.safetensors")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--deciders", "fast"], "fast"),
        (["--weights", "nothing.safetensors", "--deciders", "dqn"], "nothing"),
        (["--seeds", "0"], "--seeds 0"),
        (["--fidelity", "paper", "--deciders", "mobil"], "fidelity"),
        (
            ["--scenarios", "flat", "--spawn-interval-s", "0.2"],
            "flat: no traffic.family",
        ),
    ],
)
def test_wrong_words_are_one_line_and_exit_code_2(
    words: list[str],
    named: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    given = ["--scenarios", "table2-sparse-15", "--duration-s", "5", "--seeds", "1"]
    with pytest.raises(SystemExit) as refused:
        main([*given, "--out", str(tmp_path), *words])
    assert refused.value.code == 2 and named in capsys.readouterr().err
