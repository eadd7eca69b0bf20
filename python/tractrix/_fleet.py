"""Many trucks over many weeks: a diagnosis each, and what became of each cause."""

from __future__ import annotations

import concurrent.futures
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tractrix import _native
from tractrix._arguments import path as as_text
from tractrix._arguments import whole
from tractrix._cluster import ATTEMPTS, each
from tractrix._fleet_page import page

_WORKER = "from tractrix._fleet import work; work()"


@dataclass(frozen=True)
class Unit:
    """One truck in one week."""

    truck: str
    week: str
    drives: str
    truck_file: str
    baseline: str | None
    seed: int
    result: str


def diagnose_many(
    fleet: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str],
    truck: str | os.PathLike[str] | None = None,
    baseline: str = "baseline",
    processes: int | None = None,
    ray: bool = False,
    seed: int = 1,
) -> list[dict[str, Any]]:
    """Diagnoses every week of every truck: `FLEET/TRUCK/WEEK/drives.toml`.

    Args:
        fleet: A folder for each truck, in it a folder of drives for each week, in the order
            of their names.
        out: Folder for a result of each week (`units/TRUCK/WEEK.json`), `causes.parquet` and
            `summary.html`. Weeks whose result is there and whose inputs have not changed are
            not computed again.
        truck: The truck file of all trucks, or a built-in name. Default:
            `FLEET/TRUCK/truck.toml` of each.
        baseline: Name of the folder beside a truck's weeks with its drives in order; a truck
            without it is diagnosed with default tolerances.
        processes: How many weeks at once, each in a process of its own. Default: the number
            of cores.
        ray: Sends the weeks to a Ray cluster, which must see the same folders
            (`pip install "tractrix[scale]"`).
        seed: Seed of the intervals of the gain.

    Returns:
        The rows of `causes.parquet`: one for each parameter of each cause that was named, and
        one without a cause for a week in which none was, with `verdict` and `error`.

    The result of a week depends on its inputs alone, not on where it was computed. A worker
    that is killed costs its own week only, which is begun again; after three times the week
    has an `error`. A week that cannot be diagnosed has an `error` too and stops nobody else.

    Raises:
        ValueError: No week of drives in the folder, or no truck file for it.
        FileNotFoundError: There is no such folder.
        ImportError: pyarrow or Ray is missing (`pip install "tractrix[fleet]"`, `[scale]`).
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError as missing:
        hint = 'causes.parquet is written with: pip install "tractrix[fleet]"'
        raise ImportError(hint) from missing
    count = whole("processes", os.cpu_count() or 1 if processes is None else processes)
    if count < 1:
        raise ValueError("processes = 0: one at least")
    target = Path(out)
    units = list(
        _units(Path(fleet), target, as_text(truck), baseline, whole("seed", seed))
    )
    if not units:
        raise ValueError(f"{os.fspath(fleet)}: no TRUCK/WEEK/drives.toml in it")
    digests = {unit: _digest(unit) for unit in units}
    open_units = [unit for unit in units if _finished(unit, digests[unit]) is None]
    if ray:
        arguments = [(unit, digests[unit]) for unit in open_units]
        each(_compute, arguments, at_once=count, lost=_lost)
    else:
        with concurrent.futures.ThreadPoolExecutor(count) as pool:
            list(pool.map(lambda unit: _in_process(unit, digests[unit]), open_units))
    rows = [
        row for unit in units for row in _rows(unit, _finished(unit, digests[unit]))
    ]
    _write_parquet(rows, target / "causes.parquet")
    _write_whole(target / "summary.html", page(rows))
    return rows


def _units(
    fleet: Path, out: Path, truck: str | None, baseline: str, seed: int
) -> Iterator[Unit]:
    for home in sorted(p for p in fleet.iterdir() if p.is_dir()):
        weeks = sorted(p.parent for p in home.glob("*/drives.toml"))
        weeks = [week for week in weeks if week.name != baseline]
        own = home / "truck.toml"
        if weeks and truck is None and not own.is_file():
            raise ValueError(
                f"{own}: no such file, and no truck for all of them (truck)"
            )
        in_order = home / baseline
        for week in weeks:
            yield Unit(
                truck=home.name,
                week=week.name,
                drives=str(week),
                truck_file=str(own) if truck is None else truck,
                baseline=str(in_order)
                if (in_order / "drives.toml").is_file()
                else None,
                seed=seed,
                result=str(out / "units" / home.name / f"{week.name}.json"),
            )


def _digest(unit: Unit) -> str:
    """Of all that the result depends on: the files and the program."""
    digest = hashlib.sha256(
        f"{_native.VERSION} {_native.GIT_REVISION} {unit.seed}".encode()
    )
    folders = [unit.drives] if unit.baseline is None else [unit.drives, unit.baseline]
    files = [
        p for folder in folders for p in sorted(Path(folder).rglob("*")) if p.is_file()
    ]
    truck_file = Path(unit.truck_file)
    digest.update(unit.truck_file.encode())
    if truck_file.is_file():
        # what an overlay builds on lies beside it
        files += sorted(truck_file.parent.glob("*.toml"))
    for file in files:
        digest.update(f"{file.name} {file.stat().st_size} ".encode())
        with file.open("rb") as content:
            digest.update(hashlib.file_digest(content, "sha256").digest())
    return digest.hexdigest()


def _finished(unit: Unit, digest: str) -> dict[str, Any] | None:
    """The result, if it is there, whole, and of these inputs."""
    try:
        found: dict[str, Any] = json.loads(Path(unit.result).read_text())
    except (OSError, ValueError):
        return None
    return found if found.get("inputs_sha256") == digest else None


def _write_whole(path: Path, text: str) -> None:
    """Either the whole file or none, whenever the process ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    half = path.with_name(f".{path.name}.{os.getpid()}")
    half.write_text(text)
    half.replace(path)


def _compute(unit: Unit, digest: str) -> None:
    """Diagnoses a week and writes its result; what is wrong with its drives is a result too."""
    result: dict[str, Any] = {"inputs_sha256": digest}
    try:
        result["diagnosis"] = json.loads(
            _native.diagnose_json(
                unit.truck_file,
                unit.drives,
                baseline=unit.baseline,
                hold_out=[],
                table_effect=False,
                seed=unit.seed,
                out=None,
            )
        )
    except (OSError, ValueError, RuntimeError) as error:
        result["error"] = str(error)
    _write_whole(Path(unit.result), json.dumps(result, sort_keys=True))


def _in_process(unit: Unit, digest: str) -> None:
    """The same in a process of its own, begun again if that dies."""
    words = json.dumps({"unit": asdict(unit), "digest": digest})
    for _ in range(ATTEMPTS):
        command = [sys.executable, "-c", _WORKER, words]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if _finished(unit, digest) is not None:
            return
    how = ended.stderr.strip().splitlines()[-1:] or [f"exit code {ended.returncode}"]
    _lost(unit, digest, how[0])


def _lost(unit: Unit, digest: str, how: object) -> None:
    """The result of a week whose worker died every time."""
    error = f"the worker died {ATTEMPTS} times: {how}"
    result = {"inputs_sha256": digest, "error": error}
    _write_whole(Path(unit.result), json.dumps(result, sort_keys=True))


def _rows(unit: Unit, found: dict[str, Any] | None) -> Iterator[dict[str, Any]]:
    """What is told of a week, a row for each parameter."""
    found = {"error": "no result"} if found is None else found
    diagnosis = found.get("diagnosis", {})
    row: dict[str, Any] = {
        "truck": unit.truck,
        "week": unit.week,
        "verdict": diagnosis.get("verdict"),
        "error": found.get("error"),
        "cause": None,
        "parameter": None,
        "value": None,
        "sigma": None,
        "unit": None,
        "evidence_nats": None,
        "probability": None,
    }
    causes = diagnosis.get("causes", [])
    for cause in causes:
        for name, size in cause["parameters"].items():
            yield row | {
                "cause": cause["id"],
                "parameter": name,
                "value": size["value"],
                "sigma": size["sigma"],
                "unit": size["unit"],
                "evidence_nats": cause["evidence"],
                "probability": cause["probability"],
            }
    if not causes:
        yield row


def _write_parquet(rows: Sequence[dict[str, Any]], to: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    numbers = {"value", "sigma", "evidence_nats", "probability"}
    kind = {name: pa.float64() if name in numbers else pa.string() for name in rows[0]}
    table = pa.Table.from_pylist(list(rows), schema=pa.schema(list(kind.items())))
    half = to.with_name(f".{to.name}.{os.getpid()}")
    parquet.write_table(table, half)
    half.replace(to)


def work() -> None:
    """What a worker does with its one argument."""
    given = json.loads(sys.argv[1])
    _compute(Unit(**given["unit"]), given["digest"])
