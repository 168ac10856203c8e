"""Every tool at the width of a desktop and of a phone, and the strength and duration of tools."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator, Route, ViewportSize, expect

from .conftest import LiveService, Open, Visit, collect

pytestmark = pytest.mark.browser

WATER = "renderer=canvas2d&scenario=water_2d&seed=0"
SIZES: list[ViewportSize] = [
    {"width": 1440, "height": 900},
    {"width": 1100, "height": 640},
    {"width": 920, "height": 800},
    {"width": 390, "height": 844},
]
ON_ITS_SIDE: ViewportSize = {"width": 844, "height": 390}
"""A phone that is held sideways."""
FORCE_COLOR = (0xFF, 0x9F, 0x43)


def _choose(visit: Visit, name: str) -> None:
    visit.page.get_by_role("radio", name=name, exact=True).click()
    visit.wait_for(f"body.tool === '{name.lower()}'")


def _answered(visit: Visit, points: list[tuple[float, float]]) -> dict[str, Any]:
    with visit.page.expect_response("**/sketches") as answer:
        visit.drag(points)
    plan: dict[str, Any] = answer.value.json()
    return plan


def _painted(visit: Visit, color: tuple[int, int, int]) -> int:
    """Return how many pixels of the overlay are of a colour."""
    script = """(canvas, color) => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) {
        if (data[i + 3] > 200 && color.every((value, k) => Math.abs(data[i + k] - value) < 24)) count += 1;
      }
      return count;
    }"""
    count: int = visit.page.locator("#overlay").evaluate(script, list(color))
    return count


@pytest.mark.parametrize("viewport", [SIZES[0], SIZES[-1]], ids=["desktop", "phone"])
def test_each_tool_does_what_it_says(open_page: Open, service: LiveService, viewport: ViewportSize) -> None:
    visit = open_page(WATER, viewport=viewport, paused_at=5)
    assert visit.value("tool") == "push"
    # A push starts the player.
    visit.drag([(0.3, 0.4), (0.5, 0.4)], release=False)
    visit.wait_for("body.playing === 'true'")
    visit.page.mouse.up()
    visit.press_until("Space", "body.playing === 'false'")

    _choose(visit, "Arrow")
    assert _answered(visit, [(0.45, 0.4), (0.55, 0.5)])["sketch"]["kind"] == "arrow"
    visit.wait_for("body.control === 'following'")
    visit.page.get_by_role("button", name="Let go").click()
    visit.wait_for("body.control === 'idle'")

    _choose(visit, "Oval")
    assert _answered(visit, [(0.4, 0.4), (0.65, 0.6)])["sketch"]["kind"] == "ellipse"
    visit.wait_for("body.control === 'following'")
    visit.page.keyboard.press("Control+z")
    visit.wait_for("body.control === 'idle'")
    visit.eventually(lambda: service.get(f"/v1/sessions/{visit.session}")["control"] is None)

    _choose(visit, "Free")
    assert _answered(visit, [(0.4, 0.4), (0.45, 0.5), (0.55, 0.55)])["sketch"]["kind"] == "arrow"
    visit.wait_for("body.control === 'following'")


def test_strength_duration_and_hold_go_with_the_sketch_and_the_hand(open_page: Open) -> None:
    sent: list[dict[str, Any]] = []

    visit = open_page(WATER, prepare=lambda page: collect(page, "framesent", sent), paused_at=5)
    expect(visit.page.locator("#duration-out")).to_have_text("as needed")
    expect(visit.page.locator("#hold-out")).to_have_text("none")
    visit.page.locator("#strength").fill("50")
    visit.page.locator("#duration").fill("120")
    visit.page.locator("#hold").fill("40")
    expect(visit.page.locator("#strength-out")).to_have_text("50 %, up to 7.5 g")
    expect(visit.page.locator("#duration-out")).to_have_text("0.30 s, 120 frames")
    expect(visit.page.locator("#hold-out")).to_have_text("0.10 s, 40 frames")
    _choose(visit, "Arrow")
    plan = _answered(visit, [(0.45, 0.4), (0.5, 0.45)])
    assert (plan["needs"]["cap"], plan["frames"], plan["hold"]) == (7.5, 120, 40)
    _choose(visit, "Push")
    sent.clear()
    visit.drag([(0.3, 0.4), (0.5, 0.4)])
    visit.eventually(lambda: bool(sent) and sent[-1]["type"] == "push_end")
    assert {push["cap"] for push in sent if push["type"] == "push"} == {7.5}


def test_the_picture_plays_on_beside_a_prediction_while_a_sketch_is_planned(open_page: Open) -> None:
    visit = open_page(WATER, until="body.state === 'live' && Number(body.frame) > 5")
    held: list[Route] = []
    visit.page.route("**/sketches", lambda route: held.append(route))  # noqa: PLW0108 - Playwright marks it
    _choose(visit, "Arrow")
    visit.drag([(0.35, 0.4), (0.55, 0.6)])
    visit.eventually(lambda: bool(held))
    start = visit.frame
    visit.wait_for(f"body.control === 'planning' && Number(body.frame) > {start + 20}")
    expect(visit.page.locator("#steer-text")).to_have_text("Planning…")
    # The dots of the prediction walk along the way.
    overlay = visit.page.locator("#overlay")
    drawn = overlay.evaluate("(canvas) => canvas.toDataURL()")
    visit.eventually(lambda: overlay.evaluate("(canvas) => canvas.toDataURL()") != drawn)
    assert visit.value("control") == "planning"
    held[0].continue_()
    visit.wait_for("body.control === 'following'")


def test_forces_are_shown_on_demand(open_page: Open, service: LiveService) -> None:
    visit = open_page(WATER, paused_at=5)
    _choose(visit, "Arrow")
    _answered(visit, [(0.45, 0.4), (0.55, 0.55)])
    visit.wait_for("body.control === 'following'")
    visit.page.wait_for_timeout(300)
    before = _painted(visit, FORCE_COLOR)
    visit.page.keyboard.press("g")
    expect(visit.page.locator("#forces")).to_be_checked()
    visit.eventually(lambda: _painted(visit, FORCE_COLOR) > before + 200)
    field = service.get(f"/v1/sessions/{visit.session}/force")
    assert np.linalg.norm(field["force"], axis=1).max() > 1
    visit.page.locator("#forces").uncheck()
    visit.eventually(lambda: _painted(visit, FORCE_COLOR) == before)


@pytest.mark.parametrize("scenario", ["water_2d", "water_3d"])
def test_all_tools_have_room(open_page: Open, scenario: str) -> None:
    visit = open_page(f"renderer=canvas2d&scenario={scenario}&seed=1", paused_at=1)
    for size, side in zip((*SIZES, ON_ITS_SIDE), (770, 510, 550, 390, 340), strict=True):
        visit.page.set_viewport_size(size)
        assert visit.page.evaluate("document.documentElement.scrollWidth") == size["width"]
        boxes = [_box(button) for button in visit.page.locator(".toolbar button:visible").all()]
        assert len(boxes) == (8 if scenario == "water_2d" else 9)
        toolbar = _box(visit.page.locator(".toolbar"))
        for box in boxes:
            if (scenario, size["width"]) == ("water_2d", 390):
                assert box.width >= 40
                assert box.height >= 44
            assert box.y + box.height <= size["height"]
            assert toolbar.x <= box.x
            assert box.x + box.width <= toolbar.x + toolbar.width + 0.5, size
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2)), size
        # What the tool does is said in sight, not under the toolbar, and the picture takes the room there is.
        line, view = _box(visit.page.locator("#steerline")), _box(visit.page.locator("#view"))
        assert not line.overlaps(toolbar)
        assert not line.overlaps(view)
        assert not view.overlaps(toolbar)
        assert line.y + line.height <= size["height"]
        assert view.width == view.height >= side, size


@dataclass(frozen=True)
class Rectangle:
    """Where an element is on the screen [px]."""

    x: float
    y: float
    width: float
    height: float

    def overlaps(self, other: "Rectangle") -> bool:
        """Whether a part of both, more than a rounding, is at the same place."""
        across = min(self.x + self.width, other.x + other.width) - max(self.x, other.x)
        down = min(self.y + self.height, other.y + other.height) - max(self.y, other.y)
        return min(across, down) > 0.5


def _box(element: Locator) -> Rectangle:
    found = element.bounding_box()
    assert found is not None
    return Rectangle(**found)


@pytest.mark.parametrize("viewport", [SIZES[0], pytest.param(SIZES[-1], marks=pytest.mark.long)])
def test_a_tank_is_drawn_and_steered_in_its_own_proportions(
    open_page: Open, service: LiveService, viewport: ViewportSize
) -> None:
    scene = {
        "dim": 2,
        "resolution": 40,
        "world": {"size": [1.6, 0.6]},
        "walls": {"lower": [0.1, 0.1], "upper": [1.5, 0.5]},
        "bodies": [{"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.7, 0.3]}],
    }
    session = service.post("/v1/sessions", {"scene": scene})["id"]
    query = f"renderer=canvas2d&session={session}"
    visit = open_page(query, viewport=viewport, until="body.state === 'live'")
    box = visit.page.locator("#overlay").bounding_box()
    across = 1.4 + 2 * 0.035 * 1.6  # walls and the margin of camera.js
    scale = box["width"] / across
    assert box["height"] == pytest.approx(scale * (0.4 + 2 * 0.035 * 1.6), abs=1)
    assert box["width"] > 0.6 * viewport["width"]

    _choose(visit, "Arrow")
    points = [(0.4, 0.2), (1.2, 0.35)]
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    places = [(middle[0] + (x - 0.8) * scale, middle[1] - (y - 0.3) * scale) for x, y in points]
    with visit.page.expect_request("**/sketches") as asked:
        visit.page.mouse.move(*places[0])
        visit.page.mouse.down()
        visit.page.mouse.move(*places[1])
        visit.page.mouse.up()
    stroke = asked.value.post_data_json["strokes"][0]["points"]
    assert np.array(stroke) == pytest.approx(np.array(points), abs=1.5 / scale)
