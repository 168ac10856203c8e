"""The page at a first visit and with a preset: it moves, a hand draws, the fluid follows."""

import re
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Page, Response, ViewportSize, expect

from .conftest import LIVE, LiveService, Open

pytestmark = pytest.mark.browser

SIZES: list[ViewportSize] = [{"width": 1440, "height": 900}, {"width": 390, "height": 844}]


_NOTE = """
    window.noted = {tools: [], texts: []};
    new MutationObserver(() => {
      const tool = document.body?.dataset.tool, text = document.getElementById("steer-text")?.textContent;
      if (tool && noted.tools.at(-1) !== tool) noted.tools.push(tool);
      if (text && noted.texts.at(-1) !== text) noted.texts.push(text);
    }).observe(document, {subtree: true, attributes: true, childList: true, characterData: true});
"""
"""Notes the tools and the messages of the page as they follow each other, however slow the machine is."""


@pytest.mark.parametrize("viewport", SIZES, ids=["desktop", "phone"])
def test_a_ghost_hand_draws_once_and_the_fluid_follows(open_page: Open, viewport: ViewportSize) -> None:
    answers: list[Response] = []

    def watch(page: Page) -> None:
        page.add_init_script(_NOTE)
        page.on("response", lambda one: answers.append(one) if one.url.endswith("/sketches") else None)

    visit = open_page(viewport=viewport, prepare=watch, until="body.control === 'done'")
    assert visit.page.evaluate("noted.tools") == ["push", "oval", "push"]
    assert "Draw an oval like this, and the fluid follows" in visit.page.evaluate("noted.texts")
    (answer,) = answers
    sketch = answer.json()["sketch"]
    assert sketch["kind"] == "ellipse"
    assert sketch["center"] == pytest.approx([0.5, 0.63], abs=0.01)
    expect(visit.page.locator("#steer-text")).to_contain_text("% inside")
    # Then the picture is the visitor's.
    visit.wait_for("body.control === 'idle'")
    last = visit.frame
    visit.wait_for(f"Number(body.frame) > {last + 30}")
    assert visit.value("control") == "idle"


def test_a_touch_ends_the_ghost_hand(open_page: Open) -> None:
    # From within the page: on a busy machine a key from here may come after the hand.
    touch = """new MutationObserver((_, observer) => {
      if (document.body?.dataset.state !== "live") return;
      observer.disconnect();
      document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "p", code: "KeyP", bubbles: true }));
    }).observe(document, {subtree: true, attributes: true});"""
    visit = open_page(prepare=lambda page: page.add_init_script(touch))
    visit.wait_for("Number(body.frame) > 170")
    assert (visit.value("control"), visit.value("tool")) == ("idle", "push")


def test_an_address_with_a_scene_has_no_ghost_hand(open_page: Open) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=0", until="Number(body.frame) > 170")
    assert (visit.value("control"), visit.value("tool")) == ("idle", "push")


@pytest.mark.parametrize(
    "query", ["renderer=canvas2d", pytest.param("renderer=canvas2d&scenario=sand_2d", marks=pytest.mark.long)]
)
def test_where_motion_is_reduced_nothing_starts_by_itself(open_page: Open, query: str) -> None:
    def reduce_motion(page: Page) -> None:
        page.emulate_media(reduced_motion="reduce")

    visit = open_page(query, prepare=reduce_motion, until="body.state === 'live' && body.frame === '0'")
    visit.page.wait_for_timeout(1500)
    assert (visit.frame, visit.value("playing"), visit.value("control")) == (0, "false", "idle")
    expect(visit.page.locator("#steer-text")).to_have_text("Paused. Drag through the fluid to push it")
    visit.press_until("Space", "body.playing === 'true' && Number(body.frame) > 150")
    assert visit.value("control") == "idle"


@pytest.mark.parametrize("viewport", SIZES, ids=["desktop", "phone"])
def test_motion_waits_for_no_list_and_nothing_on_demand(open_page: Open, viewport: ViewportSize) -> None:
    requested: list[str] = []

    def hold_lists(page: Page) -> None:
        # The page's files have a folder with their digest.
        page.on("request", lambda one: requested.append(re.sub("^/page-[^/]*", "", urlsplit(one.url).path)))
        for name in ("models", "scenarios"):
            page.route(f"**/v1/{name}", lambda _: None)

    open_page("", viewport=viewport, prepare=hold_lists, until="Number(body.frame) >= 5")
    assert {"/main.js", "/v1/models", "/v1/scenarios", "/v1/sessions"} <= set(requested)
    assert not [path for path in requested if path.startswith(("/build/", "/gallery/", "/plan/", "/share/"))]


def test_an_invalid_seed_is_reported(open_page: Open) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=-3", until="Number(body.frame) > 0")
    toast = visit.page.locator(".toast")
    expect(toast).to_contain_text("Invalid seed in the address")
    expect(toast).to_contain_text('not "-3"')
    assert visit.page.locator("#seed").input_value() == "0"


def test_the_address_of_the_preset_shows_it_on_load(open_page: Open, service: LiveService) -> None:
    """Simulator, sketch, result, and the simulator after that."""
    visit = open_page("renderer=canvas2d&preset=pipeline", paused_at=0)
    # A hundredth and a tenth of real time, so that a busy machine sees each part.
    visit.page.locator("#speed").fill("-2")
    visit.page.keyboard.press("Space")
    visit.wait_for("body.mode === 'neural'")
    expect(visit.page.locator("#mode")).to_have_text("Network simulates")
    assert visit.frame < 150
    visit.page.locator("#speed").fill("-1")
    visit.wait_for("body.control === 'following' && body.mode === 'mpm'")
    expect(visit.page.locator("#mode")).to_have_text("MPM simulates")
    expect(visit.page.locator("#steer-text")).to_have_text("Following the oval")
    visit.wait_for("body.control === 'done'")
    expect(visit.page.locator("#steer-text")).to_contain_text("% inside")
    last = visit.frame
    visit.wait_for(f"Number(body.frame) >= {last + 20}")
    made = service.get(f"/v1/sessions/{visit.session}")
    assert (made["scenario"], made["seed"], made["solver"]) == ("water_2d", 10, "hybrid")
    assert "preset=pipeline" in visit.page.url


def test_the_preset_in_3d_is_led_by_a_learned_plan(open_page: Open, service: LiveService) -> None:
    visit = open_page("renderer=canvas2d&preset=pipeline-3d", until="body.state === 'live'")
    visit.wait_for("body.control === 'following'")
    made = service.get(f"/v1/sessions/{visit.session}")
    assert (made["scenario"], made["seed"], made["solver"]) == ("water_3d", 10, "hybrid")
    assert made["control"]["method"] == "learned"
    assert "preset=pipeline-3d" in visit.page.url


def test_a_click_shows_it_on_a_phone_and_a_reset_shows_it_again(open_page: Open) -> None:
    visit = open_page("renderer=canvas2d&scenario=sand_2d", viewport={"width": 390, "height": 844})
    visit.wait_for(LIVE)
    first = visit.session
    visit.page.get_by_role("button", name="Watch the whole pipeline").click()
    visit.wait_for(f"body.session !== '{first}' && body.control === 'following'")
    assert visit.frame >= 150
    visit.page.locator("#play").click()
    visit.wait_for("body.playing === 'false'")
    visit.press_until("r", "body.control === 'idle' && body.frame === '0'")
    visit.page.locator("#play").click()
    visit.wait_for("body.control === 'following'")
    # Another scene has no sketch of its own.
    second = visit.session
    visit.page.get_by_label("Another seed").click()
    visit.wait_for(f"body.session !== '{second}' && Number(body.frame) > 170")
    assert visit.value("control") == "idle"
    assert "preset" not in visit.page.url


def test_a_stroke_of_ones_own_comes_before_that_of_the_preset(open_page: Open) -> None:
    visit = open_page("renderer=canvas2d&preset=pipeline", paused_at=20)
    visit.press_until("a", "body.tool === 'arrow'")
    visit.drag([(0.3, 0.3), (0.6, 0.5)], release=False)
    visit.page.keyboard.press("Space")
    visit.wait_for("Number(body.frame) > 170")
    assert visit.value("control") == "drawing"
    visit.page.mouse.up()
    visit.wait_for("body.control === 'following'")
    expect(visit.page.locator("#steer-text")).to_have_text("Following the arrow")
