"""What is shown has an address: a reload and Back lead to it again, and mistyped ones are explained."""

from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import expect

from .conftest import LIVE, LiveService, Open, Visit

pytestmark = pytest.mark.browser


def _query(visit: Visit) -> dict[str, list[str]]:
    query = parse_qs(urlsplit(visit.page.url).query)
    del query["simulate"]  # tests leave simulations to the server
    return query


def test_a_reload_and_the_way_back_go_on_with_the_same_sessions(
    open_page: Open, service: LiveService
) -> None:
    visit = open_page("renderer=canvas2d&scenario=sand_2d&seed=3&coarse=1%2F4&theme=dark", until=LIVE)
    first = visit.session
    visit.page.get_by_role("button", name="Gallery").click()
    visit.page.get_by_role("button", name="Hourglass").click()
    visit.wait_for(f"{LIVE} && body.session !== '{first}'")
    # The keys belong to the picture once the dialog is closed.
    visit.press_until("Space", "body.playing === 'false'")
    second, frame = visit.session, service.get(f"/v1/sessions/{visit.session}")["frame"]
    assert "scenario" not in _query(visit)
    assert (_query(visit)["theme"], _query(visit)["gallery"]) == (["dark"], ["hourglass"])
    expect(visit.page).to_have_title("Hourglass - hybridmpm")
    visit.page.reload()
    visit.wait_for(f"body.state === 'live' && body.session === '{second}' && Number(body.frame) === {frame}")
    assert visit.value("playing") == "false"
    visit.page.go_back()
    visit.wait_for(f"body.state === 'live' && body.session === '{first}' && body.playing === 'true'")
    assert _query(visit)["scenario"] == ["sand_2d"]
    expect(visit.page.locator("#coarse")).to_have_value("1/4")
    expect(visit.page).to_have_title("Sand, 2D, seed 3 - hybridmpm")
    visit.page.go_forward()
    visit.wait_for(f"body.state === 'live' && body.session === '{second}'")
    # Where the session is gone, the address begins it anew.
    service.end(second)
    visit.wait_for("body.state === 'lost'")
    visit.page.reload()
    visit.wait_for(f"body.state === 'live' && body.session !== '{second}' && Number(body.frame) > 0")
    expect(visit.page.locator("#scenario option:checked")).to_have_text("Hourglass")
    visit.errors.clear()  # the browser itself reports that the session is missing


def test_a_scene_of_ones_own_is_in_its_address(open_page: Open, service: LiveService) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=3", until=LIVE)
    first = visit.session
    visit.page.get_by_role("button", name="Build", exact=True).click()
    visit.page.get_by_role("button", name="Sand", exact=True).click()
    visit.page.wait_for_function("() => localStorage.getItem('hybridmpm.draft') !== null")
    # A draft outlives the page.
    visit.page.reload()
    visit.wait_for("body.state === 'live'")
    visit.page.get_by_role("button", name="Build", exact=True).click()
    expect(visit.page.locator("#build-hint")).to_contain_text("your earlier draft")
    visit.page.get_by_role("button", name="Simulate").click()
    visit.wait_for(f"{LIVE} && body.session !== '{first}' && location.hash.startsWith('#scene=')")
    made = service.get(f"/v1/sessions/{visit.session}/log")["scene"]
    assert made["bodies"][-1]["material"]["kind"] == "sand"
    assert visit.page.evaluate("localStorage.getItem('hybridmpm.draft')") is None
    link = visit.page.url
    # Another browser has nothing but the link.
    other = open_page("", until="body.state === 'live'")
    other.page.goto(link)
    other.wait_for(f"location.hash.startsWith('#scene=') && {LIVE}")
    other.eventually(lambda: service.get(f"/v1/sessions/{other.session}/log")["scene"] == made)
    assert other.session != visit.session


@pytest.mark.parametrize(
    ("query", "title", "detail"),
    [
        ("scenario=watr_2d", "The address cannot be shown", "did you mean 'water_2d'"),
        ("gallery=hourglas", "Not in the gallery", "no scene of the name"),
        *(
            pytest.param(*other, marks=pytest.mark.long)
            for other in [
                ("demo=sand", "Not in the gallery", "no demonstration of the name"),
                ("coarse=1/3&scenario=water_2d", "Unknown coarse level in the address", 'not "1/3"'),
                ("preset=pipe", "Unknown preset in the address", "pipeline-3d"),
                ("#scene=H4sIA", "This link is damaged", "scene in it is missing"),
            ]
        ),
    ],
)
def test_a_mistyped_address_falls_back_with_a_sentence(
    open_page: Open, query: str, title: str, detail: str
) -> None:
    visit = open_page(f"renderer=canvas2d&{query}".replace("&#", "#"), until=LIVE)
    toast = visit.page.locator(".toast")
    expect(toast).to_contain_text(title)
    expect(toast).to_contain_text(detail)
    expect(visit.page.locator("#scenario")).to_have_value("water_2d")
    if "watr" in query:
        visit.errors.clear()  # the browser itself reports the status of the refusal


@pytest.mark.long
def test_a_demonstration_has_an_address(open_page: Open, service: LiveService) -> None:
    visit = open_page("renderer=canvas2d&demo=sand-2-arrow", until="body.control === 'following'")
    made = service.get(f"/v1/sessions/{visit.session}")
    assert (made["scenario"], made["control"]["kind"]) == ("sand_2d", "arrow")
