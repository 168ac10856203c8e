"""Answers: ranked by `Accept`, complete though made apart, and one table from exceptions to problems."""

import asyncio
import gzip
import io
import json
import threading
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image, ImageDraw
from starlette.requests import Request

import hybridmpm.errors
from hybridmpm import ConfigError, NonFiniteError, SceneError, SimulationError, UnknownScenarioError
from hybridmpm_service import errors
from hybridmpm_service.errors import UnavailableError, field_path
from hybridmpm_service.http.problems import TABLE, row_of
from hybridmpm_service.http.replies import FRAMES, JSON, NPZ, PLY, VTP, numbers_response, preferred
from hybridmpm_service.sessions import scene_work
from hybridmpm_service.sessions.turns import Turns


def _response(body: dict[str, Any], *, as_npz: bool = False) -> Any:
    async def make() -> Any:
        turns = Turns(1)
        try:
            return await numbers_response(turns, body, as_npz=as_npz)
        finally:
            turns.close(UnavailableError("the test ends"))

    return asyncio.run(make())


def _round_trip(value: Any) -> Any:
    return json.loads(bytes(_response({"value": value, "name": "x"}).body))["value"]


@pytest.mark.parametrize(
    "shape", [(0,), (3,), (5000,), (0, 2), (7, 2), (9000, 3), (3, 5000, 2), (2, 3, 2), (3, 0, 2)]
)
def test_an_array_of_any_shape_comes_back(shape: tuple[int, ...]) -> None:
    array: npt.NDArray[np.float32] = np.random.default_rng(0).random(shape, dtype=np.float32)
    assert _round_trip(array) == array.tolist()


@pytest.mark.parametrize("as_npz", [True, False])
def test_encoding_runs_in_another_thread_or_process(as_npz: bool, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: FBT001
    threads: list[int] = []

    class Body(dict[str, Any]):
        def items(self) -> Any:
            threads.append(threading.get_ident())
            return super().items()

    _response(Body(value=np.zeros(3)), as_npz=as_npz)
    assert threads
    assert threading.get_ident() not in threads
    monkeypatch.setattr(scene_work.json, "dumps", None)
    assert len(_round_trip(np.zeros(5000))) == 5000


def test_nan_is_null_in_json() -> None:
    assert _round_trip(np.array([[np.nan, 1.0]])) == [[None, 1.0]]


@pytest.mark.parametrize(
    ("accept", "chosen"),
    [
        ([], JSON),
        ([f"{JSON}, {NPZ};q=0.1"], JSON),
        ([f"{JSON};q=0.1, {NPZ}"], NPZ),
        ([f"{NPZ};q=0, */*"], JSON),
        ([f"{NPZ};q=0"], JSON),
        ([f"{JSON};q=0, {NPZ};q=0.0"], JSON),
        ([f"{JSON};q=0, */*;q=0.5"], NPZ),
        ([f"{NPZ}, */*"], NPZ),
        ([f"*/*, {VTP}"], VTP),
        ([f"application/*;q=0.2, {PLY};q=0.3"], PLY),
        ([f"{PLY};q=0.5", f"{VTP};q=0.6"], VTP),
        ([f"{PLY}, {VTP}"], PLY),
        ([f"{NPZ.upper()} ; Q=0.9 , {JSON};charset=utf-8;q=0.2"], NPZ),
        ([f"{NPZ};q=x, {JSON};q=0.001"], JSON),
        (["image/png"], JSON),
        (["", ", ,"], JSON),
    ],
)
def test_accept_is_ranked_by_quality_and_specificity(accept: list[str], chosen: str) -> None:
    headers = [(b"accept", line.encode()) for line in accept]
    request = Request({"type": "http", "headers": headers})
    assert preferred(request, NPZ, PLY, VTP) == chosen


def _picture(kind: str, size: tuple[int, int] = (320, 240)) -> bytes:
    image = Image.new("RGB", size, "white")
    pen = ImageDraw.Draw(image)
    pen.line([(60, 60), (250, 180)], fill="red", width=6)
    pen.line([(205, 180), (250, 180), (235, 140)], fill="red", width=6)
    data = io.BytesIO()
    image.save(data, kind)
    return data.getvalue()


def test_routes_that_choose_follow_the_ranks(service: Any, path: str) -> None:
    ranked = {"accept": f"{JSON}, {NPZ};q=0.1, {FRAMES};q=0.2"}
    stroke: Any = {"strokes": [{"points": [[0.3, 0.3], [0.6, 0.5]]}], "frames": 4}
    answers = [
        service.http.get(f"{path}/particles", headers=ranked),
        service.http.post(f"{path}/advance", json={"frames": 1}, headers=ranked),
        service.http.post(f"{path}/trajectories", json=stroke, headers=ranked),
    ]
    for answer in answers:
        assert answer.status_code == 200, answer.text
        assert answer.headers["content-type"].startswith(JSON)
    unranked = {"accept": f"{JSON};q=0.5, {NPZ}"}
    assert service.http.get(f"{path}/particles", headers=unranked).headers["content-type"] == NPZ


@pytest.mark.parametrize("encoding", ["gzip", "br", "x-made-up", "identity, gzip"])
def test_an_encoded_body_is_415(service: Any, path: str, encoding: str) -> None:
    body = gzip.compress(json.dumps({"frames": 1}).encode())
    headers = {"content-encoding": encoding, "content-type": JSON}
    answer = service.http.post(f"{path}/advance", content=body, headers=headers)
    assert answer.status_code == 415
    assert encoding in answer.json()["detail"]
    headers["content-encoding"] = "identity"
    assert service.http.post(f"{path}/advance", content=b'{"frames": 1}', headers=headers).status_code == 200


def test_empty_fields_are_absent_and_any_picture_is_read(service: Any, path: str) -> None:
    empty = {"frames": "", "cap": "", "method": "", "seed": "", "hold": ""}
    for kind in ("PNG", "JPEG", "WEBP"):
        files = {"sketch": ("drawing", _picture(kind), f"image/{kind.lower()}")}
        answer = service.http.post(f"{path}/sketches", files=files, data=empty)
        assert answer.status_code == 200, answer.text
        sketch = answer.json()["sketch"]
        assert sketch["kind"] == "arrow"
        assert "not square (512 : 384)" in sketch["note"]
    square = {"sketch": ("drawing", _picture("PNG", (300, 300)), "image/png")}
    assert "note" not in service.http.post(f"{path}/sketches", files=square, data=empty).json()["sketch"]


def test_a_picture_without_a_filename_says_so(service: Any, path: str) -> None:
    answer = service.http.post(f"{path}/sketches", files={"sketch": (None, bytes(2000))})
    assert answer.status_code == 422
    assert "with a filename" in answer.text


def test_a_class_without_a_row_has_that_of_its_nearest_parent() -> None:
    assert row_of(NonFiniteError("x")) is TABLE[SimulationError]
    assert row_of(ConfigError("x")) is TABLE[SimulationError]
    assert row_of(UnknownScenarioError("x")) is TABLE[SceneError]


def test_an_unexpected_exception_is_a_500() -> None:
    assert row_of(KeyError("x")).status == 500


@pytest.mark.parametrize("name", hybridmpm.errors.__all__)
def test_no_error_of_the_library_is_a_500(name: str) -> None:
    assert row_of(getattr(hybridmpm.errors, name)("x")).status < 500


def test_no_error_of_the_service_is_a_500() -> None:
    kinds = [
        kind
        for kind in vars(errors).values()
        if isinstance(kind, type) and kind.__module__ == errors.__name__
    ]
    assert len(kinds) >= 9
    for kind in kinds:
        assert row_of(kind("x", "y") if kind is errors.FieldError else kind("x")).status != 500


def test_every_row_has_its_own_type() -> None:
    slugs = [row.slug for row in TABLE.values()]
    assert len(set(slugs)) == len(slugs)


def test_field_paths_read_like_code() -> None:
    assert field_path(("body", "strokes", 0, "points", 12, 1)) == "body.strokes[0].points[12][1]"
