"""Sessions with rigid bodies: poses in the stream, pulls by hand, logs, files and what is refused."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.conftest import Service, arrays_of, problem

from hybridmpm import MpmSolver, Scene, SceneError, replay
from hybridmpm.client import Client, Particles, ServiceError, Session
from hybridmpm.control import pull
from hybridmpm.stream_frames import decode
from hybridmpm_service.sessions.admission import estimated_frame_cost, within_limits
from hybridmpm_service.settings import Settings

WATER = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.9, 0.3]}
CRATE = {"shape": "box", "lower": [0.3, 0.35], "upper": [0.5, 0.45], "density": 500.0, "rotation": 0.2}
STONE = {"shape": "ball", "center": [0.7, 0.5], "radius": 0.06, "density": 2500.0}
SCENE: dict[str, Any] = {"dim": 2, "resolution": 24, "bodies": [WATER], "rigid": [CRATE, STONE]}
PULL = {"body": 0, "grip": [0.05, 0.0], "target": [0.4, 0.7], "reach": 0.08, "strength": 400.0}


def test_frames_have_poses_for_viewers_that_join_late_too(service: Service) -> None:
    path = service.create(SCENE)
    with service.stream(path, "3") as stream:
        hello = stream.text("hello")
        assert [solid["shape"] for solid in hello["rigid"]] == ["box", "ball"]
        assert hello["rigid"][0]["half"] == pytest.approx([0.1, 0.05])
        assert hello["rigid"][1]["mass"] == pytest.approx(2500 * np.pi * 0.06**2, rel=1e-5)
        first = decode(stream.frame())
        assert first.rigid is not None
        assert first.rigid.rotation == pytest.approx([0.2, 0])
        service.http.post(f"{path}/advance", json={"frames": 40})
        stream.reach(40)
    with service.stream(path, "3") as stream:
        late = decode(stream.frame())
    held = service.http.get(f"{path}/particles", headers={"Accept": "application/x-npz"})
    numbers = arrays_of(held.content)["rigid"]
    assert late.rigid is not None
    assert late.number == 40
    assert late.rigid.center == pytest.approx(numbers[:, :2], abs=1e-6)
    assert late.rigid.center[1, 1] == pytest.approx(0.5 - 0.5 * 9.81 * 0.1**2, abs=0.01)
    assert service.http.get(f"{path}/particles").json()["rigid"] == pytest.approx(numbers)
    # As points that fill them they are in clouds.
    cloud = service.http.get(f"{path}/particles", headers={"Accept": "application/x-ply"}).content
    count = int(cloud.split(b"element vertex ")[1].split()[0])
    assert count > len(arrays_of(held.content)["types"]) + 20
    for version in ("1", "2"):
        with service.stream(path, version) as stream:
            assert stream.end() == 4406


def test_a_hand_pulls_a_body_and_its_log_gives_the_same_bits(service: Service) -> None:
    path = service.create(SCENE)
    with service.stream(path, "3") as stream:
        stream.send(type="pull", **PULL)
        stream.send(type="step", frames=60)
        stream.reach(60)
        status = stream.text("status")
        assert status["hand"] == {name: PULL[name] for name in ("body", "grip", "target")}
        stream.send(type="push", point=[0.3, 0.2], velocity=[1.0, 0.0], radius=0.1)
        stream.send(type="step", frames=5)
        stream.send(type="push_end")
        stream.send(type="step", frames=5)
        frame = stream.reach(70)
    assert frame.rigid is not None
    assert frame.rigid.center[0, 1] > 0.5 > frame.rigid.center[1, 1]
    log = service.http.get(f"{path}/log").json()
    assert [one["kind"] for one in log["inputs"]] == ["pull", "push", "push"]
    assert log["inputs"][0] == {"kind": "pull", "frame": 0, "pull": PULL}
    again = service.http.post("/v1/sessions", json={"log": log}).json()
    assert (again["frame"], again["notice"]) == (70, None)
    assert replay(log).digest() == log["digest"]
    # A fork goes on with the same bits.
    fork = service.http.post(f"{path}/fork").json()["links"]["self"]
    for one in (path, fork):
        service.http.post(f"{one}/advance", json={"frames": 10})
    digests = [service.http.get(f"{one}/log").json()["digest"] for one in (path, fork)]
    assert digests[0] == digests[1] != log["digest"]


@pytest.mark.filterwarnings("ignore::hybridmpm.errors.CoarseWarning")
def test_a_body_is_pulled_in_coarse_mode(service: Service) -> None:
    made = service.http.post("/v1/sessions", json={"scene": SCENE | {"resolution": 64}, "coarse": "1/4"})
    path = made.json()["links"]["self"]
    with service.stream(path, "3") as stream:
        stream.send(type="pull", **PULL)
        stream.send(type="step", frames=50)
        frame = stream.reach(50)
    assert frame.rigid is not None
    assert frame.rigid.center[0, 1] > 0.5
    log = service.http.get(f"{path}/log").json()
    assert service.http.post("/v1/sessions", json={"log": log}).json()["notice"] is None


@pytest.mark.parametrize(
    ("changes", "field", "text"),
    [
        ({"body": 2}, "body", "must be less than 2, got 2"),
        ({"grip": [0.0, 0.0, 0.0]}, "grip", "must have 2 numbers, got 3"),
        ({"strength": 0}, "strength", "greater than 0"),
    ],
)
def test_faults_of_a_pull_are_named(service: Service, changes: Any, field: str, text: str) -> None:
    path = service.create(SCENE)
    with service.stream(path, "3") as stream:
        stream.send(type="pull", **PULL | changes)
        detail = stream.text("problem")["detail"]
        assert field in detail
        assert text in detail


def test_what_is_not_made_for_bodies_says_so(service: Service, path: str) -> None:
    with service.stream(path) as stream:
        stream.send(type="pull", **PULL)
        assert "this session has no rigid bodies" in stream.text("problem")["detail"]
    network = {"solver": "hybrid", "model": "fluids_2d"}
    refused = service.http.post("/v1/sessions", json={"scene": SCENE} | network)
    assert "not made for rigid bodies" in problem(refused, 422)["detail"]
    made = service.create(SCENE)
    arrow = {"strokes": [{"points": [[0.3, 0.2], [0.6, 0.4]], "kind": "arrow"}]}
    refused = service.http.post(f"{made}/sketches", json=arrow)
    assert "not made for rigid bodies" in problem(refused, 422)["detail"]


def revived(session: Session) -> Particles:
    """Return the particles of a session, after its frames have been computed again."""
    while True:
        try:
            return session.particles()
        except ServiceError as refused:
            if refused.status != 503:
                raise
            time.sleep(refused.retry_after or 0.05)


def test_a_session_survives_a_restart_with_its_bodies(start: Callable[..., Service], tmp_path: Path) -> None:
    first = start(state_folder=str(tmp_path))
    with Client(f"http://{first.address}") as client:
        session = client.create(scene=Scene.parse(SCENE))
        with session.stream() as stream:
            stream.pull(0, (0.4, 0.6), strength=300.0, grip=(0.05, 0.0))
            stream.step(30)
            frame = next(one for one in stream.frames() if one.number == 30)
        assert frame.rigid is not None
        before = session.particles()
        assert frame.rigid.center == pytest.approx(before.rigid[:, :2], abs=1e-6)
        job = session.record(10, every=5, format="npz")
        assert arrays_of(job.result())["rigid"].shape == (3, 2, 13)
    first.stop()
    second = start(state_folder=str(tmp_path))
    with Client(f"http://{second.address}") as client:
        again = client.session(session.id)
        after = revived(again)
        assert after.frame == 30
        assert np.array_equal(after.rigid, before.rigid)
        assert json.dumps(again.log()["inputs"][0]["pull"]["grip"]) == "[0.05, 0.0]"


def test_a_tab_that_leads_pulls_with_the_bits_of_the_session(service: Service) -> None:
    path = service.create(SCENE)
    with service.stream(path, "3") as stream:
        stream.send(type="play")
        stream.send(type="lead")
        begun = stream.text("lead")
        first = begun["frame"]
        assert (begun["push"], begun["pull"]) == (None, None)
        tab = MpmSolver(Scene.parse(SCENE))
        tab.advance(first)
        assert tab.digest() == begun["digest"]
        inputs = [{"frame": first + 2, "pull": PULL}, {"frame": first + 8, "push": None}]
        stream.send(type="led", upto=first + 10, inputs=inputs)
        stream.text("led")
        tab.advance(2)
        force = {name: PULL[name] for name in ("grip", "reach", "strength")}
        tab.advance(6, pull(0, PULL["target"], **force))
        tab.advance(2)
        stream.send(type="led", upto=first + 11, inputs=[{"frame": first + 10, "pull": PULL | {"body": 7}}])
        assert "inputs[0].pull.body" in stream.text("problem")["detail"]
        stream.send(type="unlead", digest=tab.digest())
        ended = stream.text("unlead")
        assert (ended["frame"], ended["digest"]) == (first + 10, tab.digest())
        stream.send(type="pause")


def test_bodies_count_in_the_cost_of_a_frame() -> None:
    scene = Scene.parse(SCENE)
    bodies = scene.model_copy(update={"rigid": scene.rigid * 50})
    costs = [estimated_frame_cost(one, 1000) for one in (scene, bodies)]
    assert 5 < costs[1] / costs[0] < 20
    limit = Settings(max_frame_cost=round(0.9 * costs[1]))
    assert within_limits(scene, limit).rigid == scene.rigid
    with pytest.raises(SceneError, match="and 100 rigid bodies = "):
        within_limits(bodies, limit)
