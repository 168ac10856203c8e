"""Sketches drawn in the page: the fluid follows, and the service's own numbers agree."""

import json
import math
from typing import Any

import httpx
import pytest
from playwright.sync_api import Route, expect

from .conftest import LiveService, Open, Visit, collect

pytestmark = pytest.mark.browser


def _draw(visit: Visit, points: list[tuple[float, float]]) -> dict[str, Any]:
    """Draw a stroke and return the service's plan for it."""
    with visit.page.expect_response(lambda answer: "/sketches" in answer.url) as answer:
        visit.drag(points)
    assert answer.value.status == 200
    plan: dict[str, Any] = answer.value.json()
    return plan


def _circle(center: tuple[float, float], radius: float) -> list[tuple[float, float]]:
    angles = [2 * math.pi * i / 16 for i in range(17)]
    return [(center[0] + radius * math.cos(angle), center[1] + radius * math.sin(angle)) for angle in angles]


def _angle(a: list[float], b: list[float]) -> float:
    """Angle between two vectors in degrees."""
    cosine = sum(x * y for x, y in zip(a, b, strict=True)) / (math.hypot(*a) * math.hypot(*b))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


@pytest.mark.parametrize("arrow", [(0.14, 0.16), pytest.param((-0.12, 0.2), marks=pytest.mark.long)])
def test_fluid_follows_an_arrow(open_page: Open, service: LiveService, arrow: tuple[float, float]) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    start = service.get(f"/v1/sessions/{visit.session}")
    visit.press_until("a", "body.tool === 'arrow'")
    plan = _draw(visit, [(0.4, 0.4), (0.4 + arrow[0], 0.4 + arrow[1])])
    visit.wait_for("body.control === 'following'")
    control = service.get(f"/v1/sessions/{visit.session}")["control"]
    assert (control["kind"], control["phase"]) == ("arrow", "steering")
    assert control["first_frame"] == start["frame"]
    text = visit.page.locator("#plan-card")
    assert f"{plan['needs']['acceleration']:.1f} g of 15 g" in (text.text_content() or "")

    end = service.advance(visit.session, plan["frames"])
    displacement = [after - before for before, after in zip(start["centroid"], end["centroid"], strict=True)]
    assert _angle(displacement, list(arrow)) < 2
    assert math.dist(displacement, arrow) < 0.02
    visit.wait_for(f"body.control === 'done' && body.frame === '{end['frame']}'")
    expect(visit.page.locator("#steer-text")).to_contain_text("from the target")


def test_playing_fluid_goes_on_while_it_is_planned_for_and_is_steered_to_the_end(
    open_page: Open, service: LiveService
) -> None:
    visit = open_page("scenario=water_2d&seed=1&renderer=canvas2d")
    visit.wait_for("body.state === 'live' && Number(body.frame) > 5")
    visit.press_until("a", "body.tool === 'arrow'")
    plan = _draw(visit, [(0.4, 0.4), (0.5, 0.6)])
    assert plan["first_frame"] >= plan["drawn_frame"] > 5
    visit.wait_for("body.control === 'done'")
    assert visit.frame >= plan["first_frame"] + plan["frames"]
    assert visit.page.locator("#plan-card").is_visible()
    visit.page.get_by_role("button", name="Clear").click()
    visit.wait_for("body.control === 'idle'")
    assert service.get(f"/v1/sessions/{visit.session}")["control"]["phase"] == "done"


def test_a_sketch_that_another_client_ends_disappears(open_page: Open, service: LiveService) -> None:
    received: list[Any] = []
    query = "scenario=water_2d&seed=0&renderer=canvas2d"
    visit = open_page(query, prepare=lambda page: collect(page, "framereceived", received), paused_at=5)
    visit.press_until("a", "body.tool === 'arrow'")
    _draw(visit, [(0.5, 0.4), (0.5, 0.6)])
    visit.wait_for("body.control === 'following'")
    service.advance(visit.session, 3)
    # The page ends the sketch only after a status with it.
    visit.eventually(
        lambda: any(one["type"] == "status" and one["session"]["control"] is not None for one in received)
    )
    httpx.delete(f"{service.url}/v1/sessions/{visit.session}/sketches").raise_for_status()
    visit.wait_for("body.control === 'idle'")


def test_fluid_fills_an_oval(open_page: Open, service: LiveService) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    visit.press_until("o", "body.tool === 'oval'")
    plan = _draw(visit, [(0.42, 0.42), (0.68, 0.62)])
    assert plan["sketch"]["kind"] == "ellipse"
    assert plan["sketch"]["center"] == pytest.approx([0.55, 0.52], abs=0.01)
    assert len(plan["goal"]["region"]) > 10
    end = service.advance(visit.session, plan["frames"])
    assert math.dist(end["centroid"], plan["goal"]["path"][-1]) < 0.05
    visit.wait_for("body.control === 'done'")
    expect(visit.page.locator("#steer-text")).to_contain_text("% inside")


def test_a_goal_out_of_reach_is_said_in_words(open_page: Open) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    visit.press_until("a", "body.tool === 'arrow'")
    _draw(visit, [(0.32, 0.4), (0.88, 0.4)])
    expect(visit.page.locator(".toast")).to_contain_text("Out of reach")
    expect(visit.page.locator(".toast")).to_contain_text("shorten it")
    expect(visit.page.locator("#needs-text")).to_contain_text("shorten it")


def test_a_drag_pushes_the_fluid_as_long_as_it_is_held(open_page: Open, service: LiveService) -> None:
    sent: list[dict[str, Any]] = []

    query = "scenario=water_2d&seed=0&renderer=canvas2d"
    visit = open_page(query, prepare=lambda page: collect(page, "framesent", sent), paused_at=3)
    visit.press_until("p", "body.tool === 'push'")
    sent.clear()

    def pushes() -> list[dict[str, Any]]:
        return [one for one in sent if one["type"] == "push"]

    def has_pushed() -> bool:
        # On a busy machine the page may see no more than the end of a drag; the first lets the fluid play.
        visit.drag([(0.3 + 0.02 * step, 0.4) for step in range(11)], release=False)
        return any(push["velocity"][0] > 0 for push in pushes())

    visit.eventually(has_pushed)
    visit.eventually(lambda: pushes()[-1]["velocity"] == [0, 0] and pushes()[-1]["point"][0] > 0.495)
    visit.page.mouse.up()
    visit.eventually(lambda: sent[-1]["type"] == "push_end")
    assert {one["type"] for one in sent} == {"play", "push", "push_end"}
    assert max(abs(push["velocity"][1]) for push in pushes()) < 0.1
    assert pushes()[0]["point"] == pytest.approx([0.3, 0.4], abs=0.01)
    assert pushes()[-1]["point"] == pytest.approx([0.5, 0.4], abs=0.01)
    session = service.get(f"/v1/sessions/{visit.session}")
    assert (session["control"], visit.value("control")) == (None, "idle")


@pytest.mark.parametrize("points", [pytest.param(16, marks=pytest.mark.long), 19])
def test_an_oval_may_be_traced_with_the_oval_tool(open_page: Open, points: int) -> None:
    """Once round, and 70 degrees beyond."""
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    visit.press_until("o", "body.tool === 'oval'")
    circle = _circle((0.5, 0.5), 0.12)
    sketch = _draw(visit, circle + circle[1 : points - 15])["sketch"]
    assert sketch["kind"] == "ellipse"
    assert sketch["center"] == pytest.approx([0.5, 0.5], abs=0.01)
    assert sketch["axes"] == pytest.approx([0.12, 0.12], abs=0.01)


def test_free_stroke_shows_its_guess_and_can_be_taken_back(open_page: Open, service: LiveService) -> None:
    visit = open_page(paused_at=3)
    visit.press_until("f", "body.tool === 'free'")
    requests: list[str] = []
    visit.page.on("request", lambda sent: requests.append(sent.url))
    visit.drag(_circle((0.5, 0.5), 0.1), release=False)
    visit.wait_for("body.control === 'drawing'")
    assert "Oval" in (visit.page.locator("#steer-text").text_content() or "")
    visit.page.mouse.up()
    visit.page.locator("#undo").click()
    visit.wait_for("body.control === 'idle'")

    visit.drag(_circle((0.5, 0.5), 0.1), release=False)
    visit.page.keyboard.press("Escape")
    visit.page.mouse.up()
    visit.wait_for("body.control === 'idle'")
    assert not [url for url in requests if "/sketches" in url]
    assert service.get(f"/v1/sessions/{visit.session}")["control"] is None


def test_wrong_guess_can_be_switched(open_page: Open) -> None:
    visit = open_page(paused_at=3)
    visit.press_until("f", "body.tool === 'free'")
    almost_closed = _circle((0.5, 0.5), 0.12)[:15]
    with visit.page.expect_response(lambda answer: "/sketches" in answer.url) as answer:
        visit.drag(almost_closed)
        visit.page.get_by_role("button", name="Make it an arrow").click()
    assert answer.value.json()["sketch"]["kind"] == "arrow"


def test_an_arrow_from_beside_the_fluid_begins_in_its_middle_and_keeps_its_bends(
    open_page: Open, service: LiveService
) -> None:
    visit = open_page("scenario=water_2d&seed=0&renderer=canvas2d", paused_at=5)
    centroid = service.get(f"/v1/sessions/{visit.session}")["centroid"]
    visit.press_until("a", "body.tool === 'arrow'")
    plan = _draw(visit, [(0.15, 0.6), (0.3, 0.85), (0.5, 0.85), (0.7, 0.6)])
    path = plan["goal"]["path"]
    assert path[0] == pytest.approx(centroid, abs=1e-3)
    assert path[-1] == pytest.approx([0.7, 0.6], abs=0.01)
    chord = [path[0][axis] + 0.5 * (path[-1][axis] - path[0][axis]) for axis in range(2)]
    assert min(math.dist(point, chord) for point in path) > 0.06
    # In the fluid it says by how much, and a trembling hand means a straight line.
    plan = _draw(visit, [(0.4, 0.4), (0.45, 0.402), (0.5, 0.4)])
    assert len(plan["sketch"]["points"]) == 2
    assert plan["goal"]["path"][-1] == pytest.approx([centroid[0] + 0.1, centroid[1]], abs=0.005)


def test_click_is_not_a_sketch(open_page: Open) -> None:
    visit = open_page(paused_at=3)
    visit.press_until("a", "body.tool === 'arrow'")
    visit.drag([(0.5, 0.5), (0.503, 0.5)])
    visit.wait_for("body.control === 'idle'")
    assert "too short" in (visit.page.locator(".toast").text_content() or "")
    # Advice goes when one goes on.
    visit.drag([(0.5, 0.5), (0.6, 0.6)], release=False)
    expect(visit.page.locator(".toast")).to_have_count(0)


def test_stroke_widths_mean_depth_in_3d(open_page: Open, service: LiveService) -> None:
    # With reduced motion the camera does not glide to the front, where a pixel is a world position.
    query = "scenario=water_3d&seed=1&renderer=canvas2d"
    visit = open_page(query, prepare=lambda page: page.emulate_media(reduced_motion="reduce"))
    visit.wait_for("body.state === 'live'")
    service.advance(visit.session, 3)
    visit.wait_for("body.frame === '3'")
    visit.page.locator("#depth-start").fill("6")
    visit.page.locator("#depth-end").fill("14")
    visit.press_until("a", "body.tool === 'arrow'")
    plan = _draw(visit, [(0.32, 0.19), (0.42, 0.29)])
    # From 2 px at the back wall to 20 px at the front, over walls 0.8 m apart.
    path = plan["goal"]["path"]
    wanted = [end - start for start, end in zip(path[0], path[-1], strict=True)]
    assert wanted == pytest.approx([0.1, 0.1, 0.8 * (14 - 6) / 18], abs=0.005)
    # On the picture: a handle, keys and the wheel, which moves the end alone while one draws.
    visit.page.locator("#depth").fill("12")
    expect(visit.page.locator("#depth-text")).to_have_text("middle")
    visit.page.locator("#overlay").focus()
    visit.page.keyboard.press("PageUp")
    assert visit.page.locator("#depth-start").input_value() == "11"
    visit.drag([(0.32, 0.19), (0.4, 0.3)], release=False)
    for _ in range(6):
        visit.page.mouse.wheel(0, 100)
    expect(visit.page.locator("#depth-text")).to_have_text("middle to front")
    with visit.page.expect_response(lambda answer: "/sketches" in answer.url) as answer:
        visit.page.mouse.up()
    path = answer.value.json()["goal"]["path"]
    assert path[-1][2] - path[0][2] == pytest.approx(0.8 * 6 / 18, abs=0.005)


def test_refused_sketch_says_what_to_do_and_leaves_the_session_alone(open_page: Open) -> None:
    visit = open_page(paused_at=3)
    problem = {
        "title": "The sketch is refused",
        "status": 422,
        "detail": "strokes.0.points: at least 2 points",
    }

    def refuse(route: Route) -> None:
        route.fulfill(status=422, content_type="application/problem+json", body=json.dumps(problem))

    visit.page.route("**/sketches*", refuse)
    visit.press_until("a", "body.tool === 'arrow'")
    visit.drag([(0.4, 0.4), (0.5, 0.6)])
    toast = visit.page.locator(".toast").text_content() or ""
    assert "at least 2 points" in toast
    assert "Draw the stroke again" in toast
    visit.wait_for("body.control === 'idle' && body.state === 'live'")
    visit.errors.clear()  # the browser itself reports the status 422


@pytest.mark.parametrize("width", [1280, 390])
def test_a_tap_on_a_body_chooses_who_follows(open_page: Open, service: LiveService, width: int) -> None:
    viewport = {"width": width, "height": 844}
    visit = open_page("scenario=water_sand_2d&seed=1&renderer=canvas2d", viewport, paused_at=5)
    visit.press_until("a", "body.tool === 'arrow'")
    particles = service.get(f"/v1/sessions/{visit.session}/particles")
    sand = [row for row, kind in zip(particles["positions"], particles["types"], strict=True) if kind == 6]
    point = sand[len(sand) // 2]
    visit.drag([(point[0], point[1])])
    button = visit.page.get_by_role("button", name="Move all again")
    expect(button).to_be_visible()
    expect(visit.page.locator("#steer-text")).to_contain_text("only the tapped sand")
    with visit.page.expect_request(lambda request: "/sketches" in request.url) as asked:
        visit.drag([(point[0], point[1]), (point[0], point[1] + 0.2)])
    assert "particle" in json.loads(asked.value.post_data or "")["who"]
    visit.wait_for("body.control === 'following'")
    button.click()
    expect(button).to_be_hidden()
