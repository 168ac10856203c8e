"""Checks and plans over HTTP are those of the library, and so is what a session has of them."""

import json
from typing import Any

import numpy as np
import pytest
from tests.service.conftest import SMALL_SCENE, problem
from websockets.sync.client import connect

from hybridmpm import MeshObstacle, Scene, check, plan, scenarios
from hybridmpm.client import Client
from hybridmpm_service.http.answers import MOST_FINDINGS

BLOCK = {"shape": "box", "material": "water", "lower": [0.2, 0.2], "upper": [0.4, 0.4]}
THIN = {"shape": "box", "lower": [0.5, 0.1], "upper": [0.6, 0.103]}


def scene(*bodies: dict[str, Any], **fields: Any) -> dict[str, Any]:
    return {"dim": 2, "resolution": 32, "bodies": list(bodies or (BLOCK,)), **fields}


def test_a_check_answers_figures_and_findings(service: Any) -> None:
    made = scene(obstacles=[THIN])
    found = service.http.post("/v1/checks", json={"scene": made}).json()
    expected = check(Scene.parse(made)).to_dict()
    assert found.pop("milliseconds") > 0
    assert found == {name: value for name, value in expected.items() if name != "milliseconds"}
    assert [one["field"] for one in found["findings"]] == ["obstacles[0]"]
    assert service.http.get("/v1/sessions").json()["sessions"] == []


def test_a_check_is_made_for_the_chosen_simulator(service: Any) -> None:
    plain, coarse, network = (
        service.http.post("/v1/checks", json={"scenario": "water_2d", "seed": 7, **who}).json()
        for who in ({}, {"coarse": "1/16"}, {"solver": "neural"})
    )
    assert plain["particles"] == coarse["particles"] == len(scenarios.water_2d(7).sample().x)
    assert coarse["substeps"] < plain["substeps"]
    assert (plain["stable"], network["stable"]) == (True, None)


@pytest.mark.parametrize(
    ("sent", "field", "words"),
    [
        ({"dim": 2, "resolution": 4, "bodies": []}, "resolution", "must be in [8, 4096] cells per metre"),
        (scene(resolution=64, dim=3), "bodies[0].lower", "dim = 3"),
        (scene(BLOCK, BLOCK), "bodies[1]", "room for no particle"),
        (
            scene(
                {
                    **BLOCK,
                    "material": {"kind": "water", "bulk_modulus": 1e12, "density": 10},
                    "upper": [0.25, 0.25],
                }
            ),
            "bodies[0]",
            "at most 20000 are taken",
        ),
    ],
    ids=["faulty", "of another dimension", "cannot be filled", "too stiff"],
)
def test_the_faults_of_a_scene_that_cannot_run_are_findings(
    service: Any, sent: dict[str, Any], field: str, words: str
) -> None:
    answer = service.http.post("/v1/checks", json={"scene": sent})
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert not found["ok"]
    matching = [one for one in found["findings"] if one["field"] == field and words in one["problem"]]
    assert matching[0]["severity"] == "error"
    # No session is made of it.
    body = problem(service.http.post("/v1/sessions", json={"scene": sent}), 422)
    assert words in body["detail"]


def test_limits_of_the_server_are_findings_too(start: Any) -> None:
    service = start(max_frame_cost=1000)
    found = service.http.post("/v1/checks", json={"scenario": "water_2d"}).json()
    assert not found["ok"]
    assert "this server takes up to 1000" in found["findings"][0]["problem"]


@pytest.mark.filterwarnings("ignore::hybridmpm.ThinObstacleWarning")
def test_a_session_carries_its_warnings_and_so_does_its_fork(service: Any) -> None:
    # Many findings would make status messages long.
    many = [{**THIN, "lower": [0.5, 0.1 + 0.03 * k], "upper": [0.6, 0.103 + 0.03 * k]} for k in range(25)]
    for obstacles, count in (([], 0), ([THIN], 1), (many, MOST_FINDINGS)):
        made = service.http.post("/v1/sessions", json={"scene": scene(obstacles=obstacles)}).json()
        fork = service.http.post(made["links"]["fork"]).json()
        for session in (made, fork, service.http.get(made["links"]["self"]).json()):
            assert len(session["findings"]) == count
        for session in (made, fork):
            service.http.delete(session["links"]["self"])


def test_bad_requests_are_problems(service: Any) -> None:
    for sent, words in (
        ({}, "give one of"),
        ({"scenario": "water_2d", "scene": scene()}, "give one of"),
        ({"scene": scene(), "seed": 1}, "belongs to a scenario"),
        ({"scenario": "lava"}, "lava"),
        ({"scenario": "water_2d", "coarse": "1/3"}, "coarse"),
        ({"scenario": "water_2d", "log": {}}, "log"),
    ):
        assert words in problem(service.http.post("/v1/checks", json=sent), 422)["detail"]


@pytest.fixture(autouse=True)
def _no_times_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDMPM_CALIBRATION", "none.json")


def test_a_plan_is_that_of_the_library_and_a_session_can_use_it(service: Any) -> None:
    with Client(str(service.http.base_url)) as client:
        found = client.plan("water_2d", 7, max_error=0.5)
        expected = plan(scenarios.water_2d(7), max_error=0.5)
        assert {name: found[name] for name in ("name", "error", "ms_per_frame", "reason")} == {
            "name": expected.name,
            "error": expected.error,
            "ms_per_frame": expected.ms_per_frame,
            "reason": expected.reason,
        }
        assert found["feasible"]
        answers = [client.plan("water_2d", 7, budget_ms=ms) for ms in (0.05, 0.1, 0.2, 0.5, 1.0, 5.0)]
        for one in (one for one in answers if one["session"] is not None):
            session = client.create("water_2d", 7, **one["session"])
            assert session.info["r_p"] == pytest.approx(one["r_p"])
            assert session.info["coarse"] is None or session.info["coarse"] in one["name"]
            session.delete()
        assert any(one["session"] and "coarse" in one["session"] for one in answers)
        # No session has a part of the particles alone.
        assert client.plan(scene=scenarios.water_2d(7), budget_ms=1e-6)["session"] is None


def test_a_plan_for_a_scene_of_ones_own_has_fields_of_a_session(service: Any) -> None:
    answer = service.http.post("/v1/plans", json={"scene": SMALL_SCENE, "budget_ms": 100})
    assert answer.json()["session"] == {"solver": "mpm"}


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"scenario": "water_2d"}, "max_error"),
        ({"scenario": "water_2d", "max_error": 0.1, "budget_ms": 1.0}, "max_error"),
        ({"budget_ms": 1.0}, "scenario"),
        ({"scenario": "water_2d", "max_error": 0.1, "measure": "beauty"}, "grid_rmse"),
        ({"scenario": "water_9d", "budget_ms": 1.0}, "water_2d"),
        ({"scene": {"dim": 4}, "budget_ms": 1.0}, "dim"),
    ],
)
def test_an_invalid_demand_is_refused(service: Any, body: dict[str, Any], said: str) -> None:
    answer = service.http.post("/v1/plans", json=body)
    assert answer.status_code == 422
    assert said in answer.text


def _of_many_triangles(service: Any, shape: dict[str, Any]) -> None:
    """Require that a surface of more numbers than a request may have stays with its session, as two texts."""
    body = {"shape": "box", "lower": [0.3, 0.7, 0.3], "upper": [0.7, 0.8, 0.7], "material": "water"}
    scene = {"dim": 3, "resolution": 16, "bodies": [body], "obstacles": [shape]}
    assert len(MeshObstacle.model_validate(shape).triangles) == 10_000
    paths = [service.create(scene)]
    assert service.http.post(f"{paths[0]}/advance", json={"frames": 2}).status_code == 200
    with connect(f"ws://{service.address}{paths[0]}/stream?version=3") as stream:
        (shown,) = json.loads(stream.recv())["scene"]["obstacles"]
    corners = np.array(shown["vertices"])[np.array(shown["triangles"])]
    assert 2000 < len(corners) <= 5000
    # As a picture it is the same: its volume is.
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert abs(volume) == pytest.approx(MeshObstacle.model_validate(shape).measure, rel=0.05)
    log = service.http.get(f"{paths[0]}/log").json()
    assert log["scene"]["obstacles"][0].items() >= shape.items()
    again = service.http.post("/v1/sessions", json={"log": log}).json()
    assert again["notice"] is None
    paths.append(again["links"]["self"])
    # The same fields are a goal.
    goal = {"kind": "solid"} | {name: shape[name] for name in ("vertices", "triangles")}
    where = problem(service.http.post(f"{paths[1]}/sketches", json={"sketch": goal}), 422)["detail"]
    assert "no part of the solid is free: it lies in obstacles" in where
    damaged = scene | {"obstacles": [shape | {"triangles": shape["triangles"][:-16]}]}
    answer = service.http.post("/v1/sessions", json={"scene": damaged})
    assert "obstacles[0].triangles: must be closed, but have" in problem(answer, 422)["detail"]
    for path in paths:
        service.http.delete(path)


@pytest.mark.needs("trimesh", "shapes")
def test_shapes_of_files_are_fields_of_bodies_and_faults_are_named(service: Any) -> None:
    import trimesh

    def sent(data: str | bytes, **query: Any) -> Any:
        return service.http.post("/v1/shapes", params={"height": 0.2} | query, content=data)

    box = trimesh.creation.box((2, 1, 1))
    shape = sent(box.export(file_type="stl"), kind="stl", y=0.4).json()
    assert (shape["shape"], len(shape["vertices"]), len(shape["triangles"])) == ("mesh", 8, 12)
    lower = MeshObstacle.model_validate(shape).bounds[0]
    assert lower.tolist() == pytest.approx([0.3, 0.3, 0.4])
    box.update_faces([True] * 11 + [False])
    answer = sent(box.export(file_type="stl"), kind="stl")
    assert "3 open edges" in problem(answer, 422)["detail"]
    ring = trimesh.creation.torus(0.2, 0.08, major_sections=100, minor_sections=50)
    _of_many_triangles(service, sent(ring.export(file_type="ply"), kind="ply").json())
    drawn = '<g transform="scale(2 1)"><rect width="3" height="4"/></g>'
    found = sent(f'<svg xmlns="http://www.w3.org/2000/svg">{drawn}</svg>', kind="svg").json()
    assert "triangles" not in found or found["triangles"] is None
    assert np.ptp(np.array(found["vertices"]), axis=0).tolist() == pytest.approx([0.3, 0.2])
    answer = sent('<!DOCTYPE a [<!ENTITY b "c">]><svg>&b;</svg>', kind="svg")
    assert "entities" in problem(answer, 422)["detail"]
    answer = sent("", kind="doc")
    assert problem(answer, 422)["errors"][0]["field"] == "query.kind"
