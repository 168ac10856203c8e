"""The page for everybody: axe-core finds nothing in either scheme, and colours may be forced."""

from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import expect
from tests.browser.conftest import LiveService, Open, Visit

pytestmark = pytest.mark.browser

AXE = Path(__file__).parents[1] / "axe" / "axe.min.js"
"""axe-core 4.14.1 by Deque Systems, under the Mozilla Public License 2.0, which lies beside it."""
SCENE = "renderer=canvas2d&scenario=water_ramps_2d&seed=2&coarse=1%2F16"


def violations(visit: Visit) -> list[str]:
    """Return what axe-core finds on the page as it is."""
    # The page's own policy allows no foreign script; the browser's evaluates it all the same.
    visit.page.evaluate(AXE.read_text(encoding="utf-8"))
    found: list[dict[str, Any]] = visit.page.evaluate("async () => (await axe.run()).violations")
    return [
        f"{one['id']}: {one['help']}: {node['target']} {node['failureSummary']}"
        for one in found
        for node in one["nodes"]
    ]


@pytest.mark.parametrize(
    ("width", "scheme"),
    [
        (1100, "dark"),
        (390, "light"),
        *(pytest.param(*other, marks=pytest.mark.long) for other in [(1100, "light"), (390, "dark")]),
    ],
)
def test_axe_finds_nothing(open_page: Open, service: LiveService, width: int, scheme: str) -> None:
    visit = open_page(f"{SCENE}&theme={scheme}", viewport={"width": width, "height": 844}, paused_at=1)
    assert violations(visit) == []
    visit.page.get_by_role("button", name="Find a method").click()
    expect(visit.page.locator("#plan-answer")).to_be_visible()
    assert violations(visit) == []
    visit.page.keyboard.press("Escape")
    visit.page.get_by_role("button", name="Build").click()
    for dim in ("", " 3D"):
        visit.page.get_by_role("button", name=f"Empty{dim} box").click()
        for kind in ("emitter", "crate"):
            visit.page.locator(f"[data-kind={kind}]").click()
        assert violations(visit) == []
    visit.page.keyboard.press("Escape")
    visit.page.get_by_role("button", name="Help and keyboard shortcuts").click()
    assert violations(visit) == []
    # It would have found something.
    visit.page.evaluate("document.getElementById('help').append(document.createElement('img'))")
    assert [text.partition(":")[0] for text in violations(visit)] == ["image-alt"]


def test_the_scheme_follows_the_system_and_the_user(open_page: Open, service: LiveService) -> None:
    def ground() -> str:
        return str(visit.page.evaluate("getComputedStyle(document.body).backgroundColor"))

    visit = open_page(SCENE)
    visit.page.emulate_media(color_scheme="light")
    light = ground()
    visit.page.emulate_media(color_scheme="dark")
    dark = ground()
    assert light != dark
    visit.page.get_by_role("button", name="Light or dark").click()
    assert ground() == light
    assert "theme=light" in visit.page.url
    visit.page.reload()
    assert ground() == light
    visit.page.emulate_media(color_scheme=None)


def test_forced_colours_keep_what_is_chosen_in_sight(open_page: Open, service: LiveService) -> None:
    visit = open_page(SCENE, until="body.state === 'live'")
    visit.page.emulate_media(forced_colors="active")
    chosen = visit.page.get_by_role("radio", name="Push")
    other = visit.page.get_by_role("radio", name="Arrow")
    outlines = [one.evaluate("(e) => getComputedStyle(e).outlineStyle") for one in (chosen, other)]
    assert outlines == ["solid", "none"]
    visit.page.emulate_media(forced_colors="none")
