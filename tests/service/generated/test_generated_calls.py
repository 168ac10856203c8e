"""Calls that nobody thought of: generated from the OpenAPI document, with all of schemathesis's checks."""

from collections.abc import Callable, Iterator
from http import HTTPStatus
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import Case, GenerationMode
from schemathesis.schemas import APIOperation
from schemathesis.specs.openapi.checks import positive_data_acceptance

from hybridmpm_service import Settings, create_app

FEW, MANY = 2, 300
"""Examples of each operation in `make test`, and in `make test-all`."""
_QUIET = settings(deadline=None, suppress_health_check=list(HealthCheck))

document = schemathesis.openapi.from_dict(create_app(Settings()).openapi())
OPERATIONS = [found.ok() for found in document.get_all_operations()]
there: dict[str, str] = {}
"""Values of parameters of paths that name something, by parameter."""


@document.hook
def map_path_parameters(_context: Any, parameters: dict[str, Any] | None) -> dict[str, Any] | None:
    """Let half of the calls find what they name."""
    for name in parameters or {}:
        if parameters is not None and name in there and len(str(parameters[name])) % 2:
            parameters[name] = there[name]
    return parameters


@pytest.fixture(scope="module")
def service(start_module: Callable[..., Any]) -> Any:
    return start_module(max_dataset_frames=20, max_sketch_frames=20, max_advance_frames=20)


@pytest.fixture
def call(service: Any, path: str) -> Iterator[Callable[[Case], None]]:
    """Return a function that makes a call, and checks the answer, of a service with a session and a job."""
    job = service.http.post(f"{path}/recordings", json={"frames": 1}).json()["id"]
    there.update(session_id=path.rpartition("/")[2], job_id=job, name="water_2d")

    def send(case: Case) -> None:
        answer = case.call(base_url=f"http://{service.address}")
        made = answer.headers.get("location")
        if made is not None:
            service.http.delete(made[0])
        case.validate_response(answer, excluded_checks=[positive_data_acceptance])
        if answer.status_code == HTTPStatus.UNPROCESSABLE_ENTITY:
            # A schema cannot say that a stroke must have a length: such a refusal names the field.
            assert answer.json()["errors"] or ":" in answer.json()["detail"]

    yield send
    there.clear()


def _generate(operation: APIOperation, call: Callable[[Case], None], examples: int) -> None:
    """Make calls of an operation that fit its schema, and as many that do not."""
    for mode in GenerationMode:
        try:
            cases = operation.as_strategy(generation_mode=mode)

            @settings(_QUIET, max_examples=examples, derandomize=examples == FEW)
            @given(case=cases)
            def make(case: Case) -> None:
                call(case)

            make()
        except Unsatisfiable:
            # What takes nothing cannot be asked wrongly.
            assert mode == GenerationMode.NEGATIVE


@pytest.mark.parametrize("operation", OPERATIONS, ids=[one.label for one in OPERATIONS])
def test_a_few_calls(operation: APIOperation, call: Callable[[Case], None]) -> None:
    _generate(operation, call, FEW)


@pytest.mark.long
@pytest.mark.parametrize("operation", OPERATIONS, ids=[one.label for one in OPERATIONS])
def test_many_calls(operation: APIOperation, call: Callable[[Case], None]) -> None:
    _generate(operation, call, MANY)
