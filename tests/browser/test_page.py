"""The page in a real browser, on the real service: it moves, and its controls do what they say."""

import gzip
import io
import json
import math
import re
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, WebSocketRoute, expect

import hybridmpm_service
from hybridmpm.playing import drawing_of_bodies
from hybridmpm_service.http.bundle import bundled, imported

from .conftest import LIVE, PATIENCE_MS, LiveService, Open

pytestmark = pytest.mark.browser


@pytest.mark.parametrize("renderer", ["webgl2", "canvas2d"])
def test_water_moves_after_loading(open_page: Open, renderer: str) -> None:
    visit = open_page(f"renderer={renderer}", until=LIVE)
    assert visit.value("renderer") == renderer
    before, picture = visit.frame, visit.page.locator("#view").screenshot()
    visit.wait_for(f"Number(body.frame) > {before + 10}")
    assert visit.page.locator("#view").screenshot() != picture
    assert visit.page.locator("#scenario").input_value() == "water_2d"
    assert re.fullmatch(r"[\d,]+", visit.page.locator("#count").text_content() or "")


def test_empty_page_says_that_it_connects(open_page: Open) -> None:
    visit = open_page()
    assert visit.page.locator("#skeleton-text").text_content() == "Connecting to the simulation"
    visit.wait_for(LIVE)
    assert "gone" in (visit.page.locator("#skeleton").get_attribute("class") or "")


def test_pause_step_and_reset(open_page: Open, service: LiveService) -> None:
    visit = open_page(until=LIVE)
    visit.page.get_by_role("button", name="Pause").click()
    visit.wait_for("body.playing === 'false'")
    paused = service.get(f"/v1/sessions/{visit.session}")
    assert paused["playing"] is False
    visit.wait_for(f"body.frame === '{paused['frame']}'")

    visit.page.get_by_role("button", name="One frame").click()
    visit.wait_for(f"body.frame === '{paused['frame'] + 1}'")
    assert service.get(f"/v1/sessions/{visit.session}")["frame"] == paused["frame"] + 1

    visit.page.get_by_role("button", name="Reset").click()
    visit.wait_for("body.frame === '0'")
    assert service.get(f"/v1/sessions/{visit.session}")["frame"] == 0


def test_keyboard_plays_pauses_steps_and_resets(open_page: Open) -> None:
    visit = open_page(until=LIVE)
    visit.press_until("Space", "body.playing === 'false'")
    visit.press_until("r", "body.frame === '0'")
    visit.press_until(".", "body.frame === '1'")
    visit.press_until("Space", "body.playing === 'true' && Number(body.frame) > 1")
    visit.page.keyboard.press("?")
    assert visit.page.get_by_role("dialog").is_visible()
    visit.page.get_by_role("dialog").get_by_role("button", name="Close").click()
    assert visit.page.get_by_role("dialog").is_hidden()


def test_speed_slider_reaches_the_session(open_page: Open, service: LiveService) -> None:
    visit = open_page(until=LIVE)
    visit.page.locator("#speed").fill("-1")
    assert visit.page.locator("#speed-out").text_content() == "0.10\N{MULTIPLICATION SIGN} real time"
    visit.eventually(lambda: math.isclose(service.get(f"/v1/sessions/{visit.session}")["speed"], 0.1))


def test_the_page_says_that_it_is_slower_than_asked(open_page: Open) -> None:
    scale = [1.0]

    def slow(socket: WebSocketRoute) -> None:
        server = socket.connect_to_server()

        def pass_on(message: str | bytes) -> None:
            told = json.loads(message) if isinstance(message, str) else {}
            is_status = told.get("type") == "status"
            socket.send(json.dumps(told | {"time_scale": scale[0]}) if is_status else message)

        server.on_message(pass_on)

    visit = open_page(prepare=lambda page: page.route_web_socket("**/stream*", slow), until=LIVE)
    note = visit.page.locator("#slow-note")
    expect(note).to_be_hidden()
    scale[0] = 0.1
    expect(note).to_contain_text(
        "Slower than asked: 0.10\N{MULTIPLICATION SIGN} of 0.25\N{MULTIPLICATION SIGN}."
    )
    expect(visit.page.locator("#measured")).to_contain_text("0.10")


def test_another_scenario_replaces_the_session(open_page: Open, service: LiveService) -> None:
    visit = open_page(until=LIVE)
    first = visit.session
    visit.page.locator("#seed").fill("7")
    with visit.page.expect_request(lambda one: one.method == "DELETE") as left:
        visit.page.locator("#scenario").select_option("water_sand_2d")
    visit.wait_for(f"body.session !== '{first}' && {LIVE}")
    now = service.get(f"/v1/sessions/{visit.session}")
    assert (now["scenario"], now["seed"]) == ("water_sand_2d", 7)
    assert "scenario=water_sand_2d&seed=7" in visit.page.url
    # For a minute the browser's Back finds it.
    assert left.value.url == f"{service.url}/v1/sessions/{first}?after=60"


def test_space_begins_with_a_sea(open_page: Open, service: LiveService) -> None:
    visit = open_page(until=LIVE)
    visit.page.locator("#scenario").select_option("Sea, 3D")
    visit.wait_for("body.state === 'live' && body.dim === '3' && Number(body.frame) > 0")
    now = service.get(f"/v1/sessions/{visit.session}")
    assert (now["coarse"], now["particles"] > 30_000) == ("1/16", True)
    assert "gallery=dam-in-space" in visit.page.url


def _deletions(service: LiveService) -> float:
    """Return how many deletions of sessions the service has counted."""
    lines = httpx.get(f"{service.url}/metrics").text.splitlines()
    deleted = 'hybridmpm_requests_total{method="DELETE",route="/v1/sessions/{session_id}",'
    return sum(float(line.rpartition(" ")[2]) for line in lines if line.startswith(deleted))


def test_leaving_the_page_lets_the_session_end(open_page: Open, service: LiveService) -> None:
    visit = open_page(until=LIVE)
    session = visit.session
    # Browsers report no request of a page that is left, but the server counts it.
    before = _deletions(service)
    visit.page.goto("about:blank")
    visit.eventually(lambda: _deletions(service) > before)
    visit.eventually(lambda: not service.get(f"/v1/sessions/{session}")["playing"])


@pytest.mark.parametrize("renderer", ["webgl2", "canvas2d"])
def test_3d_scene_is_drawn_and_turns_under_the_mouse(open_page: Open, renderer: str) -> None:
    visit = open_page(f"scenario=water_3d&seed=1&renderer={renderer}", until=LIVE)
    visit.press_until("Space", "body.playing === 'false'")
    assert visit.value("tool") == "orbit"
    before = visit.page.locator("#view").screenshot()
    visit.drag([(0.4, 0.5), (0.7, 0.6)])
    visit.eventually(lambda: visit.page.locator("#view").screenshot() != before)
    assert visit.value("control") == "idle"


@pytest.mark.parametrize("renderer", ["webgl2", pytest.param("canvas2d", marks=pytest.mark.long)])
def test_particles_that_come_and_go_are_drawn(open_page: Open, service: LiveService, renderer: str) -> None:
    scene = {
        "dim": 2,
        "resolution": 64,
        "bodies": [{"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.9, 0.2]}],
        "emitters": [
            {
                "shape": "rectangle",
                "material": "sand",
                "lower": [0.1, 0.5],
                "upper": [0.1, 0.7],
                "velocity": [2, 0],
            }
        ],
        "sinks": [{"shape": "box", "lower": [0.8, 0.05], "upper": [0.95, 0.3]}],
    }
    session = service.post("/v1/sessions", {"scene": scene})
    visit = open_page(f"renderer={renderer}&session={session['id']}")
    visit.wait_for("body.state === 'live' && body.frame === '0'")
    visit.press_until("Space", "body.playing === 'true'")
    visit.pause_at(40)
    count = service.get(session["links"]["self"])["particles"]
    assert count != session["particles"]
    expect(visit.page.locator("#count")).to_have_text(f"{count:,}")
    picture = Image.open(io.BytesIO(visit.page.locator("#view").screenshot())).convert("RGB")
    red, _, blue = np.moveaxis(np.asarray(picture, dtype=int), -1, 0)
    assert np.count_nonzero(blue > red + 100) > 500
    assert np.count_nonzero(red > blue + 50) > 500


ON_DEMAND = (
    "build/",
    "gallery/",
    "lesson/",
    "plan/",
    "share/",
    "turn/",
    "panels/key-panel.js",
    "net/lead",
    "net/host.js",
    "stage/rigid.js",
    "stage/renderer/bodies-",
    "modules/bodies.js",
    "element.js",
)
"""Folders and files of parts that are loaded on demand, or by other pages."""
IN_WORKERS = {"net/lead-frames.js", "net/lead-worker.js"}
"""Parts of these that a worker loads, for which a document is missing."""


def test_every_module_is_loaded_at_once_or_on_demand_and_the_page_stays_small() -> None:
    folder = Path(hybridmpm_service.__file__).parent / "page"
    modules = {path.relative_to(folder).as_posix(): path.read_text("utf-8") for path in folder.rglob("*.js")}
    modules["modules/bodies.js"] = drawing_of_bodies()
    start = set(imported(modules, ["main.js"]))
    assert start == {name for name in modules if not name.startswith(ON_DEMAND)}
    changed = bundled(modules, "main.js")
    assert set(changed) == {"main.js"} | (set(modules) - start - IN_WORKERS)
    others = ("index.html", "style.css", "icon.svg")
    sent = [changed["main.js"].encode(), *((folder / name).read_bytes() for name in others)]
    # 3 kB smooth liquids in space without a graphics card, show the depth of strokes; 3 kB are the client;
    # 1 kB is the card of lessons; 1 kB traces shapes, and follows sketches in turn; 1.5 kB draw polygons,
    # meshes and liquids; 1.5 kB are hands that pull at rigid bodies, and places for these.
    assert sum(len(gzip.compress(one)) for one in sent) < 92_500


@pytest.mark.parametrize("dim", [pytest.param(2, marks=pytest.mark.long), 3])
def test_a_moving_obstacle_is_seen_moving(open_page: Open, service: LiveService, dim: int) -> None:
    start, speed = (0.3, 0.7, 0.5)[:dim], 1.0
    scene = {
        "dim": dim,
        "resolution": 32,
        "bodies": [{"shape": "ball", "material": "sand", "center": [0.5, 0.2, 0.5][:dim], "radius": 0.05}],
        "obstacles": [
            {
                "shape": "ball",
                "center": list(start),
                "radius": 0.08,
                "motion": {"velocity": [speed, 0.0, 0.0][:dim]},
            }
        ],
    }
    made = httpx.post(service.url + "/v1/sessions", json={"scene": scene}, timeout=60).raise_for_status()
    session = made.json()["id"]
    visit = open_page(f"renderer=canvas2d&session={session}")
    visit.wait_for("body.state === 'live' && body.frame === '0'")
    view = visit.page.locator("#view")
    before = _edges_at_rest(view)
    service.advance(session, 120)
    visit.wait_for("body.frame === '120'")
    after = _edges_at_rest(view, unlike=before)
    left, right = _middle(before & ~after), _middle(after & ~before)
    width = before.shape[1]
    # 0.3 m to the right, on a stage that shows 0.87 m in 2D, and about twice as much in 3D.
    share = (right - left) / width
    assert share == pytest.approx(0.3 / 0.87, rel=0.1) if dim == 2 else 0.1 < share < 0.3


def _edges_at_rest(view: Locator, unlike: np.ndarray | None = None) -> np.ndarray:
    """Edges of a picture that is drawn to the end: two in a row are equal, and other than `unlike`."""
    latest = _edges(view.screenshot())
    for _ in range(PATIENCE_MS // 200):
        view.page.wait_for_timeout(200)
        shot = _edges(view.screenshot())
        if (shot == latest).all() and shot.any() and (unlike is None or (shot != unlike).any()):
            return shot
        latest = shot
    pytest.fail(f"the picture did not come to rest within {PATIENCE_MS // 1000} s")


def _edges(png: bytes) -> np.ndarray:
    """Pixels in the colour of an obstacle's outline."""
    with Image.open(io.BytesIO(png)) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    return np.abs(pixels - (0x93, 0xA7, 0xC0)).max(axis=-1) < 40


def _middle(mask: np.ndarray) -> float:
    assert mask.sum() > 20
    return float(np.nonzero(mask)[1].mean())
