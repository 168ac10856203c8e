"""Data sets as jobs: those of the library, bounded, and ended when asked."""

import io
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import data, scenarios
from hybridmpm.client import Client
from hybridmpm.data.generation.assemble import read_split
from hybridmpm.data.generation.executors import Threads
from hybridmpm_service.sessions.turns import Turns


@pytest.fixture(scope="module")
def service(start_module: Callable[..., Any]) -> Any:
    return start_module(max_jobs=4, max_dataset_frames=1000)


@pytest.mark.needs("h5py", "data")
def test_it_is_the_data_set_of_the_library(service: Any, tmp_path: Path) -> None:
    with Client(f"http://{service.address}") as client:
        job = client.make_dataset("water_2d", 2, test=1, seed=7, frames=6, stride=3, r_p=0.25)
        packed = job.result()
    assert (job.info["kind"], job.info["session"], job.info["done"], job.info["total"]) == (
        "dataset",
        None,
        3,
        3,
    )
    with zipfile.ZipFile(io.BytesIO(packed)) as file:
        assert file.namelist() == ["water_2d/metadata.json", "water_2d/test.h5", "water_2d/train.h5"]
        file.extractall(tmp_path)
    recipe = data.Recipe(scenario="water_2d", frames=6, stride=3, r_p=0.25)
    seeds = data.Seeds(train=2, test=1, first=7)
    own = data.plan(recipe, tmp_path / "own", seeds)
    data.generate(own, executor=Threads(1))
    for split in ("train", "test"):
        made, expected = (list(read_split(tmp_path / one, split)) for one in ("water_2d", "own"))
        assert len(made) == len(expected) == seeds.counts()[split]
        for one, other in zip(made, expected, strict=True):
            np.testing.assert_array_equal(one.positions, other.positions)


@pytest.mark.needs("h5py", "data")
def test_it_ends_when_it_is_deleted_and_makes_room_for_the_next(service: Any) -> None:
    asked = {"scenario": "water_3d", "trajectories": 1, "frames": 1000}
    long = service.http.post("/v1/datasets", json=asked)
    assert long.status_code == 202
    address = long.json()["links"]["self"]
    assert long.headers["Location"] == address
    assert service.http.delete(address).status_code == 204
    assert service.http.get(address).status_code == 404
    body = {"scenario": "water_2d", "trajectories": 1, "frames": 4}
    ended = service.ended(service.http.post("/v1/datasets", json=body).json())
    assert ended["phase"] == "done"


@pytest.mark.needs("h5py", "data")
@pytest.mark.parametrize(
    ("changed", "field", "text"),
    [
        ({"scenario": "water_4d"}, "body.scenario", "water_2d"),
        ({"trajectories": 0}, "body", "at least one trajectory"),
        ({"trajectories": 11}, "body.trajectories", "makes 1100 frames in all"),
        ({"frames": 7, "stride": 2}, "body", "multiple of the stride"),
        ({"control": True}, "body.control", "not permitted"),
    ],
)
def test_an_invalid_data_set_is_refused(service: Any, changed: dict[str, Any], field: str, text: str) -> None:
    body = {"scenario": "water_2d", "trajectories": 1, "frames": 100} | changed
    answer = service.http.post("/v1/datasets", json=body)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert text in error["message"]


@pytest.mark.needs("h5py", "data")
def test_the_memory_of_its_trajectories_is_counted(service: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    counted, large, turn = list[int](), list[int](), Turns.turn

    def noted(self: Turns, *, memory: int = 0, **settings: Any) -> Any:
        counted.append(memory)
        return turn(self, memory=memory, **settings)

    monkeypatch.setattr(Turns, "turn", noted)
    for count, frames in ((1, 100), (4, 100), (1, 400)):
        body = {"scenario": "water_2d", "trajectories": count, "frames": frames}
        address = service.http.post("/v1/datasets", json=body).json()["links"]["self"]
        seen = counted.count(0)
        while len(counted) == seen + len(large):  # it is begun in a task
            time.sleep(0.01)
        large.append(counted[-1])
        assert service.http.delete(address).status_code == 204
    one, four, long = large
    particles = len(scenarios.get("water_2d", 0).sample().x)
    assert one == four == 12 * 101 * 2 * particles
    assert long == 12 * 401 * 2 * particles


def test_a_missing_h5py_is_named(service: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.import_module", _missing)
    answer = service.http.post("/v1/datasets", json={"scenario": "water_2d", "trajectories": 1})
    assert answer.status_code == 422
    assert "data sets need h5py" in answer.json()["detail"]


def _missing(name: str) -> Any:
    raise ImportError(name)
