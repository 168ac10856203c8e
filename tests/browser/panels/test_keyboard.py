"""Every tool by the keyboard alone, drawing among them."""

from typing import Any

import pytest
from playwright.sync_api import expect
from tests.browser.conftest import LIVE, WIDTHS, LiveService, Open, Visit

pytestmark = pytest.mark.browser

SCENE = "renderer=canvas2d&scenario=water_2d&seed=3"


def _on_stage(open_page: Open, query: str = SCENE, **options: Any) -> Visit:
    """Open a page and walk to the picture with the Tab key."""
    visit = open_page(query, **options, until=LIVE)
    for _ in range(12):
        visit.page.keyboard.press("Tab")
        if visit.page.evaluate("document.activeElement.id") == "overlay":
            return visit
    raise AssertionError("the Tab key does not lead to the picture")


def _draw(visit: Visit, *keys: str) -> None:
    visit.page.keyboard.press("Enter")
    for key in keys:
        visit.page.keyboard.press(key)
    visit.page.keyboard.press("Enter")


@pytest.mark.parametrize("width", WIDTHS)
def test_an_arrow_and_an_oval_are_drawn(open_page: Open, service: LiveService, width: int) -> None:
    visit = _on_stage(open_page, viewport={"width": width, "height": 844})
    for tool, kind in (("a", "arrow"), ("o", "ellipse")):
        visit.page.keyboard.press(tool)
        _draw(visit, *["Shift+ArrowRight"] * 2, *["Shift+ArrowUp"] * 2)
        visit.eventually(lambda kind=kind: _kind(service, visit) == kind)
        visit.page.keyboard.press("Escape")
        visit.eventually(lambda: _kind(service, visit) is None)


def _kind(service: LiveService, visit: Visit) -> str | None:
    control = service.get(f"/v1/sessions/{visit.session}")["control"]
    return None if control is None else str(control["kind"])


def test_a_push_is_held_between_two_presses(open_page: Open, service: LiveService) -> None:
    visit = _on_stage(open_page)
    visit.page.keyboard.press("p")
    _draw(visit, *["ArrowRight"] * 6)
    visit.eventually(lambda: len(service.get(f"/v1/sessions/{visit.session}/log")["inputs"]) >= 2)
    inputs = service.get(f"/v1/sessions/{visit.session}/log")["inputs"]
    assert {one["kind"] for one in inputs} == {"push"}
    pushes = [one["push"] for one in inputs if one["push"] is not None]
    assert pushes[-1]["point"][0] > pushes[0]["point"][0] or len(pushes) == 1


def test_a_stroke_is_dropped_where_the_picture_is_left(open_page: Open, service: LiveService) -> None:
    visit = _on_stage(open_page)
    visit.page.keyboard.press("a")
    visit.page.keyboard.press("Enter")
    visit.page.keyboard.press("Shift+ArrowRight")
    expect(visit.page.locator("body")).to_have_attribute("data-control", "drawing")
    visit.page.keyboard.press("Tab")
    expect(visit.page.locator("body")).to_have_attribute("data-control", "idle")


def test_a_scene_in_space_is_turned(open_page: Open, service: LiveService) -> None:
    visit = _on_stage(open_page, "renderer=canvas2d&scenario=sand_3d&seed=1&coarse=1%2F16")
    visit.page.keyboard.press("Space")
    visit.wait_for("body.playing === 'false'")

    def picture() -> str:
        visit.page.wait_for_timeout(200)
        return str(visit.page.evaluate("document.getElementById('backdrop').toDataURL()"))

    before = picture()
    visit.page.keyboard.press("ArrowRight")
    turned = picture()
    assert turned != before
    visit.page.keyboard.press("+")
    assert picture() != turned
