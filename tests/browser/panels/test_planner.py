"""The dialog that asks which simulation is best: its answer, its chart, and a session by it."""

from typing import Any

import pytest
from playwright.sync_api import expect
from tests.browser.conftest import LiveService, Open, Visit

pytestmark = pytest.mark.browser

LIVE = "body.state === 'live' && Number(body.frame) > 0"
SCENE = "renderer=canvas2d&scenario=water_2d&seed=3"


def _planner(open_page: Open, **options: Any) -> Visit:
    """Open a page, paused, with the dialog."""
    visit = open_page(SCENE, **options)
    visit.wait_for(LIVE)
    visit.press_until("Space", "body.playing === 'false'")
    visit.page.get_by_role("button", name="Find a method").click()
    expect(visit.page.locator("#plan-answer")).to_be_visible()
    return visit


@pytest.mark.parametrize("width", [1100, 390])
def test_it_finds_a_method_within_a_time_and_uses_it(
    open_page: Open, service: LiveService, width: int
) -> None:
    visit = _planner(open_page, viewport={"width": width, "height": 740})
    dialog = visit.page.get_by_role("dialog")
    expect(dialog.locator("#plan-name")).to_contain_text("Coarse mode, 1/")
    expect(dialog.locator("#plan-figures")).to_contain_text("ms a frame")
    chosen = dialog.locator("#plan-chart circle.chosen")
    expect(chosen).to_have_count(1)
    assert dialog.locator("#plan-chart circle").count() > 15
    expect(dialog.locator("#plan-chart .demand")).to_have_count(1)
    box = dialog.bounding_box()
    assert box is not None
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= width
    before = visit.session
    dialog.get_by_role("button", name="Use this method").click()
    expect(dialog).to_be_hidden()
    visit.wait_for(f"{LIVE} && body.session !== '{before}'")
    level = visit.page.locator("#coarse").input_value()
    assert level in {"1/4", "1/8", "1/16", "1/32", "1/64"}
    assert f"coarse={level.replace('/', '%2F')}" in visit.page.url


def test_it_finds_a_method_within_an_error_and_refuses_impossible_ones(
    open_page: Open, service: LiveService
) -> None:
    visit = _planner(open_page)
    dialog = visit.page.get_by_role("dialog")
    quick = dialog.locator("#plan-name").inner_text()
    dialog.get_by_role("radio", name="error at most").check()
    dialog.get_by_label("Largest mean error").fill("0.3")
    dialog.get_by_role("button", name="Find").click()
    expect(dialog.locator("#plan-name")).not_to_have_text(quick)
    dialog.get_by_role("radio", name="time at most").check()
    dialog.get_by_label("Time of a frame in milliseconds").fill("0.001")
    dialog.get_by_role("button", name="Find").click()
    expect(dialog.locator("#plan-reason")).to_contain_text("0.001 ms")
    # By the keyboard it is left as any dialog.
    visit.page.keyboard.press("Escape")
    expect(dialog).to_be_hidden()


def test_findings_of_the_scene_are_shown(open_page: Open, service: LiveService) -> None:
    body = {"shape": "box", "lower": [0.3, 0.4], "upper": [0.5, 0.6], "material": "water"}
    shelf = {"shape": "box", "lower": [0.2, 0.3], "upper": [0.7, 0.31]}
    scene = {"dim": 2, "resolution": 64, "bodies": [body], "obstacles": [shelf]}
    made = service.post("/v1/sessions", {"scene": scene})
    assert len(made["findings"]) == 1
    visit = open_page(f"renderer=canvas2d&session={made['id']}")
    visit.wait_for("body.state === 'live'")
    found = visit.page.get_by_role("list", name="Scene problems")
    expect(found).to_contain_text("Obstacle 1 is 0.01 m thick")
    other = open_page(SCENE)
    other.wait_for(LIVE)
    expect(other.page.locator("#findings")).to_be_hidden()
