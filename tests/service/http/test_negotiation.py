"""`Accept` is ranked on every route that chooses, encodings are refused, and empty fields are absent."""

import gzip
import io
import json
from typing import Any

import pytest
from PIL import Image, ImageDraw
from starlette.requests import Request

from hybridmpm_service.http.replies import FRAMES, JSON, NPZ, PLY, VTP, preferred


@pytest.mark.parametrize(
    ("accept", "chosen"),
    [
        ([], JSON),
        (["*/*"], JSON),
        ([NPZ], NPZ),
        ([f"{JSON}, {NPZ};q=0.1"], JSON),
        ([f"{JSON};q=0.1, {NPZ}"], NPZ),
        ([f"{NPZ};q=0, */*"], JSON),
        ([f"{JSON};q=0, */*;q=0.5"], NPZ),
        ([f"{NPZ}, */*"], NPZ),
        ([f"*/*, {VTP}"], VTP),
        (["application/*, text/html"], JSON),
        ([f"application/*;q=0.2, {PLY};q=0.3"], PLY),
        ([f"{PLY};q=0.5", f"{VTP};q=0.6"], VTP),
        ([f"{VTP}, {PLY}"], VTP),
        ([f"{PLY}, {VTP}"], PLY),
        ([f"{NPZ.upper()} ; Q=0.9 , {JSON};charset=utf-8;q=0.2"], NPZ),
        ([f"{NPZ};q=x, {JSON};q=0.001"], JSON),
        ([f"{NPZ};q=2"], JSON),
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
