"""Limits of the whole service, on servers with small ones."""

from collections.abc import Callable
from typing import Any


def test_a_full_service_says_so_and_is_not_ready(start: Callable[..., Any], problem: Any) -> None:
    service = start(max_sessions=1)
    path = service.create()
    refused = service.http.post("/v1/sessions", json={"scenario": "water_2d"})
    assert "all 1 sessions" in problem(refused, 503)["detail"]
    assert int(refused.headers["retry-after"]) > 0
    assert "all 1 sessions" in problem(service.http.get("/readyz"), 503)["detail"]
    assert service.http.get("/livez").status_code == 200
    service.http.delete(path)
    assert service.http.get("/readyz").status_code == 200


def test_a_draining_service_is_alive_but_not_ready(start: Callable[..., Any], problem: Any) -> None:
    service = start()
    service.app.state.sessions.drain()
    assert "shutting down" in problem(service.http.get("/readyz"), 503)["detail"]
    problem(service.http.post("/v1/sessions", json={"scenario": "water_2d"}), 503)
    assert service.http.get("/livez").status_code == 200


def test_the_operators_limits_are_the_ones_in_the_messages(start: Callable[..., Any], problem: Any) -> None:
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
