"""Whatever is wrong with a request: a problem that names the field, and nothing else is lost."""

import json
from typing import Any

import pytest
from tests.service.conftest import problem

from hybridmpm_service.settings import Settings

BODY: dict[str, Any] = {"shape": "box", "lower": [0.4, 0.4], "upper": [0.6, 0.6], "material": "water"}
JET: dict[str, Any] = {
    "shape": "round",
    "center": [0.5, 0.8],
    "radius": 0.05,
    "velocity": [0, -1],
    "material": "water",
}
JSON = {"Content-Type": "application/json"}

SKETCHES = [("POST", "/sketches"), ("DELETE", "/sketches"), ("POST", "/trajectories")]


def _scene(**changes: Any) -> dict[str, Any]:
    return {"scene": {"dim": 2, "resolution": 32, "bodies": [BODY]} | changes}


def _body(**changes: Any) -> dict[str, Any]:
    return _scene(bodies=[BODY | changes])


@pytest.fixture(autouse=True)
def _nothing_is_lost(service: Any, path: str) -> Any:
    """Run every test beside a session, and look afterwards whether it is as it was."""
    service.http.post(f"{path}/advance", json={"frames": 2})
    before = service.http.get(path).json()
    yield
    assert service.http.get(path).json() == before
    assert service.http.post(f"{path}/advance", json={}).json()["frame"] == 3
    assert service.http.get("/readyz").status_code == 200


@pytest.mark.parametrize(
    ("body", "field", "message"),
    [
        ({"scenario": "lava_2d"}, "body.scenario", "water_2d, water_ramps_2d"),
        ({"scenario": "water_2d", "seed": -1}, "body.seed", "greater than or equal to 0"),
        ({"scenario": "water_2d", "seed": "1"}, "body.seed", "integer"),
        ({"scenario": "water_2d", "color": "red"}, "body.color", "not permitted"),
        ({}, "body", "scenario"),
        ({"scenario": "water_2d", **_scene()}, "body", "give one of"),
        ({"seed": 1, **_scene()}, "body", "seed"),
        ([], "body", "dictionary"),
        (
            _body(material={"kind": "water", "density": -1000}),
            "body.scene.bodies[0].material.density",
            "got -1000",
        ),
        (_scene(resolution=1024, max_particles=10_000_000), "body.scene.bodies", "[1, 50000]"),
        (_scene(max_particles=10), "body.scene.bodies", "[1, 10]"),
        (_scene(wind=1), "body.scene.wind", "unknown"),
        (_scene(emitters=[JET | {"radius": -1}]), "body.scene.emitters[0].radius", "must be in (0, 4096]"),
        (_scene(emitters=[JET], resolution=128, frame_dt=0.1), "body.scene.bodies", "max_frame_cost"),
    ],
)
def test_a_bad_session_is_refused_with_field_and_range(
    service: Any, body: Any, field: str, message: str
) -> None:
    found = problem(service.http.post("/v1/sessions", json=body), 422)
    assert [error["field"] for error in found["errors"]].count(field) == 1, found
    assert message in next(error["message"] for error in found["errors"] if error["field"] == field)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (b'{"scenario": "water_2d", "seed": NaN}', "body.seed"),
        (json.dumps(_body(lower=[float("nan"), 0.4])).encode(), "body.scene.bodies[0].lower[0]"),
        (json.dumps(_scene(frame_dt=float("inf"))).encode(), "body.scene.frame_dt"),
        (b'{"scenario": "\\ud800"}', "body"),
        (b"", "body"),
        (b"\xff\xfe", "body"),
    ],
)
def test_values_that_json_does_not_have_are_refused(service: Any, text: bytes, field: str) -> None:
    answer = service.http.post("/v1/sessions", content=text, headers=JSON)
    assert problem(answer, 422)["errors"][0]["field"] == field


def test_json_that_is_nested_too_deeply_is_refused(service: Any) -> None:
    text = b'{"scene":' + b"[" * 2000 + b"]" * 2000 + b"}"
    answer = service.http.post("/v1/sessions", content=text, headers=JSON)
    assert "recursion limit" in problem(answer, 422)["detail"]


@pytest.mark.parametrize("frames", [0, -1, 2001, 1.5, "3", None, True])
def test_frames_out_of_range_are_refused(service: Any, path: str, frames: Any) -> None:
    found = problem(service.http.post(f"{path}/advance", json={"frames": frames}), 422)
    assert found["errors"][0]["field"] == "body.frames"


@pytest.mark.parametrize(
    ("method", "suffix"),
    [("GET", ""), ("DELETE", ""), ("POST", "/advance"), ("GET", "/particles"), *SKETCHES],
)
def test_an_unknown_session_is_404_everywhere(service: Any, method: str, suffix: str) -> None:
    answer = service.http.request(
        method, f"/v1/sessions/nobody{suffix}", json={} if method == "POST" else None
    )
    assert "nobody" in problem(answer, 404)["detail"]


def test_an_unknown_scenario_is_404_with_the_known_ones(service: Any) -> None:
    assert "sand_3d" in problem(service.http.get("/v1/scenarios/lava_2d"), 404)["detail"]


@pytest.mark.parametrize("seed", ["-1", "x", "1.5", "9007199254740992", "NaN"])
def test_a_bad_seed_in_the_query_is_named(service: Any, seed: str) -> None:
    found = problem(service.http.get("/v1/scenarios/water_2d", params={"seed": seed}), 422)
    assert found["errors"][0]["field"] == "query.seed"


@pytest.mark.parametrize(
    ("method", "address", "allowed"),
    [
        ("GET", "/nowhere", None),
        ("GET", "/docs", None),
        ("DELETE", "/livez", "GET, HEAD"),
        ("PUT", "/v1/sessions", "GET, HEAD, POST"),
        ("PATCH", "/v1/sessions/x", "DELETE, GET, HEAD"),
        ("PUT", "/v1/sessions/x/sketches", "DELETE, GET, HEAD, POST"),
    ],
)
def test_wrong_addresses_and_methods_are_problems_with_what_is_allowed(
    service: Any, method: str, address: str, allowed: str | None
) -> None:
    answer = service.http.request(method, address)
    problem(answer, 405 if allowed else 404)
    assert answer.headers.get("allow") == allowed


@pytest.mark.parametrize("headers", [{"Content-Type": "text/plain"}, {"Content-Type": "application/xml"}, {}])
def test_a_body_that_is_not_declared_as_json_is_415(service: Any, headers: dict[str, str]) -> None:
    answer = service.http.post("/v1/sessions", content=b'{"scenario": "water_2d"}', headers=headers)
    assert "application/json" in problem(answer, 415)["detail"]


def test_a_body_that_is_too_large_is_413_also_when_it_does_not_say_so(service: Any) -> None:
    most = Settings().max_body_bytes
    large = b"x" * (most + 1)
    assert str(most) in problem(service.http.post("/v1/sessions", content=large, headers=JSON), 413)["detail"]
    in_pieces = iter([large[: 1 << 20], large[1 << 20 :]])
    problem(service.http.post("/v1/sessions", content=in_pieces, headers=JSON), 413)


def test_a_crash_is_a_problem_that_tells_no_secrets(service: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(*_: Any) -> None:
        raise RuntimeError("secret")

    monkeypatch.setattr(service.app.state.sessions, "all", crash)
    answer = service.http.get("/v1/sessions")
    problem(answer, 500)
    assert "secret" not in answer.text
    assert answer.headers["x-content-type-options"] == "nosniff"
    monkeypatch.undo()
