"""Dialogs of the page: which simulation is best, and the gallery of scenes."""

import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from playwright.sync_api import expect
from tests.browser.conftest import LIVE, WIDTHS, LiveService, Open, Visit

import hybridmpm_service
from hybridmpm import MpmSolver, Scene, check

pytestmark = pytest.mark.browser

SCENE = "renderer=canvas2d&scenario=water_2d&seed=3"


def _planner(open_page: Open, **options: Any) -> Visit:
    """Open a page, paused, with the dialog."""
    visit = open_page(SCENE, **options, paused_at=1)
    visit.page.get_by_role("button", name="Find a method").click()
    expect(visit.page.locator("#plan-answer")).to_be_visible()
    return visit


@pytest.mark.parametrize("width", WIDTHS)
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
    shelf = {"shape": "box", "lower": [0.2, 0.3], "upper": [0.7, 0.306]}
    within = body | {"material": "sand", "upper": [0.5, 0.65]}
    scene = {"dim": 2, "resolution": 64, "bodies": [body, within], "obstacles": [shelf]}
    made = service.post("/v1/sessions", {"scene": scene})
    assert {finding["field"] for finding in made["findings"]} == {"bodies[1]", "obstacles[0]"}
    visit = open_page(f"renderer=canvas2d&session={made['id']}", until="body.state === 'live'")
    found = visit.page.get_by_role("list", name="Scene problems")
    expect(found).to_contain_text("Obstacle 1 is 0.006 m thick")
    # Things have names on the page, not the paths of scene files.
    expect(found).to_contain_text("% of its volume in body 1, which keeps that part")
    expect(found).not_to_contain_text("[")
    # A show piece does not scold: the wheel's scene has a note about what its emitters cost.
    other = open_page("renderer=canvas2d&gallery=water-wheel", until=LIVE)
    assert service.get(f"/v1/sessions/{other.session}")["findings"][0]["severity"] == "note"
    expect(other.page.locator("#findings")).to_be_hidden()


FOLDER = Path(hybridmpm_service.__file__).parent / "page" / "gallery"
ENTRIES = json.loads((FOLDER / "entries.json").read_text(encoding="utf-8"))
NAMES = [*ENTRIES["lessons"], *ENTRIES["scenes"]]


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_runs_and_has_a_picture(name: str) -> None:
    scene = Scene.load(FOLDER / f"{name}.json")
    assert not [one for one in check(scene).findings if one.severity != "note"]
    # Rigid bodies are thinner than the cells of so coarse a level.
    solver = MpmSolver(scene, coarse="1/16" if scene.dim == 3 and not scene.rigid else None)
    solver.advance(8)
    assert 1000 < solver.particle_count + 3000 * len(scene.emitters) < (15_000 if scene.dim == 2 else 50_000)
    with Image.open(FOLDER / f"{name}.png") as picture:
        assert picture.width >= 150


@pytest.mark.parametrize("width", WIDTHS)
def test_what_is_chosen_plays(open_page: Open, service: LiveService, width: int) -> None:
    visit = open_page(SCENE, viewport={"width": width, "height": 844}, paused_at=1)
    first = visit.session
    visit.page.get_by_role("button", name="Gallery").click()
    items = visit.page.locator("#gallery-list button, #gallery-lessons button")
    expect(items).to_have_count(len(NAMES))
    demos = visit.page.locator("#gallery-demos button")
    expect(demos).to_have_count(8)
    assert visit.page.evaluate("document.documentElement.scrollWidth") == width
    visit.page.get_by_role("button", name="Hourglass").click()
    visit.wait_for(f"body.state === 'live' && body.session !== '{first}' && Number(body.frame) > 0")
    made = service.get(f"/v1/sessions/{visit.session}")
    assert made["scenario"] is None
    assert service.get(f"/v1/sessions/{visit.session}/log")["scene"]["name"] == "hourglass"
    assert "scenario=" not in visit.page.url
    # The panel says what is shown; another coarse level keeps the scene, a scenario leaves it.
    scenario = visit.page.locator("#scenario")
    expect(scenario.locator("option:checked")).to_have_text("Hourglass")
    expect(visit.page.get_by_role("radio", name="Hybrid")).to_be_disabled()
    second = visit.session
    visit.page.locator("#coarse").select_option("1/8")
    visit.wait_for(f"body.state === 'live' && body.session !== '{second}'")
    again = service.get(f"/v1/sessions/{visit.session}")
    assert (again["scenario"], again["coarse"]) == (None, "1/8")
    scenario.select_option("sand_2d")
    visit.wait_for(f"body.state === 'live' && body.session !== '{again['id']}'")
    assert service.get(f"/v1/sessions/{visit.session}")["scenario"] == "sand_2d"
    expect(visit.page.locator("#own-scene")).to_have_count(0)


def test_a_demonstration_draws_its_sketch(open_page: Open, service: LiveService) -> None:
    visit = open_page(SCENE, paused_at=1)
    visit.page.get_by_role("button", name="Gallery").click()
    expect(visit.page.locator("#gallery-demos img")).to_have_count(8)
    visit.page.wait_for_function(
        "() => [...document.querySelectorAll('#gallery-demos img')].every((one) => one.naturalWidth > 100)"
    )
    visit.page.get_by_role("button", name="Sand along an arrow", exact=True).click()
    visit.wait_for("body.control === 'following'")
    made = service.get(f"/v1/sessions/{visit.session}")
    assert (made["scenario"], made["control"]["kind"]) == ("sand_2d", "arrow")
    assert "scenario=sand_2d" in visit.page.url
