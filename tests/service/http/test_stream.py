"""The live stream over a real WebSocket: greeting, frames, commands, refusals, endings."""

import base64
import threading
from typing import Any

import httpx
import numpy as np
import pytest
from tests.service.conftest import Hold, problem
from websockets.exceptions import InvalidStatus

from hybridmpm import DomainError
from hybridmpm.stream_frames import decode


def test_it_begins_with_a_greeting_and_the_present_frame(service: Any, path: str) -> None:
    service.http.post(f"{path}/advance", json={"frames": 3})
    particles = service.http.get(f"{path}/particles").json()
    with service.stream(path) as stream:
        hello = stream.receive()
        assert hello["type"] == "hello"
        assert hello["session"] == service.http.get(path).json()
        scene = hello["scene"]
        assert scene["dim"] == 2
        assert scene["frame_dt"] == 0.0025
        assert scene["gravity"] == [0.0, -9.81]
        assert scene["walls"]["lower"] == [0.1, 0.1]
        assert scene["obstacles"] == []
        assert list(base64.b64decode(hello["types"])) == particles["types"]
        frame = decode(stream.frame())
        assert (frame.number, frame.steered) == (3, False)
        assert frame.time == pytest.approx(0.0075)
        np.testing.assert_allclose(frame.positions, particles["positions"], atol=1e-5)


def test_play_brings_frames_until_pause(service: Any, path: str) -> None:
    with service.stream(path) as stream:
        stream.send(type="play")
        numbers = [decode(stream.frame()).number for _ in range(10)]
        assert numbers == sorted(set(numbers))
        assert numbers[-1] >= 9
        assert service.http.get(path).json()["playing"] is True
        stream.send(type="pause")
        stream.status(playing=False)
        at_rest = service.http.get(f"{path}/particles").json()["frame"]
        assert service.http.get(f"{path}/particles").json()["frame"] == at_rest >= numbers[-1]


def test_step_reset_and_speed(service: Any, path: str) -> None:
    with service.stream(path) as stream:
        stream.send(type="step", frames=6)
        stream.reach(6)
        stream.send(type="step")
        stream.reach(7)
        stream.send(type="speed", value=0.5)
        stream.status(speed=0.5)
        stream.send(type="reset")
        stream.rewind()
    assert service.http.get(path).json()["frame"] == 0


def test_the_status_has_the_times_of_frames(service: Any, path: str) -> None:
    with service.stream(path) as stream:
        stream.send(type="play")
        status = stream.text("status")
        while not status["time_scale"]:
            status = stream.text("status")
        assert status["ms_p95"] >= status["ms_per_frame"] > 0
        assert status["session"]["id"] == path.rpartition("/")[2]


def test_the_status_has_the_forces_on_walls_and_obstacles(service: Any, path: str) -> None:
    with service.stream(path) as stream:
        assert stream.text("status")["forces"] is None
        stream.send(type="play")
        stream.reach(300)
        stream.send(type="pause")
        forces = stream.status(playing=False)["forces"]
    assert forces["solids"][:4] == ["x_lower", "x_upper", "y_lower", "y_upper"]
    assert forces["frames"] == 40
    floor = forces["solids"].index("y_lower")
    assert forces["force"][floor][1] < 0
    assert len(forces["torque"][floor]) == 1


def test_frames_computed_over_http_reach_the_viewers(service: Any, path: str) -> None:
    with service.stream(path) as first, service.stream(path) as second:
        service.http.post(f"{path}/advance", json={"frames": 4})
        for stream in (first, second):
            stream.reach(4)


def test_steered_frames_are_marked(service: Any, path: str) -> None:
    sketch = {"strokes": [{"points": [[0.5, 0.5], [0.55, 0.5]]}], "frames": 5}
    with service.stream(path) as stream:
        service.http.post(f"{path}/sketches", json=sketch)
        while stream.text("status")["session"]["control"] is None:
            pass
        stream.send(type="step", frames=5)
        assert stream.reach(5).steered
        stream.send(type="step")
        assert not stream.reach(6).steered


def test_a_hand_pushes_the_fluid_until_it_lets_go(service: Any, path: str) -> None:
    def moved() -> float:
        before = service.http.get(path).json()["centroid"][0]
        after = service.http.post(f"{path}/advance", json={"frames": 1}).json()["centroid"][0]
        return float(after - before)

    with service.stream(path) as stream:
        stream.send(type="push", point=[0.9, 0.9], velocity=[9, 9], radius=0.1)
        stream.send(type="push", point=[0.5, 0.5], velocity=[2.0, 0.0], radius=0.1)
        stream.send(type="speed", value=0.5)
        stream.status(speed=0.5)
        service.http.post(f"{path}/advance", json={"frames": 4})
        pushed = moved()
        assert pushed > 1e-4
        stream.send(type="push_end")
        stream.send(type="speed", value=0.25)
        stream.status(speed=0.25)
        assert moved() == pytest.approx(moved(), rel=0.05)
        assert service.http.get(path).json()["control"] is None


@pytest.mark.parametrize(
    ("change", "field", "message"),
    [
        ({"point": [0.5, 0.5, 0.5]}, "point", "must have 2 numbers, got 3"),
        ({"velocity": [0, 0, 0]}, "velocity", "must have 2 numbers, got 3"),
        ({"point": [0.5, 1.5]}, "point[1]", "equal to 1"),
        ({"radius": "0.1"}, "radius", "valid number"),
        ({"velocity": None}, "velocity", "list"),
        ({"force": 1}, "force", "not permitted"),
    ],
)
def test_a_bad_push_is_refused_with_its_field(
    service: Any, path: str, change: dict[str, Any], field: str, message: str
) -> None:
    command: dict[str, Any] = {"type": "push", "point": [0.5, 0.5], "velocity": [0, 0], "radius": 0.1}
    with service.stream(path) as stream:
        stream.send(**(command | change))
        detail = stream.text("problem")["detail"]
    assert detail.startswith(f"{field}: ")
    assert message in detail
    assert service.session(path).simulation.hand is None


@pytest.mark.parametrize(
    ("message", "detail"),
    [
        ('{"type": "jump"}', "'play', 'pause', 'step', 'reset'"),
        ("{", "JSON"),
        ("\ud7ff\x00", "JSON"),
        ('{"type": "step", "frames": 2001}', "frames: must be in [1, 2000]"),
        ('{"type": "speed", "value": 2}', "value: Input should be less than or equal to 1"),
        ('{"type": "speed", "value": NaN}', "value"),
        ('{"type": "play", "loud": true}', "loud"),
        (b"play", "binary"),
    ],
)
def test_a_bad_command_is_answered_and_the_stream_goes_on(
    service: Any, path: str, message: str | bytes, detail: str
) -> None:
    with service.stream(path) as stream:
        stream.connection.send(message)
        assert detail in stream.text("problem")["detail"]
        stream.send(type="step")
        stream.reach(1)


def test_a_message_that_is_too_large_ends_only_its_own_stream(service: Any, path: str) -> None:
    with service.stream(path) as other, service.stream(path) as stream:
        stream.connection.send("x" * (64 * 1024 + 1))
        assert stream.end() == 1009
        other.send(type="step")
        other.reach(1)


def test_an_unknown_session_closes_with_4404(service: Any) -> None:
    with service.stream("/v1/sessions/nobody") as stream:
        assert stream.end() == 4404


def test_a_deleted_session_closes_with_4404(service: Any) -> None:
    path = service.create()
    with service.stream(path) as stream:
        stream.send(type="play")
        stream.frame()
        service.http.delete(path)
        assert stream.end() == 4404


def test_a_session_that_was_left_closes_after_its_time(service: Any) -> None:
    path = service.create()
    assert service.http.delete(f"{path}?after=601").status_code == 422
    with service.stream(path) as stream:
        stream.receive()
        assert service.http.delete(f"{path}?after=0.2").status_code == 204
        assert stream.end() == 4404
    assert service.http.get(path).status_code == 404


def test_a_foreign_page_cannot_open_a_stream(service: Any, path: str) -> None:
    own = f"http://{service.address}"
    with service.stream(path, origin=own) as stream:
        assert stream.receive()["type"] == "hello"
    for origin in (
        "http://evil.example",
        "null",
        f"http://evil.example:{service.address.rpartition(':')[2]}",
    ):
        with pytest.raises(InvalidStatus) as refused, service.stream(path, origin=origin):
            pass
        assert refused.value.response.status_code == 403


def test_a_failing_frame_pauses_at_the_last_good_one_and_disturbs_nobody_else(
    service: Any, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = service.create()
    solver = service.session(path).simulation._solver
    advance = solver.advance

    def fail_at_five(frames: int = 1, force: Any = None) -> None:
        if solver.frame == 5:
            raise DomainError("particle 7 left the box in frame 6")
        advance(frames, force)

    monkeypatch.setattr(solver, "advance", fail_at_five)
    with service.stream(path) as stream, service.stream(other) as watched:
        stream.send(type="play")
        watched.send(type="play")
        found = stream.text("problem")
        assert found["detail"] == "particle 7 left the box in frame 6"
        assert found["title"]
        stream.status(playing=False)
        here = service.http.get(path).json()
        assert (here["frame"], here["playing"]) == (5, False)
        answer = service.http.post(f"{path}/advance", json={})
        assert "particle 7" in problem(answer, 422)["detail"]
        assert service.http.get(path).json()["frame"] == 5
        now = decode(watched.frame()).number
        watched.reach(now + 5)
        assert service.http.get(other).json()["playing"] is True
        stream.send(type="reset")
        stream.rewind()
    service.http.delete(other)


def test_a_long_computation_blocks_neither_the_loop_nor_other_sessions(service: Any, path: str) -> None:
    """While the session's thread is held inside a frame, everybody else is served."""
    other = service.create()
    hold = Hold(service.session(path))
    answers: list[httpx.Response] = []
    caller = threading.Thread(
        target=lambda: answers.append(
            httpx.post(f"{service.http.base_url}{path}/advance", json={}, timeout=60)
        )
    )
    caller.start()
    try:
        assert hold.reached.wait(60)
        assert service.http.get("/livez").status_code == 200
        assert service.http.get(path).json()["frame"] == 0
        assert service.http.post(f"{other}/advance", json={"frames": 3}).json()["frame"] == 3
        with service.stream(path) as stream:
            assert stream.receive()["type"] == "hello"
        assert answers == []
    finally:
        hold.gate.set()
        caller.join(60)
    assert answers[0].json()["frame"] == 1
    service.http.delete(other)


DENSE_SCENE: dict[str, Any] = {
    "dim": 2,
    "resolution": 32,
    "particles_per_cell": 64,
    "bodies": [{"shape": "box", "lower": [0.2, 0.2], "upper": [0.6, 0.6], "material": "water"}],
}


def test_a_client_that_does_not_read_delays_no_other_and_ends_with_the_newest_frame(service: Any) -> None:
    path = service.create(DENSE_SCENE)
    # No buffer on this side, so that the server feels that nobody reads.
    with service.stream(path, max_queue=1, close_timeout=1) as slow, service.stream(path) as fast:
        fast.send(type="speed", value=1.0)
        fast.send(type="play")
        fast.reach(60)
        fast.send(type="pause")
        fast.status(playing=False)
        last = service.http.get(f"{path}/particles").json()["frame"]
        numbers: list[int] = []
        while not numbers or numbers[-1] < last:
            numbers.append(decode(slow.frame()).number)
        assert numbers == sorted(numbers)


def test_a_slow_line_gets_fewer_frames_and_no_old_ones(service: Any) -> None:
    """What waits for a line is bounded in bytes, here and in the system; a frame has 42 KB."""
    path = service.create(DENSE_SCENE)
    with service.stream(path, max_queue=1, close_timeout=1) as slow, service.stream(path) as fast:
        for number in range(1, 61):
            fast.send(type="step")
            fast.reach(number)
        numbers = [decode(slow.frame()).number]
        while numbers[-1] < 60:
            numbers.append(decode(slow.frame()).number)
        assert len(numbers) < 12
    service.http.delete(path)
