"""Shapes that are traced on the page, and sketches that are collected and followed in turn."""

import io
import itertools
from typing import Any

import pytest
from PIL import Image, ImageDraw
from playwright.sync_api import expect

from .conftest import LiveService, Open, Visit

pytestmark = pytest.mark.browser

HOOK = [(0.4, 0.35), (0.7, 0.35), (0.7, 0.47), (0.54, 0.47), (0.54, 0.68), (0.4, 0.68), (0.4, 0.37)]
"""An L, nearly closed."""


def _fine(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return points of a line, some between each two."""
    return [
        (a[0] + step / 6 * (b[0] - a[0]), a[1] + step / 6 * (b[1] - a[1]))
        for a, b in itertools.pairwise(points)
        for step in range(7)
    ]


def _followed(visit: Visit) -> dict[str, Any]:
    with visit.page.expect_response(lambda answer: "/sketches" in answer.url) as answer:
        visit.page.get_by_role("button", name="Follow the sketches in turn").click()
    assert answer.value.status == 200, answer.value.text()
    plan: dict[str, Any] = answer.value.json()
    return plan


def test_a_traced_outline_is_filled(open_page: Open, service: LiveService) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    visit.press_until("s", "body.tool === 'shape'")
    with visit.page.expect_response(lambda answer: "/sketches" in answer.url) as answer:
        visit.drag(_fine(HOOK))
    plan = answer.value.json()
    assert plan["sketch"]["kind"] == "shape"
    assert len(plan["goal"]["outlines"]) == 1
    visit.wait_for("body.control === 'following'")
    expect(visit.page.locator("#steer-text")).to_contain_text("shape")
    service.advance(visit.session, plan["frames"])
    visit.wait_for("body.control === 'done'")
    expect(visit.page.locator("#steer-text")).to_contain_text("% inside")
    # A free stroke that goes round and is no oval is read as a shape, too, and can be made an oval.
    visit.press_until("f", "body.tool === 'free'")
    visit.drag(_fine(HOOK))
    visit.wait_for("body.control === 'staged'")
    expect(visit.page.locator("#steer-text")).to_have_text("Read as a shape")
    visit.page.locator("#switch-kind").click()
    expect(visit.page.locator("#steer-text")).to_have_text("Read as an oval")


def test_words_and_pictures_are_shown_and_filled(open_page: Open, service: LiveService) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    page, tray = visit.page, visit.page.locator("#outlines")
    expect(tray).to_be_hidden()
    visit.press_until("s", "body.tool === 'shape'")
    words = tray.get_by_label("Words that the fluid fills")
    words.fill("HO")
    visit.wait_for("body.control === 'proposed'")
    expect(page.locator("#steer-text")).to_have_text("The fluid will fill this")
    with page.expect_response(lambda answer: "/sketches" in answer.url) as answer:
        words.press("Enter")
    plan = answer.value.json()
    # H and O with its hole, about as large as the fluid and in the middle of the room.
    assert len(plan["goal"]["outlines"]) == 3
    assert 0.99 < plan["needs"]["scale"] < 1.12
    visit.wait_for("body.control === 'following'")
    tray.locator("input[type=file]").set_input_files(
        {"name": "disc.png", "mimeType": "image/png", "buffer": _disc()}
    )
    visit.wait_for("body.control === 'proposed'")
    tray.get_by_label("Size of the shape").fill("0.5")
    with page.expect_response(lambda answer: "/sketches" in answer.url) as answer:
        tray.get_by_role("button", name="Fill the shape").click()
    assert len(answer.value.json()["goal"]["outlines"]) == 1
    assert answer.value.json()["needs"]["scale"] > 1.9
    tray.locator("input[type=file]").set_input_files(
        {"name": "notes.txt", "mimeType": "text/plain", "buffer": b"no picture"}
    )
    expect(page.locator("#toasts")).to_contain_text("must be a PNG, JPEG or WebP")
    page.locator("[data-tool=push]").click()
    expect(tray).to_be_hidden()


def _disc() -> bytes:
    image = Image.new("L", (200, 120), 255)
    ImageDraw.Draw(image).ellipse((40, 20, 160, 100), fill=0)
    data = io.BytesIO()
    image.save(data, "PNG")
    return data.getvalue()


def test_collected_sketches_are_sorted_timed_and_followed_in_turn(
    open_page: Open, service: LiveService
) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    page = visit.page
    page.get_by_label("Collect sketches, and follow them in turn").check()
    strip = page.locator("#turn")
    expect(strip).to_contain_text("they wait here for their turn")
    visit.press_until("s", "body.tool === 'shape'")
    visit.drag(_fine(HOOK))
    visit.press_until("o", "body.tool === 'oval'")
    visit.drag([(0.3, 0.4), (0.55, 0.6)])
    visit.press_until("a", "body.tool === 'arrow'")
    visit.drag([(0.5, 0.4), (0.6, 0.5)])
    items = strip.locator("li")
    expect(items).to_have_count(3)
    assert service.get(f"/v1/sessions/{visit.session}")["control"] is None
    # The arrow is dragged to the front, and goes back with its button; the shape is timed.
    items.nth(2).locator("svg").drag_to(items.nth(0))
    expect(items.nth(0).locator(".arrow")).to_have_count(1)
    page.get_by_role("button", name="Move Arrow 1 back").click()
    expect(items.nth(1).locator(".arrow")).to_have_count(1)
    page.get_by_label("Frames of Shape 1").fill("30")
    page.get_by_label("Frames of Arrow 2").fill("20")
    page.get_by_role("button", name="Remove Oval 3").click()
    plan = _followed(visit)
    assert [one["sketch"]["kind"] for one in plan["keyframes"]] == ["shape", "arrow"]
    assert [one["frames"] for one in plan["keyframes"]] == [30, 20]
    visit.wait_for("Number(body.frame) > 5")
    page.locator("#play").click()
    visit.wait_for("body.playing === 'false'")


def test_a_keyframe_is_changed_while_it_is_followed(open_page: Open, service: LiveService) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    page = visit.page
    page.get_by_label("Collect sketches, and follow them in turn").check()
    visit.press_until("a", "body.tool === 'arrow'")
    for end in (0.5, 0.6):
        visit.drag([(0.5, 0.4), (end, 0.5)])
    items = page.locator("#turn li")
    expect(items).to_have_count(2)
    for number in (1, 2):
        page.get_by_label(f"Frames of Arrow {number}").fill("200")
    first = _followed(visit)
    assert [one["start"] for one in first["keyframes"]] == [0, 200]
    expect(items.nth(0)).to_have_attribute("aria-current", "step")
    page.locator("#play").click()
    visit.wait_for("body.playing === 'false'")
    page.get_by_label("Frames of Arrow 2").fill("50")
    second = _followed(visit)
    left, after = (one["frames"] for one in second["keyframes"])
    assert left <= 200
    assert after == 50
    assert second["first_frame"] > first["first_frame"]
