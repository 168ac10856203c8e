"""Sessions that a network simulates, alone or with MPM to stand in for it, on a real server."""

import io
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.conftest import SMALL_SCENE, Service, problem

from hybridmpm import HybridSimulator, scenarios
from hybridmpm.coarse import coarse_table
from hybridmpm.hybrid import Decision
from hybridmpm.physics import NeuralModel
from hybridmpm_service.sessions.view import Safeguard

NPZ = {"Accept": "application/x-npz"}
SEED = 3
"""A block of water that falls freely from frame 20, where a network may take over, to frame 84."""
WATER: dict[str, Any] = {"scenario": "water_2d", "seed": SEED}
ARROW: dict[str, Any] = {"strokes": [{"points": [[0.4, 0.5], [0.5, 0.6]], "kind": "arrow"}], "frames": 40}


@pytest.fixture(scope="module")
def learned(model_folder: Path, start_module: Callable[..., Service]) -> Service:
    """Return a server with the networks "falling" and "broken"."""
    return start_module(models=str(model_folder), max_sessions=40)


@pytest.fixture
def create(learned: Service) -> Iterator[Callable[..., str]]:
    """Return a function that creates a session and returns its path."""
    paths: list[str] = []

    def make(**options: Any) -> str:
        answer = learned.http.post("/v1/sessions", json=WATER | options)
        assert answer.status_code == 201, answer.text
        paths.append(answer.json()["links"]["self"])
        return paths[-1]

    yield make
    for path in paths:
        learned.http.delete(path)


def _positions(service: Service, path: str) -> np.ndarray[Any, Any]:
    with np.load(io.BytesIO(service.http.get(f"{path}/particles", headers=NPZ).content)) as file:
        return np.array(file["positions"])


def _advance(service: Service, path: str, frames: int) -> Any:
    answer = service.http.post(f"{path}/advance", json={"frames": frames})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_the_models_are_listed(learned: Service) -> None:
    listed = learned.http.get("/v1/models").json()["models"]
    assert [model["name"] for model in listed] == ["falling", "broken"]
    assert (listed[0]["scenarios"], listed[0]["r_p"], listed[0]["r_t"]) == (["water_2d"], 0.25, 4)


def test_a_session_names_its_simulator(learned: Service, create: Callable[..., str]) -> None:
    found = {}
    for solver in ("mpm", "hybrid", "neural"):
        body = learned.http.get(create(solver=solver)).json()
        found[solver] = [body[key] for key in ("solver", "model", "r_p", "mode", "safeguard")]
    safeguard = {"r_c": None, "value": None, "mpm_share": 1.0}
    assert found == {
        "mpm": ["mpm", None, 1.0, "mpm", None],
        "hybrid": ["hybrid", "falling", 0.25, "mpm", safeguard],
        "neural": ["neural", "falling", 0.25, "mpm", None],
    }


def test_the_pressure_of_a_network_is_refused(learned: Service, create: Callable[..., str]) -> None:
    for solver in ("hybrid", "neural"):
        answer = learned.http.get(f"{create(solver=solver)}/pressure")
        body = problem(answer, 409)
        assert body["type"].endswith(":pressure-unknown")
        assert "has no pressure" in body["detail"]


def test_the_page_offers_all_coarse_levels(learned: Service) -> None:
    offered = re.findall(r'<option value="(1/[0-9]+)">', learned.http.get("/").text)
    assert offered == list(reversed(coarse_table().ratios))


def test_a_hybrid_session_computes_what_the_library_computes(
    learned: Service, create: Callable[..., str], model_folder: Path
) -> None:
    path = create(solver="hybrid", r_c=0.5)
    physics = NeuralModel.load(model_folder / "falling.onnx")
    simulator = HybridSimulator(scenarios.get("water_2d", SEED), physics, r_c=0.5)
    modes = []
    for _ in range(3):
        body = _advance(learned, path, 40)
        simulator.advance(40)
        modes.append(body["mode"])
        assert body["mode"] == simulator.mode
        assert body["safeguard"]["mpm_share"] == pytest.approx(simulator.mpm_share, abs=1e-4)
        assert np.array_equal(_positions(learned, path), simulator.positions)
        assert (body["last_frame"]["substeps"] is None) == (simulator.mode == "neural")
    assert modes == ["neural", "neural", "mpm"]
    # The frames show all particles of the scene, of which the network moves a quarter.
    assert len(_positions(learned, path)) == len(simulator.scene.sample().x)
    assert body["safeguard"]["r_c"] == 0.5
    centroid = np.average(simulator.positions, axis=0, weights=simulator.mass)
    assert body["centroid"] == pytest.approx(centroid, abs=1e-6)

    decisions = learned.http.get(f"{path}/decisions").json()["decisions"]
    log = [vars(decision) for decision in simulator.log]
    assert [{**row, "value": None} for row in decisions] == [{**row, "value": None} for row in log]
    assert decisions[-1]["value"] == pytest.approx(log[-1]["value"], abs=1e-4)


def test_the_status_tells_modes_values_and_decisions_as_they_come(
    learned: Service, create: Callable[..., str]
) -> None:
    path = create(solver="hybrid")
    with learned.stream(path) as stream:
        stream.send(type="step", frames=60)
        status = stream.status(frame=60)
        assert status["session"]["mode"] == "neural"
        assert [row["reason"] for row in status["history"]["decisions"]] == ["warm-up"]
        stream.send(type="speed", value=1)
        stream.send(type="play")
        # Told at once though the player goes on, not only when it rests.
        status = stream.status(mode="mpm")
        assert status["session"]["playing"]
        history = status["history"]
        # Near the floor the network is asked first; the alarm at frame 84 undoes the step before it.
        assert history["phases"][:3] == [[0, "mpm"], [20, "neural"], [80, "mpm"]]
        assert history["decisions"][1]["noticed"] == 84
        assert [row["mode"] for row in history["decisions"][:2]] == ["neural", "mpm"]
        while len((history := stream.text("status")["history"])["frames"]) < 3:
            pass
        assert [frame % 4 for frame in history["frames"]] == [0] * len(history["frames"])
        assert len(history["frames"]) == len(history["values"])
        assert all(-1 <= value <= 1 for value in history["values"])
        stream.send(type="pause")
        stream.send(type="reset")
        status = stream.status(frame=0)
        assert status["history"] == {"frames": [], "values": [], "phases": [[0, "mpm"]], "decisions": []}


@pytest.mark.parametrize("solver", ["mpm", "neural"])
def test_there_is_no_history_without_a_safeguard(
    learned: Service, create: Callable[..., str], solver: str
) -> None:
    with learned.stream(create(solver=solver)) as stream:
        assert stream.text("status")["history"] is None


@pytest.mark.parametrize(("solver", "mode"), [("hybrid", "mpm"), ("neural", "neural")])
def test_a_sketch_steers_as_its_trajectory_says(
    learned: Service, create: Callable[..., str], solver: str, mode: str
) -> None:
    path = create(solver=solver)
    assert _advance(learned, path, 42)["mode"] == "neural"
    before = _positions(learned, path)
    motion = learned.http.post(f"{path}/trajectories", params={"stride": 5}, json=ARROW).json()
    assert motion["first_frame"] == 42
    assert np.array_equal(_positions(learned, path), before)
    assert learned.http.post(f"{path}/sketches", json=ARROW).json()["first_frame"] == 42
    body = _advance(learned, path, 40)
    assert (body["mode"], body["control"]["phase"]) == (mode, "done")
    assert np.array_equal(_positions(learned, path), np.array(motion["positions"][-1], dtype=np.float32))
    assert motion["displacement"] == pytest.approx([0.1, 0.1], abs=0.005)
    reasons = [row["reason"] for row in learned.http.get(f"{path}/decisions").json()["decisions"]]
    assert reasons == (["warm-up", "force"] if solver == "hybrid" else [])


def test_a_network_that_fails_leaves_its_session_usable(learned: Service, create: Callable[..., str]) -> None:
    path = create(solver="neural", model="broken")
    with learned.stream(path) as stream:
        found = problem(learned.http.post(f"{path}/advance", json={"frames": 60}), 422)
        assert found["type"] == "urn:hybridmpm:problem:simulation-failed"
        assert "became non-finite in frame 21, in a network step" in found["detail"]
        assert "non-finite" in stream.text("problem")["detail"]
        stream.send(type="reset")
        stream.status(frame=0)
    assert _advance(learned, path, 20)["frame"] == 20


def test_a_hybrid_session_survives_the_same_network(learned: Service, create: Callable[..., str]) -> None:
    path = create(solver="hybrid", model="broken")
    # It falls until frame 80, without the network.
    assert _advance(learned, path, 120)["frame"] == 120
    decisions = learned.http.get(f"{path}/decisions").json()["decisions"]
    assert {row["reason"] for row in decisions if row["mode"] == "mpm"} == {"non-finite"}


@pytest.mark.parametrize(
    ("body", "field", "message"),
    [
        (WATER | {"solver": "magic"}, "body.solver", "'mpm', 'neural' or 'hybrid'"),
        (WATER | {"solver": "hybrid", "model": "fast"}, "body.model", "known are falling, broken"),
        (WATER | {"model": "falling"}, "body.model", '"neural" and "hybrid"'),
        (WATER | {"coarse": "1/15"}, "body.coarse", '"1/32", "1/16", "1/8", "1/4", got "1/15"'),
        (WATER | {"coarse": "1/16", "solver": "hybrid"}, "body.coarse", 'solver "mpm", got "hybrid"'),
        ({"scene": SMALL_SCENE, "coarse": "1/64"}, "body.coarse", "r_p must be at least"),
        (WATER | {"r_c": 0.5}, "body.r_c", 'belongs to the solver "hybrid", got "mpm"'),
        (WATER | {"solver": "hybrid", "r_c": 1.5}, "body.r_c", "less than or equal to 1"),
        (WATER | {"solver": "hybrid", "r_c": "0.5"}, "body.r_c", "number"),
        ({"scenario": "sand_2d", "solver": "hybrid"}, "body.model", "there are models for water_2d"),
        ({"scenario": "sand_2d", "solver": "hybrid", "model": "falling"}, "body.model", "with water"),
        ({"scene": SMALL_SCENE, "solver": "hybrid"}, "body.model", "is required with a scene"),
        ({"scene": SMALL_SCENE, "solver": "neural", "model": "falling"}, "body.model", "spacing"),
    ],
)
def test_a_bad_choice_is_refused_with_field_and_range(
    learned: Service, body: Any, field: str, message: str
) -> None:
    found = problem(learned.http.post("/v1/sessions", json=body), 422)
    assert [error["field"] for error in found["errors"]] == [field]
    assert message in found["errors"][0]["message"]


def test_a_damaged_model_is_the_servers_fault_and_disturbs_no_other_solver(
    model_folder: Path, tmp_path: Path, start: Callable[..., Service]
) -> None:
    for file in model_folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    service = start(models=str(tmp_path))
    data = bytearray((tmp_path / "falling.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "falling.onnx").write_bytes(data)
    found = problem(service.http.post("/v1/sessions", json=WATER | {"solver": "hybrid"}), 503)
    assert found["type"] == "urn:hybridmpm:problem:model-damaged"
    assert str(tmp_path) not in json.dumps(found)
    assert service.http.post("/v1/sessions", json=WATER | {"solver": "mpm"}).status_code == 201


def test_phases_reach_back_as_far_as_the_values() -> None:
    log = [(20, "neural"), (84, "mpm"), (300, "neural"), (1250, "mpm")]
    decisions = tuple(
        Decision(frame=frame, mode=mode, value=None, reason="", noticed=frame)  # type: ignore[arg-type]
        for frame, mode in log
    )
    guard = Safeguard(r_c=0.8, value=None, mpm_share=1, frames=(), values=(), decisions=decisions)
    assert guard.phases(1280) == [(84, "mpm"), (300, "neural"), (1250, "mpm")]
    assert guard.phases(100) == [(0, "mpm"), (20, "neural"), (84, "mpm"), (300, "neural"), (1250, "mpm")]
