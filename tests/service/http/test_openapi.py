"""The OpenAPI document: complete, resolvable, with examples that the models accept."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from pydantic import BaseModel

from hybridmpm_service import Settings, create_app
from hybridmpm_service.http import answers, creation, jobs, logs, outlines, requests, sketches
from hybridmpm_service.http.answers import HistoryBody
from hybridmpm_service.sessions.view import Forces
from hybridmpm_service.typescript import FILE, types

INTERFACE = Path(__file__).parents[3] / "docs" / "reference" / "http-api.md"
MODELS = {
    name: model
    for module in (answers, creation, jobs, logs, outlines, requests, sketches)
    for name, model in vars(module).items()
    if isinstance(model, type) and issubclass(model, BaseModel) and "examples" in str(model.model_config)
}


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    return create_app(Settings()).openapi()


def _operations(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    for address, item in document["paths"].items():
        for method, operation in item.items():
            yield method, address, operation


def _references(node: Any) -> Iterator[str]:
    if isinstance(node, dict):
        if isinstance(node.get("$ref"), str):
            yield node["$ref"]
        for value in node.values():
            yield from _references(value)
    elif isinstance(node, list):
        for value in node:
            yield from _references(value)


def test_it_lists_exactly_the_operations_of_the_contract(document: dict[str, Any]) -> None:
    rows = re.findall(r"^\| `([A-Z]+) ([^`?]+)", INTERFACE.read_text(encoding="utf-8"), re.MULTILINE)
    found = [(method.upper(), re.sub("{.*_id}", "{id}", path)) for method, path, _ in _operations(document)]
    assert sorted([*found, ("WS", "/v1/sessions/{id}/stream")]) == sorted(rows)


def test_examples_of_the_contract_name_fields_that_there_are(document: dict[str, Any], service: Any) -> None:
    records = [set(schema.get("properties", {})) for schema in document["components"]["schemas"].values()]
    with service.stream(service.create()) as stream:
        hello = stream.text("hello")
    # What streams alone send.
    records += [set(hello), *(set(model.model_fields) for model in (Forces, HistoryBody))]
    examples = re.findall(r"```json\n(.*?)```", INTERFACE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(examples) > 12
    for example in examples:
        fields = set(json.loads(example))
        assert any(fields <= record for record in records), f"no body has the fields {sorted(fields)}"


def test_every_reference_resolves(document: dict[str, Any]) -> None:
    references = set(_references(document))
    assert len(references) > 8
    for reference in references:
        node = document
        for part in reference.removeprefix("#/").split("/"):
            node = node[part]
        assert node


def test_every_refusal_is_described_as_a_problem(document: dict[str, Any]) -> None:
    for method, address, operation in _operations(document):
        assert operation["description"]
        for status, answer in operation["responses"].items():
            if int(status) >= 400:
                assert list(answer["content"]) == ["application/problem+json"], (method, address, status)


def test_every_operation_with_a_body_or_an_answer_of_ours_has_examples(document: dict[str, Any]) -> None:
    plain = {"Health", "JobBody", "PlanBody", "RecordSession"}
    used = json.dumps(document["paths"])
    named = set(re.findall(r'"application/json": \{"schema": \{"\$ref": "#/components/schemas/(\w+)"', used))
    assert {name for name in named if not name.endswith("List")} <= MODELS.keys() | plain


@pytest.mark.parametrize("name", MODELS)
def test_examples_are_accepted_by_their_models(name: str) -> None:
    for example in MODELS[name].model_json_schema()["examples"]:
        MODELS[name].model_validate(example)


def test_the_examples_of_requests_work(service: Any) -> None:
    for example in creation.CreateSession.model_json_schema()["examples"]:
        answer = service.http.post("/v1/sessions", json=example)
        assert answer.status_code == 201, answer.text
        path = answer.json()["links"]["self"]
        for sketch in requests.SketchRequest.model_json_schema()["examples"]:
            assert service.http.post(f"{path}/sketches", json=sketch).status_code == 200
        for advance in requests.AdvanceSession.model_json_schema()["examples"]:
            assert service.http.post(f"{path}/advance", json=advance).status_code == 200
        service.http.delete(path)
    for plan in creation.PlanRequest.model_json_schema()["examples"]:
        answer = service.http.post("/v1/plans", json=plan)
        assert answer.status_code == 200, answer.text


@pytest.mark.parametrize(
    ("body", "valid"),
    [
        ({"scenario": "water_2d", "seed": 3}, True),
        ({"scenario": "water_2d", "scene": None}, True),
        ({"scene": {}}, True),
        ({"scene": {}, "seed": None}, True),
        ({}, False),
        ({"scenario": "water_2d", "scene": {}}, False),
        ({"scene": {}, "seed": 3}, False),
        ({"scenario": None}, False),
    ],
)
def test_the_schema_says_that_a_session_has_either_a_scenario_or_a_scene(
    document: dict[str, Any], body: dict[str, Any], *, valid: bool
) -> None:
    schema = {"$ref": "#/components/schemas/CreateSession", "components": document["components"]}
    assert Draft202012Validator(schema).is_valid(body) == valid


def test_forms_that_cannot_be_read_are_described(document: dict[str, Any], service: Any, path: str) -> None:
    for suffix in ("sketches", "trajectories"):
        assert "400" in document["paths"]["/v1/sessions/{session_id}/" + suffix]["post"]["responses"]
        answer = service.http.post(
            f"{path}/{suffix}", content=b"x", headers={"Content-Type": "multipart/form-data"}
        )
        assert answer.status_code == 400


def test_it_is_served(service: Any, document: dict[str, Any]) -> None:
    assert service.http.get("/openapi.json").json() == json.loads(json.dumps(document))


def test_the_types_of_the_client_are_those_of_the_document(document: dict[str, Any]) -> None:
    written = types(document)
    assert FILE.read_text(encoding="utf-8") == written, "run `make types`"
    assert (
        "export interface SessionBody {\n  /** Name of the session in its address. */\n  id: string;\n"
        in written
    )
