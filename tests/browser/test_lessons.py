"""Lessons of the gallery: what is measured on the page is what is expected, within what the solver holds."""

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

import hybridmpm_service

from .conftest import LiveService, Open, Visit
from .panels.test_accessibility import violations

pytestmark = pytest.mark.browser

ENTRIES = Path(hybridmpm_service.__file__).parent / "page" / "gallery" / "entries.json"
LESSONS = json.loads(ENTRIES.read_text(encoding="utf-8"))["lessons"]
CASES = {
    "communicating-vessels": (1920, 120, 0.04),
    "torricelli": (204, 4, 0.1),
    "archimedes": (1600, 40, 0.03),
    "dam-break": (100, 10, 0.05),
    "hourglass": (560, 40, 0.05),
    "angle-of-repose": (2200, 200, 0.05),
    "waves-in-a-tank": (600, 20, 0.02),
    "u-tube": (800, 20, 0.04),
}
"""Frames, frames between two readings, and accepted relative difference."""


def _numbers(visit: Visit, name: str) -> list[float]:
    text = visit.page.locator(f"#lesson-{name}").text_content() or ""
    return [float(found) for found in re.findall(r"[\d.]+", text)]


def _open(open_page: Open, service: LiveService, name: str, width: int, theme: str) -> Visit:
    """Open a lesson that does not play by itself."""
    visit = open_page(
        f"renderer=canvas2d&theme={theme}&gallery={name}",
        viewport={"width": width, "height": 844},
        prepare=lambda page: page.emulate_media(reduced_motion="reduce"),
        until="body.state === 'live' && body.frame === '0'",
    )
    expect(visit.page.locator("#lesson")).to_be_visible()
    expect(visit.page.locator("#lesson-title")).to_have_text(LESSONS[name]["title"])
    visit.eventually(lambda: service.get(f"/v1/sessions/{visit.session}")["speed"] == LESSONS[name]["speed"])
    return visit


def test_each_lesson_has_its_case() -> None:
    assert set(CASES) == set(LESSONS)


@pytest.mark.parametrize(
    "name",
    [name if name == "waves-in-a-tank" else pytest.param(name, marks=pytest.mark.long) for name in CASES],
)
def test_what_is_measured_is_what_is_expected(open_page: Open, service: LiveService, name: str) -> None:
    frames, every, most = CASES[name]
    place = list(CASES).index(name)
    visit = _open(open_page, service, name, (1100, 390)[place % 2], ("dark", "light")[place % 2])
    # Only what is drawn is measured: readings do not depend on how fast this machine draws.
    for frame in [frames - every] if name == "torricelli" else range(every, frames, every):
        service.advance(visit.session, frame - visit.frame)
        visit.wait_for(f"body.frame === '{frame}'")
    service.advance(visit.session, frames - visit.frame)
    visit.wait_for(f"body.frame === '{frames}'")
    [expected] = _numbers(visit, "exact")
    measured = _numbers(visit, "measured")
    assert measured
    for value in measured:
        assert value == pytest.approx(expected, rel=most)
    visit.page.get_by_text("Answer", exact=True).click()
    expect(visit.page.locator("#lesson-answer")).to_be_visible()
    assert visit.page.evaluate("document.documentElement.scrollWidth") == visit.page.viewport_size["width"]


def test_a_lesson_ends_where_another_scene_begins(open_page: Open, service: LiveService) -> None:
    visit = _open(open_page, service, "u-tube", 1100, "dark")
    first = visit.session
    visit.page.locator("#scenario").select_option("sand_2d")
    visit.wait_for(f"body.state === 'live' && body.session !== '{first}'")
    expect(visit.page.locator("#lesson")).to_be_hidden()


@pytest.mark.long
@pytest.mark.parametrize(("width", "theme"), [(390, "light"), (1100, "dark")])
def test_axe_finds_nothing_in_lessons_and_gallery(
    open_page: Open, service: LiveService, width: int, theme: str
) -> None:
    visit = _open(open_page, service, "torricelli", width, theme)
    assert violations(visit) == []
    visit.page.get_by_role("button", name="Gallery").click()
    expect(visit.page.locator("#gallery-lessons button")).to_have_count(len(LESSONS))
    assert violations(visit) == []
