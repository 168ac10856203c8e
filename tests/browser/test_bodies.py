"""Rigid bodies on the page: they are drawn where they are, and dragged by hand."""

import io
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from .conftest import LiveService, Open, Visit, collect
from .test_lead import Messages, attached, play_here, replays

pytestmark = pytest.mark.browser


def _scene(dim: int) -> dict[str, Any]:
    water = {"shape": "box", "material": "water", "lower": [0.1] * dim, "upper": [0.9, 0.2, 0.9][:dim]}
    crate = {"shape": "box", "lower": [0.3, 0.4, 0.4][:dim], "upper": [0.5, 0.5, 0.6][:dim], "density": 500.0}
    ball = {"shape": "ball", "center": [0.7, 0.6, 0.5][:dim], "radius": 0.08, "density": 2500.0}
    return {"dim": dim, "resolution": 20, "bodies": [water], "rigid": [crate, ball]}


def _shown(visit: Visit) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return the places (P, 2) of the pixels that show bodies, and their colours (P, 3)."""
    picture = np.array(Image.open(io.BytesIO(visit.page.locator("#view").screenshot())).convert("RGB"))
    red, green, blue = np.moveaxis(picture.astype(int), 2, 0)
    rows, columns = np.nonzero((red > 1.3 * green) & (green > 1.3 * blue) & (red > 60))
    return np.stack([columns, rows], axis=1), picture[rows, columns]


def _centers(visit: Visit, service: LiveService, session: str) -> list[tuple[float, float]]:
    """Return where the centres of the bodies are within the picture [px], in the front view."""
    box = visit.page.locator("#view").bounding_box()
    assert box is not None
    numbers = service.get(f"/v1/sessions/{session}/particles")["rigid"]
    return [(x - box["x"], y - box["y"]) for x, y in (visit.pixel(one[0], one[1]) for one in numbers)]


@pytest.mark.parametrize(
    ("dim", "renderer"),
    [(2, "canvas2d"), (3, "canvas2d"), pytest.param(3, "webgl2", marks=pytest.mark.long)],
)
def test_bodies_are_drawn_where_they_are(
    open_page: Open, service: LiveService, dim: int, renderer: str
) -> None:
    session = service.post("/v1/sessions", {"scene": _scene(dim)})["id"]
    visit = open_page(f"renderer={renderer}&simulate=server&session={session}")
    visit.wait_for("body.state === 'live' && body.frame === '0'")
    if dim == 3:
        visit.page.keyboard.press("p")  # strokes are taken in the front view
        visit.page.wait_for_timeout(700)
    for frame in (0, 60):
        if frame:
            service.advance(session, frame)
            visit.wait_for(f"body.frame === '{frame}'")
        visit.eventually(lambda: len(_shown(visit)[0]) > 500)
        places, colours = _shown(visit)
        centers = _centers(visit, service, session)
        middle = np.mean([x for x, _ in centers])
        for center, left in zip(centers, (True, False), strict=True):
            mine = places[(places[:, 0] < middle) == left]
            assert (mine.min(axis=0) + mine.max(axis=0)) / 2 == pytest.approx(center, abs=6)
        # A mark of another tint shows how they are turned.
        assert len(np.unique(colours // 32, axis=0)) > 3
    assert visit.errors == []
    service.end(session)


def test_a_body_is_dragged_by_hand(open_page: Open, service: LiveService) -> None:
    session = service.post("/v1/sessions", {"scene": _scene(2)})["id"]
    sent: list[dict[str, Any]] = []
    visit = open_page(
        f"renderer=canvas2d&simulate=server&session={session}",
        prepare=lambda page: collect(page, "framesent", sent),
    )
    visit.wait_for("body.state === 'live' && body.frame === '0'")
    visit.eventually(lambda: len(_shown(visit)[0]) > 500)
    expect(visit.page.locator("#steer-text")).to_contain_text("or a body to pull it")
    visit.drag([(0.35, 0.45), (0.35, 0.6), (0.4, 0.75)], release=False)
    assert visit.value("held") == "0"
    visit.eventually(lambda: service.get(f"/v1/sessions/{session}/particles")["rigid"][0][1] > 0.6)
    visit.page.mouse.up()
    visit.wait_for("body.held === ''")
    visit.press_until("Space", "body.playing === 'false'")
    pulls = [one for one in sent if one["type"] == "pull"]
    assert pulls[0]["grip"] == pytest.approx([-0.05, 0.0], abs=0.01)
    assert pulls[-1]["target"] == pytest.approx([0.4, 0.75], abs=0.01)
    # A hand that rests sends nothing.
    assert all(a["target"] != b["target"] for a, b in pairwise(pulls))
    # The weight of a square of water with three tenths of the side between the walls.
    assert [one["strength"] for one in pulls] == pytest.approx([1000 * 0.24**2 * 9.81] * len(pulls))
    log = service.get(f"/v1/sessions/{session}/log")
    assert [log["inputs"][0]["kind"], log["inputs"][-1]["kind"]] == ["pull", "push"]
    again = service.post("/v1/sessions", {"log": log})
    assert again["notice"] is None
    # Beside the bodies the hand pushes the fluid.
    sent.clear()
    visit.drag([(0.2, 0.15), (0.3, 0.15)])
    visit.eventually(lambda: bool(sent) and sent[-1]["type"] == "push_end")
    assert {one["type"] for one in sent} >= {"push"}
    assert "pull" not in {one["type"] for one in sent}
    for one in (session, again["id"]):
        service.end(one)


@pytest.mark.long
@pytest.mark.parametrize("dim", [2, 3])
def test_a_tab_that_leads_drags_with_the_bits_of_the_server(
    open_page: Open, service: LiveService, dim: int
) -> None:
    messages = Messages()
    visit, session = attached(open_page, service, {"scene": _scene(dim)}, messages)
    play_here(visit)
    visit.page.keyboard.press("p")
    crate = service.get(f"/v1/sessions/{session}/particles")["rigid"][0]
    visit.drag([(crate[0], crate[1]), (0.4, 0.5), (0.4, 0.75)], release=False)
    assert visit.value("held") == "0"
    visit.eventually(lambda: service.get(f"/v1/sessions/{session}/particles")["rigid"][0][1] > 0.6)
    assert visit.value("simulated") == "here"
    visit.page.mouse.up()
    visit.press_until("Space", "body.playing === 'false' && body.simulated === 'server'")
    assert messages.asked() >= messages.answered() != set()
    assert "pull" in {one["kind"] for one in replays(service, session)["inputs"]}
