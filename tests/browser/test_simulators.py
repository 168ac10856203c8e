"""The simulator on the page: the choice, the badge, and the chart of the safeguard."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from .conftest import LIVE, LiveService, Open, Visit

pytestmark = pytest.mark.browser

FALL = "renderer=canvas2d&theme=dark&scenario=water_2d&seed=3"
"""Water falls freely, as the network has it, from frame 20 to frame 84."""
_COUNT = """(canvas) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const near = (i, color) => color.every((value, k) => Math.abs(data[i + k] - value) < 40);
  const found = { value: 0, threshold: 0, mpm: 0 };
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] > 200 && near(i, [0x58, 0xb9, 0xff])) found.value += 1;
    if (data[i + 3] > 200 && near(i, [0xff, 0x8a, 0x80])) found.threshold += 1;
    if (data[i + 3] > 30 && data[i + 3] < 70 && near(i, [255, 209, 102])) found.mpm += 1;
  }
  return found;
}"""


@pytest.fixture(scope="module")
def service(model_folder: Path) -> Iterator[LiveService]:
    with LiveService(models=str(model_folder)) as live:
        yield live


def _rewound(open_page: Open, query: str, **options: Any) -> Visit:
    """Open a page, paused at frame 0."""
    visit = open_page(f"{FALL}&{query}", **options, until=LIVE)
    visit.press_until("Space", "body.playing === 'false'")
    visit.press_until("r", "body.frame === '0'")
    return visit


def _choose(visit: Visit, name: str) -> None:
    visit.page.get_by_role("radio", name=name).check(force=True)


def _pixels(page: Page) -> dict[str, int]:
    counted: dict[str, int] = page.locator("#strips").evaluate(_COUNT)
    return counted


def test_choosing_a_simulator_starts_a_session_of_it(open_page: Open, service: LiveService) -> None:
    visit = open_page(FALL, until=LIVE)
    expect(visit.page.locator("#mode")).to_be_hidden()
    expect(visit.page.locator("#safeguard-numbers")).to_be_hidden()
    first = visit.session
    _choose(visit, "Hybrid")
    visit.wait_for(f"body.session !== '{first}' && {LIVE} && body.solver === 'hybrid'")
    made = service.get(f"/v1/sessions/{visit.session}")
    assert (made["solver"], made["model"], made["seed"]) == ("hybrid", "falling", 3)
    assert "solver=hybrid" in visit.page.url
    expect(visit.page.locator("#safeguard-numbers")).to_be_visible()
    expect(visit.page.locator("#solver-text")).to_contain_text("25 % of the particles")
    # A network computes no pressure.
    expect(visit.page.locator('#quantity [value="pressure"]')).to_be_disabled()

    second = visit.session
    visit.page.get_by_role("radio", name="Hybrid").focus()
    visit.page.keyboard.press("ArrowRight")
    visit.wait_for(f"body.session !== '{second}' && {LIVE} && body.mode === 'neural'")
    assert service.get(f"/v1/sessions/{visit.session}")["solver"] == "neural"
    expect(visit.page.locator("#mode")).to_have_text("Network simulates")
    expect(visit.page.locator("#safeguard-numbers")).to_be_hidden()


@pytest.mark.parametrize("viewport", [{"width": 1440, "height": 900}, {"width": 390, "height": 844}])
def test_badge_and_chart_follow_the_session(
    open_page: Open, service: LiveService, viewport: dict[str, int]
) -> None:
    visit = _rewound(open_page, "solver=hybrid", viewport=viewport)
    badge = visit.page.get_by_role("status").filter(has_text="simulates")
    expect(badge).to_have_text("MPM simulates")
    service.advance(visit.session, 60)
    visit.wait_for("body.frame === '60' && body.mode === 'neural'")
    expect(badge).to_have_text("Network simulates")
    assert service.get(f"/v1/sessions/{visit.session}")["mode"] == "neural"
    before = _pixels(visit.page)
    # There is a threshold only where somebody sets r_c.
    assert before["threshold"] == 0
    # No threshold of the cosine is set, so none is named.
    expect(visit.page.locator("#threshold-row")).to_be_hidden()
    expect(visit.page.locator("#threshold-legend")).to_be_hidden()

    service.advance(visit.session, 140)
    session = service.get(f"/v1/sessions/{visit.session}")
    visit.wait_for(f"body.frame === '200' && body.mode === '{session['mode']}'")
    # It fell on the floor in between, where free fall is refused.
    decisions = service.get(f"/v1/sessions/{visit.session}/decisions")["decisions"]
    assert {"audit", "drift"} & {decision["reason"] for decision in decisions}
    who = {"mpm": "MPM", "neural": "Network"}[decisions[-1]["mode"]]
    expect(visit.page.locator("#decision-frame")).to_have_text(f"{who}, since frame {decisions[-1]['frame']}")
    expect(visit.page.locator("#decision-reason")).not_to_be_empty()
    now = session["safeguard"]
    shown = visit.page.locator("#safeguard-value").text_content() or ""
    assert float(shown.replace("\N{MINUS SIGN}", "-")) == pytest.approx(now["value"], abs=0.006)
    after = _pixels(visit.page)
    assert after["value"] > before["value"] + 40
    assert after["mpm"] > 2 * before["mpm"] > 0
    # Nothing sticks out to the side, and the chart is as wide as its card.
    assert visit.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    chart, card = (visit.page.locator(name).bounding_box() for name in ("#strips", "#history"))
    assert chart["width"] > 0.8 * card["width"]


@pytest.mark.parametrize("viewport", [{"width": 1440, "height": 900}, {"width": 390, "height": 844}])
def test_a_level_is_chosen_on_the_page(
    open_page: Open, service: LiveService, viewport: dict[str, int]
) -> None:
    visit = open_page(f"{FALL}&coarse=1/16", viewport=viewport, until=LIVE)
    first = visit.session
    made = service.get(f"/v1/sessions/{first}")
    assert (made["solver"], made["coarse"], made["r_p"]) == ("mpm", "1/16", 1 / 16)
    expect(visit.page.locator("#solver-text")).to_contain_text("1/16 of the particles; all are shown")
    choice = visit.page.get_by_label("Particles simulated")
    expect(choice).to_have_value("1/16")
    choice.select_option("All")
    visit.wait_for(f"body.session !== '{first}' && {LIVE}")
    every = service.get(f"/v1/sessions/{visit.session}")
    assert (every["coarse"], every["particles"]) == (None, made["particles"])
    assert "coarse" not in visit.page.url
    assert visit.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def test_a_scenario_without_a_network_is_simulated_by_mpm(open_page: Open, service: LiveService) -> None:
    visit = open_page(f"{FALL}&solver=hybrid", until=f"{LIVE} && body.solver === 'hybrid'")
    first = visit.session
    visit.page.locator("#scenario").select_option("sand_2d")
    visit.wait_for(f"body.session !== '{first}' && {LIVE}")
    assert service.get(f"/v1/sessions/{visit.session}")["solver"] == "mpm"
    for name in ("Hybrid", "Network"):
        expect(visit.page.get_by_role("radio", name=name)).to_be_disabled()
    expect(visit.page.locator("#solver-text")).to_have_text(
        "The material point method (MPM) simulates all particles. There is no network for this scenario."
    )
    expect(visit.page.locator("#mode")).to_be_hidden()


def test_a_failing_network_is_reported_with_a_remedy(open_page: Open, service: LiveService) -> None:
    answer = service.post("/v1/sessions", {"scenario": "water_2d", "solver": "neural", "model": "broken"})
    visit = open_page(f"renderer=canvas2d&session={answer['id']}")
    visit.wait_for("body.state === 'live' && body.solver === 'neural'")
    visit.page.keyboard.press("Space")
    toast = visit.page.locator(".toast")
    expect(toast).to_contain_text("non-finite in frame 21")
    expect(toast).to_contain_text("Return to the start (r)")
    visit.wait_for("body.playing === 'false' && body.frame === '20'")
    visit.press_until("r", "body.frame === '0'")


def test_chart_has_its_frames_from_left_to_right(browser: Any, service: LiveService) -> None:
    page = browser.new_page()
    page.goto(service.url + "/icon.svg")
    history = {"frames": [200, 600, 1000, 1200], "values": [0.9, 1.0, 0.5, 0.0]}
    tracks = {"points": [[900, 1.5], [1200, 3.1]], "values": [1.5, 3.1]}
    view = {
        "phases": [[150, "mpm"], [600, "neural"], [1000, "mpm"]],
        "frame": 1200,
        "width": 342,
        "height": 400,
    }
    plan = page.evaluate(
        """async ([history, track, view]) => {
            const { latencyStrip, layout, safeguardStrip, volumeStrip } = await import('/panels/strips.js');
            return layout([safeguardStrip(history, 0.8), latencyStrip(track), volumeStrip(track)], view);
        }""",
        [history, tracks, view],
    )
    page.close()
    area, latency, volume = plan["areas"]
    width, height = area["right"] - area["left"], area["bottom"] - area["top"]
    assert (plan["first"], plan["last"]) == (200, 1200)
    assert area["bottom"] < latency["top"] < latency["bottom"] < volume["top"] < volume["bottom"] < 400
    line, of_latency, of_volume = plan["lines"]
    xs = [(x - area["left"]) / width for x, _ in line]
    ys = [(area["bottom"] - y) / height for _, y in line]
    assert xs == pytest.approx([0, 0.4, 0.8, 1])
    assert ys == pytest.approx(history["values"])
    # Up to 5 ms, and up to five times the first volume.
    assert [(latency["bottom"] - y) / height for _, y in of_latency] == pytest.approx([0.3, 0.62])
    assert [(volume["bottom"] - y) / height for _, y in of_volume] == pytest.approx([0.2, 3.1 / 1.5 / 5])
    bands = [((band["x"] - area["left"]) / width, band["width"] / width) for band in plan["bands"]]
    assert bands == [pytest.approx((0, 0.4)), pytest.approx((0.8, 0.2))]
    inside = [tick for tick in plan["ticks"] if tick["y"] <= area["bottom"]]
    marks = {tick["text"]: (area["bottom"] - tick["y"]) / height for tick in inside}
    assert marks == pytest.approx({"1": 1, "0": 0, "0.80": 0.8})
