"""The preset of the page that shows the whole way: network, splash, sketch, and the hybrid again."""

import pytest
from playwright.sync_api import expect

from .conftest import LiveService, Open

pytestmark = pytest.mark.browser


def test_the_address_of_the_preset_shows_it_on_load(open_page: Open, service: LiveService) -> None:
    """Simulator, sketch, result, and the simulator after that."""
    visit = open_page("renderer=canvas2d&preset=pipeline")
    visit.wait_for("body.state === 'live'")
    # A hundredth and a tenth of real time, so that a busy machine sees each part.
    visit.page.locator("#speed").fill("-2")
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


def test_a_click_shows_it_on_a_phone_and_a_reset_shows_it_again(open_page: Open) -> None:
    visit = open_page("renderer=canvas2d&scenario=sand_2d", viewport={"width": 390, "height": 844})
    visit.wait_for("body.state === 'live' && Number(body.frame) > 0")
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
    visit = open_page("renderer=canvas2d&preset=pipeline")
    visit.wait_for("body.state === 'live' && Number(body.frame) >= 20")
    visit.press_until("a", "body.tool === 'arrow'")
    visit.drag([(0.3, 0.3), (0.6, 0.5)], release=False)
    visit.wait_for("Number(body.frame) > 170")
    assert visit.value("control") == "drawing"
    visit.page.mouse.up()
    visit.wait_for("body.control === 'following'")
    expect(visit.page.locator("#steer-text")).to_have_text("Following the arrow")
