"""Texts, pictures and SVG paths become outlines, which sketches take; what cannot be traced is refused."""

import base64
import io
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from hybridmpm.client import Client
from hybridmpm.control import Shape, shape_of_picture, shape_of_text

PLACE: dict[str, Any] = {"center": [0.5, 0.5], "height": 0.3}


def _picture(kind: str = "PNG") -> bytes:
    image = Image.new("RGB", (300, 200), "white")
    ImageDraw.Draw(image).ellipse((60, 40, 240, 160), fill="black")
    data = io.BytesIO()
    image.save(data, kind)
    return data.getvalue()


def test_a_text_is_traced_and_filled(service: Any, path: str) -> None:
    answer = service.http.post("/v1/outlines", json={"text": "O", **PLACE})
    assert answer.status_code == 200, answer.text
    sketch, shape = answer.json()["sketch"], shape_of_text("O", **PLACE)
    assert set(sketch) == {"kind", "outlines"}
    assert len(sketch["outlines"]) == 2
    assert answer.json()["area"] == shape.area == Shape(sketch["outlines"]).area
    with Client(f"http://{service.address}") as client:
        traced = client.outlines(text="O", **PLACE)
    assert traced.area == shape.area
    plan = service.http.post(f"{path}/sketches", json={"sketch": sketch, "frames": 60})
    assert plan.status_code == 200, plan.text
    assert len(plan.json()["goal"]["outlines"]) == 2


def test_the_dark_part_of_a_picture_is_traced(service: Any) -> None:
    data = {kind: _picture(kind) for kind in ("PNG", "JPEG", "WEBP")}
    for kind, picture in data.items():
        body = {"picture": base64.b64encode(picture).decode(), **PLACE}
        answer = service.http.post("/v1/outlines", json=body).json()
        low, high = Shape(answer["sketch"]["outlines"]).bounds
        np.testing.assert_allclose([*low, *high], [0.275, 0.35, 0.725, 0.65], atol=0.01, err_msg=kind)
    assert answer["area"] == pytest.approx(np.pi / 4 * 0.45 * 0.3, rel=0.02)
    np.testing.assert_allclose(shape_of_picture(data["PNG"], **PLACE).area, answer["area"], rtol=0.01)


def test_an_svg_path_is_traced(service: Any) -> None:
    answer = service.http.post("/v1/outlines", json={"path": "M0 0 L4 0 L4 2 L0 2 Z", **PLACE}).json()
    assert answer["area"] == pytest.approx(0.6 * 0.3, rel=1e-3)


@pytest.mark.parametrize(
    ("body", "field", "said"),
    [
        ({}, "body", "exactly one of text, picture, path must be given, got none of them"),
        (
            {"text": "A", "path": "M0 0"},
            "body",
            "exactly one of text, picture, path must be given, got text and",
        ),
        ({"text": "  "}, "body.text", "must have letters that can be seen"),
        ({"picture": "%"}, "body.picture", "is no base 64"),
        ({"picture": base64.b64encode(b"GIF89a").decode()}, "body.picture", "no PNG, JPEG or WebP"),
        ({"picture": base64.b64encode(_picture()[:200]).decode()}, "body.picture", "truncated or damaged"),
        ({"path": "M0 0 A1 1"}, "body.path", "A"),
        ({"text": "A", "height": -1.0}, "body.height", "greater than 0"),
        ({"text": "A", "words": 1}, "body.words", "not permitted"),
    ],
)
def test_what_cannot_be_traced_is_refused(service: Any, body: dict[str, Any], field: str, said: str) -> None:
    answer = service.http.post("/v1/outlines", json=PLACE | body)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert said in error["message"]
