"""Where things are: the fluid is in sight while it is changed, and a card is, at every size."""

import pytest
from playwright.sync_api import ViewportSize

from .conftest import Open, Visit

pytestmark = pytest.mark.browser

SIZES: list[ViewportSize] = [
    {"width": 1440, "height": 900},
    {"width": 1024, "height": 768},
    {"width": 820, "height": 1180},
    {"width": 390, "height": 844},
    {"width": 844, "height": 390},
    {"width": 932, "height": 430},
]


def _in_sight(visit: Visit, selector: str) -> float:
    """Return the share of an element that the window shows, and nothing else covers."""
    return float(
        visit.page.evaluate(
            """(selector) => {
                const element = document.querySelector(selector);
                const { left, top, width, height } = element.getBoundingClientRect();
                let seen = 0;
                for (let i = 0; i < 20; i += 1) for (let j = 0; j < 20; j += 1) {
                    const at = [left + ((i + 0.5) * width) / 20, top + ((j + 0.5) * height) / 20];
                    if (element.contains(document.elementFromPoint(...at))) seen += 1;
                }
                return seen / 400;
            }""",
            selector,
        )
    )


def test_the_fluid_stays_in_sight_while_cards_pass(open_page: Open) -> None:
    visit = open_page(paused_at=1)
    viewer = open_page(f"renderer=canvas2d&watch={visit.session}", until="body.state === 'live'")
    first = "section.card:has(#scene-title)"
    for size in SIZES:
        visit.page.set_viewport_size(size)
        visit.page.evaluate("scrollTo(0, 0)")
        assert _in_sight(visit, "#view") > 0.95, size
        assert _in_sight(visit, first) > 0.15, size
        assert _in_sight(visit, "#play") > 0.9, size
        for name in ("speed", "strength", "quantity"):
            visit.page.evaluate("(id) => document.getElementById(id).scrollIntoView({block: 'center'})", name)
            assert _in_sight(visit, f"#{name}") > 0.9, (size, name)
            assert _in_sight(visit, "#view") > 0.85, (size, name)
            assert _in_sight(visit, "#play") > 0.9, (size, name)
        assert visit.page.evaluate("document.documentElement.scrollWidth") == size["width"]
        viewer.page.set_viewport_size(size)
        assert _in_sight(viewer, "#view") > 0.95, size
        assert _in_sight(viewer, "#watching") > 0.95, size
        assert _in_sight(viewer, first) > 0.3, size
