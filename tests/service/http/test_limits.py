"""Limits of the whole service, on servers with small ones."""

import json
from collections.abc import Callable
from typing import Any

import httpx
import pytest
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS, problem

from hybridmpm import Scene
from hybridmpm_service.sessions.simulation import Simulation


def test_a_full_service_says_so_and_is_not_ready(start: Callable[..., Any]) -> None:
    service = start(max_sessions=1)
    path = service.create()
    refused = service.http.post("/v1/sessions", json={"scenario": "water_2d"})
    assert "all 1 sessions" in problem(refused, 503)["detail"]
    assert int(refused.headers["retry-after"]) > 0
    assert "all 1 sessions" in problem(service.http.get("/readyz"), 503)["detail"]
    assert service.http.get("/livez").status_code == 200
    service.http.delete(path)
    assert service.http.get("/readyz").status_code == 200


def test_a_draining_service_is_alive_but_not_ready(start: Callable[..., Any]) -> None:
    service = start()
    service.app.state.sessions.drain()
    assert "shutting down" in problem(service.http.get("/readyz"), 503)["detail"]
    problem(service.http.post("/v1/sessions", json={"scenario": "water_2d"}), 503)
    assert service.http.get("/livez").status_code == 200


def test_messages_name_the_limits_of_the_settings(start: Callable[..., Any]) -> None:
    service = start(max_particles=100, max_advance_frames=5, max_sketch_frames=7, max_body_bytes=4096)
    found = problem(service.http.post("/v1/sessions", json={"scenario": "water_2d"}), 422)
    assert "[1, 100]" in found["detail"]
    bodies = [{"shape": "ball", "center": [0.5, 0.5], "radius": 0.05, "material": "sand"}]
    path = service.create({"dim": 2, "resolution": 32, "bodies": bodies})
    assert "[1, 5]" in problem(service.http.post(f"{path}/advance", json={"frames": 6}), 422)["detail"]
    strokes = [{"points": [[0.5, 0.5], [0.6, 0.5]]}]
    answer = service.http.post(f"{path}/sketches", json={"strokes": strokes, "frames": 8})
    assert "[1, 7]" in problem(answer, 422)["detail"]
    assert "4096" in problem(service.http.post(f"{path}/advance", content=bytes(5000)), 413)["detail"]
    with service.stream(path) as stream:
        stream.send(type="step", frames=6)
        assert "[1, 5]" in stream.text("problem")["detail"]


def test_a_full_machine_says_its_load_and_its_limit(
    start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Simulation, "frame_seconds", 0.009)  # at a quarter of real time nine tenths of a core
    service = start(max_load=1.0)
    first, second = service.create(), service.create()
    with service.stream(first) as stream, service.stream(second) as other:
        stream.send(type="play")
        stream.status(playing=True)
        for refused in (
            service.http.post("/v1/sessions", json={"scenario": "water_2d"}),
            service.http.post(f"{first}/fork"),
        ):
            found = problem(refused, 503)
            assert found["type"] == "urn:hybridmpm:problem:machine-full"
            assert "take 0.90 of 1 cores" in found["detail"]
            assert "pause or delete" in found["detail"]
            assert int(refused.headers["retry-after"]) > 0
        other.send(type="play")
        assert other.text("problem")["problem"] == "urn:hybridmpm:problem:machine-full"
        assert service.http.get(second).json()["playing"] is False
        assert service.http.get(first).json()["playing"] is True
        assert service.http.get("/readyz").status_code == 200
        monkeypatch.setattr(Simulation, "frame_seconds", 0.02)
        assert "take 1.00 of 1" in problem(service.http.get("/readyz"), 503)["detail"]


def test_a_connection_too_many_is_refused_and_the_others_go_on(
    start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridmpm_service.http.connection._SURPLUS_SECONDS", WAIT_SECONDS)
    service = start(max_connections=3)
    path = service.create()
    with service.stream(path) as stream, service.stream(path):
        with httpx.Client(base_url=f"http://{service.address}") as surplus:
            refused = surplus.get("/livez")
        # The request is not even read, and so its path is not known.
        assert (refused.status_code, refused.json()["instance"]) == (503, "/")
        assert "all 3 connections" in refused.json()["detail"]
        assert int(refused.headers["retry-after"]) > 0
        assert service.http.get("/livez").status_code == 200
        stream.send(type="step")
        assert stream.frame()
    service.http.delete(path)


def test_scenes_and_large_bodies_are_read_in_processes_apart(
    service: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the process of the service they would keep everything else waiting."""
    log = service.http.get(f"{service.create()}/log").json()

    def fail(*_: Any, **__: Any) -> None:
        raise AssertionError("read in the process of the service")

    monkeypatch.setattr(Scene, "model_validate", fail)
    scene = {"scene": SMALL_SCENE}
    assert service.http.post("/v1/sessions", json={"log": log}).status_code == 201
    assert service.http.post("/v1/sessions", json=scene).status_code == 201
    assert service.http.post("/v1/checks", json=scene).status_code == 200
    assert service.http.post("/v1/plans", json=scene | {"budget_ms": 1}).status_code == 200
    monkeypatch.setattr("hybridmpm_service.http.requests.read_json", fail)
    large = json.dumps(scene) + " " * (1 << 14)
    for body, status in ((large, 201), (large.replace("{", '{"scene":1,', 1), 422)):
        answer = service.http.post("/v1/sessions", content=body, headers={"Content-Type": "application/json"})
        assert answer.status_code == status, answer.text
    assert "stands twice" in problem(answer, 422)["detail"]


@pytest.mark.parametrize("inside", [False, True])
def test_a_crowd_of_fields_is_refused_as_one(inside: bool, service: Any) -> None:  # noqa: FBT001
    """An error for each of them would take seconds to make."""
    crowd: dict[str, Any] = {f"k{number}": 1 for number in range(200)}
    answer = service.http.post("/v1/sessions", json={"scene": crowd} if inside else crowd)
    assert "has 200 fields" in problem(answer, 422)["detail"]
