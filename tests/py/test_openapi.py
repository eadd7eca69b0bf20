"""Every operation of the API, with right and wrong input, against its own OpenAPI document."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis.errors import Unsatisfiable
from running import Run, running
from schemathesis.core.result import Ok
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi.checks import positive_data_acceptance

OPERATIONS = 33
"""Paths and methods."""


@pytest.fixture(scope="module")
def run(server: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    options = ["flat", "--keep-open", "--pace", "max"]
    with running(server, tmp_path_factory.mktemp("api") / "out", *options) as run:
        yield run


OFTEN = settings(
    max_examples=60,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)


NAMES = {"/api/v1/sessions", "/api/v1/plan", "/api/v1/diagnose"}
"""What is asked for here is named, and a schema does not say which names there are."""


def unknown(operation: Any) -> list[Any]:
    """Checks that an operation cannot pass."""
    return [positive_data_acceptance] if operation.path in NAMES else []


@pytest.mark.parametrize("mode", list(GenerationMode))
def test_answers_are_as_the_document_says(run: Run, mode: GenerationMode) -> None:
    document = schemathesis.openapi.from_url(run.url + "/api/openapi.json")
    found = document.get_all_operations()
    operations = [operation.ok() for operation in found if isinstance(operation, Ok)]
    assert len(operations) == OPERATIONS
    asked = 0
    for operation in operations:

        @given(case=operation.as_strategy(mode))
        @OFTEN
        def ask(case: schemathesis.Case[Any]) -> None:
            nonlocal asked
            command = case.body if isinstance(case.body, dict) else {}
            if command.get("action") == "quit":
                return
            if (
                case.method == "DELETE"
                and case.path_parameters.get("session") == "default"
            ):
                # The end of the program
                return
            if isinstance(command.get("wait"), bool):
                # A million ticks take their time
                command["wait"] = False
            case.call_and_validate(timeout=60, excluded_checks=unknown(case.operation))
            asked += 1

        # Where nothing can be wrong there is nothing to try
        with contextlib.suppress(Unsatisfiable):
            ask()
    assert asked >= 60


def test_the_run_is_still_there(run: Run) -> None:
    paths = run.get("/api/openapi.json")["paths"]
    assert sum(len(methods) for methods in paths.values()) == OPERATIONS
    assert run.get("/api/v1/health")["status"] == "ok"
    assert run.get("/api/v1/ready")["status"] == "ready"
    assert run.finish() == 0
