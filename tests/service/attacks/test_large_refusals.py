"""A refusal is small, however much is wrong."""

import json
from typing import Any

import pytest

from hybridmpm_service.http.problems import MAX_ERRORS, Row, problem_response
from hybridmpm_service.http.requests import MAX_VALUES

_SCENE = {"dim": 2, "bodies": []}
_MANY = MAX_VALUES // 2
_BOX = {"shape": "box", "material": "water", "lower": [], "upper": []}
_ROUTES = ("", "/advance", "/sketches", "/trajectories")
_BODIES = {"scene": {"dim": 2, "bodies": [{}] * 690_000}}
HOSTILE: list[tuple[str, dict[str, Any]]] = [
    *((route, _BODIES) for route in _ROUTES),
    ("", {"scene": {"dim": 2, "bodies": [{}] * _MANY}}),
    ("", {"scene": {"dim": 2, "bodies": [_BOX] * 1000}}),
    ("", {"scene": _SCENE | {f"{i:060}": 1 for i in range(_MANY)}}),
    ("", {"scene": {"dim": 2, "bodies": [{"shape": "\x00" * 300_000}]}}),
    ("", {"scenario": "\x00" * 300_000}),
    ("", {"log": {"inputs": [{}] * 80_000}}),
    ("", {"log": {"inputs": [{"kind": "push", "frame": 0, "push": {}}] * 20_000}}),
    ("", {"log": {"scene": {"bodies": [{}] * MAX_VALUES}}}),
    ("/advance", {"log": {"inputs": [{}] * MAX_VALUES}}),
    ("/advance", {f"{i:060}": 1 for i in range(_MANY)}),
    ("/advance", {"\u00e9\x00" * 100_000: 1}),
    ("/sketches", {"strokes": [{"points": [[2, -2]] * 4096}]}),
    ("/trajectories", {"strokes": [{}] * _MANY}),
]


@pytest.mark.parametrize(("route", "body"), HOSTILE, ids=range(len(HOSTILE)))
def test_the_answer_to_a_hostile_body_is_small(
    service: Any, problem: Any, shared_path: str, route: str, body: dict[str, Any]
) -> None:
    address = shared_path + route if route else "/v1/sessions"
    content = json.dumps(body, separators=(",", ":"))
    found = service.http.post(address, content=content, headers={"Content-Type": "application/json"})
    problem(found, 422)
    assert len(found.content) < 64 * 1024
    assert len(found.json()["errors"]) <= MAX_ERRORS


def test_the_largest_refusal_of_all_is_below_64_kb() -> None:
    text = "\x00" * 10_000
    answer = problem_response(text, Row(422, "slug", "Title"), text, [(text, text)] * 1000)
    assert len(answer.body) < 64 * 1024


@pytest.fixture(scope="module")
def shared_path(service: Any) -> str:
    """Return the path of a session that all tests of this module refuse something for."""
    path: str = service.create()
    return path


@pytest.mark.parametrize("text", ["[" * 1000, json.dumps([0] * MAX_VALUES), '{"type": "' + "\x7f" * 60_000])
def test_a_hostile_message_of_a_stream_is_refused_and_the_stream_goes_on(
    service: Any, shared_path: str, text: str
) -> None:
    with service.stream(shared_path) as stream:
        stream.connection.send(text[: 64 * 1024])
        refused = stream.text("problem")
        assert refused["detail"].startswith("message: ")
        assert len(refused["detail"]) <= 1000
        stream.send(type="speed", value=0.5)
        while stream.text("status")["session"]["speed"] != 0.5:
            pass
