"""The gallery: every scene is sound, has its picture, and plays when it is chosen."""

import re
from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import expect
from tests.browser.conftest import LiveService, Open

import hybridmpm_service
from hybridmpm import MpmSolver, Scene, check

pytestmark = pytest.mark.browser

FOLDER = Path(hybridmpm_service.__file__).parent / "page" / "gallery"
NAMES = sorted(file.stem for file in FOLDER.glob("*.json"))


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_runs_and_has_a_picture(name: str) -> None:
    scene = Scene.load(FOLDER / f"{name}.json")
    assert not [one for one in check(scene).findings if one.severity != "note"]
    solver = MpmSolver(scene) if scene.dim == 2 else MpmSolver(scene, coarse="1/16")
    solver.advance(8)
    assert 1000 < solver.particle_count < (15_000 if scene.dim == 2 else 50_000)
    with Image.open(FOLDER / f"{name}.png") as picture:
        assert picture.width >= 150


@pytest.mark.parametrize("width", [1100, 390])
def test_what_is_chosen_plays(open_page: Open, service: LiveService, width: int) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=3", viewport={"width": width, "height": 844})
    visit.wait_for("body.state === 'live' && Number(body.frame) > 0")
    first = visit.session
    visit.page.get_by_role("button", name="Gallery").click()
    items = visit.page.locator("#gallery-list button")
    expect(items).to_have_count(len(NAMES))
    demos = visit.page.locator("#gallery-demos button")
    expect(demos).to_have_count(8)
    listed = (FOLDER / "panel.js").read_text(encoding="utf-8")
    assert sorted(re.findall(r'^  "?([a-z-]+)"?: "', listed, re.MULTILINE)) == NAMES
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
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=3")
    visit.wait_for("body.state === 'live' && Number(body.frame) > 0")
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
