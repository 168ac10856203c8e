"""What is taken away from the page comes back: links, code, films, particles, scenes and runs."""

import base64
import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, expect
from tests.browser.conftest import LIVE, WIDTHS, LiveService, Open, Visit

from hybridmpm import MpmSolver, Scene

pytestmark = pytest.mark.browser

SCENE = "renderer=canvas2d&scenario=water_2d&seed=3"


def _paused(open_page: Open, service: LiveService, **options: Any) -> Visit:
    """Open a page that may use the clipboard, and pause it after a push that has ended."""
    visit = open_page(SCENE, **options)
    visit.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    visit.wait_for("body.state === 'live' && Number(body.frame) > 5")
    visit.drag([(0.4, 0.3), (0.6, 0.35)])
    # A frame notes that the hand has let go; a pause before it would leave the note to the first frame after.
    visit.eventually(lambda: _has_let_go(service, visit))
    visit.pause_at(20)
    return visit


def _has_let_go(service: LiveService, visit: Visit) -> bool:
    inputs = service.get(f"/v1/sessions/{visit.session}/log")["inputs"]
    return bool(inputs) and inputs[-1]["push"] is None


_GREENS = """() => {
    const overlay = document.getElementById('overlay');
    const { data } = overlay.getContext('2d').getImageData(0, 0, overlay.width, overlay.height);
    let found = 0;
    for (let i = 0; i < data.length; i += 4) {
        const [red, green, blue, opaque] = data.subarray(i, i + 4);
        if (opaque > 80 && green > red + 60 && green > blue + 60) found += 1;
    }
    return found;
}"""
"""Counts the green pixels over the particles."""


_AMBERS = _GREENS.replace("green > red + 60 && green > blue + 60", "red > 220 && green > 180 && blue < 140")
"""Counts the amber pixels over the particles, which are those of a target."""


def _copied(visit: Visit, name: str) -> str:
    visit.page.evaluate("document.getElementById('share-text').textContent = ''")
    visit.page.get_by_role("button", name=name).click()
    expect(visit.page.locator("#share-text")).to_contain_text("clipboard")
    return str(visit.page.evaluate("navigator.clipboard.readText()"))


def _saved(visit: Visit, name: str, folder: Path) -> Path:
    with visit.page.expect_download() as download:
        visit.page.get_by_role("button", name=name, exact=True).click()
    file = folder / download.value.suggested_filename
    download.value.save_as(file)
    return file


@pytest.mark.parametrize("width", WIDTHS)
def test_a_link_computes_the_run_again(open_page: Open, service: LiveService, width: int) -> None:
    visit = _paused(open_page, service, viewport={"width": width, "height": 844})
    link = _copied(visit, "Copy link")
    log = service.get(f"/v1/sessions/{visit.session}/log")
    assert log["inputs"]
    other = open_page("", until="body.state === 'live'")
    other.page.goto(link)  # which changes the part behind the # alone
    other.wait_for(f"body.state === 'live' && Number(body.frame) === {log['frame']}")
    expect(other.page.locator("#toasts")).to_contain_text("Computed again with the same bits")
    assert other.session != visit.session
    assert service.get(f"/v1/sessions/{other.session}/log")["digest"] == log["digest"]
    damaged = link[:-40] + link[-20:]
    other.page.goto("about:blank")
    other.page.goto(damaged)
    expect(other.page.locator("#toasts")).to_contain_text("This link is damaged")
    other.wait_for("body.state === 'live'")


def test_code_runs_elsewhere(open_page: Open, service: LiveService) -> None:
    visit = _paused(open_page, service)
    log = service.get(f"/v1/sessions/{visit.session}/log")
    python = _copied(visit, "Copy as Python")
    assert f"# 1 push, up to frame {log['frame']}." in python
    there: dict[str, Any] = {"print": lambda *_: None}
    exec(python, there)  # noqa: S102 - it is what the page promises to run
    assert (there["solver"].frame, there["solver"].digest()) == (log["frame"], log["digest"])
    curl = _copied(visit, "Copy as curl")
    assert service.url in curl
    body = json.loads(curl.partition("-d '")[2].rpartition("'")[0])
    made = service.post("/v1/sessions", body)
    assert service.get(f"/v1/sessions/{made['id']}/log")["digest"] == log["digest"]
    service.end(made["id"])
    # Where nothing acted, the code is as short as one writes it.
    visit.press_until("r", "body.frame === '0'")
    visit.press_until(".", "body.frame === '1'")
    python = _copied(visit, "Copy as Python")
    assert 'scenarios.get("water_2d", 3)' in python
    exec(python, there)  # noqa: S102
    assert there["solver"].frame == 1


def test_files_are_saved_and_opened(open_page: Open, service: LiveService, tmp_path: Path) -> None:
    visit = _paused(open_page, service)
    log = service.get(f"/v1/sessions/{visit.session}/log")
    with np.load(_saved(visit, "Particles, npz", tmp_path)) as arrays:
        count, _ = arrays["positions"].shape
        assert count == MpmSolver(Scene.parse(log["scene"])).particle_count
    assert f"element vertex {count}\n".encode() in _saved(visit, "PLY", tmp_path).read_bytes()
    assert f'NumberOfPoints="{count}"' in _saved(visit, "VTK", tmp_path).read_text(encoding="ascii")
    with Image.open(_saved(visit, "Picture", tmp_path)) as picture:
        colours = picture.convert("RGB").getcolors(1 << 24)
        assert colours is not None
        assert len(colours) > 100
    scene, run = _saved(visit, "Save scene", tmp_path), _saved(visit, "Save run", tmp_path)
    assert Scene.load(scene) == Scene.parse(log["scene"])
    first = visit.session
    visit.page.locator("#share-file").set_input_files(run)
    visit.wait_for(f"body.session !== '{first}' && Number(body.frame) === {log['frame']}")
    second = visit.session
    assert service.get(f"/v1/sessions/{second}/log")["digest"] == log["digest"]
    visit.page.locator("#share-file").set_input_files(scene)
    visit.wait_for(f"body.state === 'live' && body.session !== '{second}' && Number(body.frame) > 0")
    assert service.get(f"/v1/sessions/{visit.session}")["scenario"] is None
    broken = tmp_path / "broken.json"
    broken.write_text("no scene")
    visit.page.locator("#share-file").set_input_files(broken)
    expect(visit.page.locator("#toasts")).to_contain_text("This file cannot be read")


_LOOK = """async ([data, at]) => {
    const [film, picture] = ['video', 'canvas'].map((name) => document.createElement(name));
    Object.assign(film, { muted: true, src: `data:video/mp4;base64,${data}` });
    await new Promise((resolve, reject) => Object.assign(film, { onloadeddata: resolve, onerror: reject }));
    film.currentTime = at * film.duration;
    await new Promise((resolve) => { film.onseeked = resolve; });
    [picture.width, picture.height] = [film.videoWidth, film.videoHeight];
    const context = picture.getContext('2d');
    context.drawImage(film, 0, 0);
    const { data: pixels } = context.getImageData(0, 0, picture.width, picture.height);
    let [green, blue] = [0, 0];
    for (let i = 0; i < pixels.length; i += 4) {
        const [r, g, b] = pixels.subarray(i, i + 3);
        if (g > r + 60 && g > b + 60) green += 1;
        if (b > r + 80 && b > g + 30) blue += 1;
    }
    return { seconds: film.duration, width: film.videoWidth, green, blue };
}"""
"""Plays a film, which no page of the service may load, up to a part of it, and counts pixels there."""


@pytest.mark.parametrize("renderer", ["canvas2d", pytest.param("webgl2", marks=pytest.mark.long)])
def test_the_film_shows_what_was_seen(
    open_page: Open, browser: Browser, tmp_path: Path, renderer: str
) -> None:
    visit = open_page(f"renderer={renderer}&scenario=water_2d&seed=3", until=LIVE)
    visit.press_until("o", "body.tool === 'oval'")
    visit.page.locator("#speed").fill("-1.5")
    visit.drag([(0.35, 0.4), (0.65, 0.7)])
    visit.wait_for("body.control === 'following'")
    # Some pictures with the sketch, whatever the time that they take here.
    for _ in range(3):
        visit.wait_for(f"Number(body.frame) > {visit.frame}")
    visit.press_until("Space", "body.playing === 'false'")
    width = visit.page.evaluate("document.getElementById('overlay').width")
    film = _saved(visit, "Film", tmp_path)
    expect(visit.page.locator("#share-text")).to_contain_text("is saved")
    assert film.suffix in (".mp4", ".webm")
    elsewhere = browser.new_page()
    seen = elsewhere.evaluate(_LOOK, [base64.b64encode(film.read_bytes()).decode(), 0.95])
    elsewhere.close()
    assert 0.2 < seen["seconds"] < 12
    assert seen["width"] in (width, width + 1)
    assert seen["green"] > 100  # the oval, which was drawn over the water
    assert seen["blue"] > 500


def test_a_fork_goes_on_by_itself(open_page: Open, service: LiveService) -> None:
    visit = _paused(open_page, service)
    visit.page.get_by_role("button", name="Fork", exact=True).click()
    link = visit.page.get_by_role("link", name="Open the fork")
    fork = (link.get_attribute("href") or "").partition("session=")[2]
    assert fork != visit.session
    assert service.get(f"/v1/sessions/{fork}")["frame"] == visit.frame
    with visit.page.context.expect_page() as opened:
        link.click()
    other = Visit(opened.value)
    other.wait_for(f"body.state === 'live' && body.session === '{fork}'")
    opened.value.close()
    httpx.delete(f"{service.url}/v1/sessions/{fork}").raise_for_status()


@pytest.mark.parametrize("width", WIDTHS)
def test_a_viewer_sees_all_and_changes_nothing(open_page: Open, service: LiveService, width: int) -> None:
    player = _paused(open_page, service)
    link = _copied(player, "Viewer link")
    assert link == f"{service.url}/?watch={player.session}"
    viewer = open_page(f"renderer=canvas2d&watch={player.session}", viewport={"width": width, "height": 844})
    viewer.wait_for(f"body.state === 'live' && Number(body.frame) === {player.frame}")
    expect(viewer.page.get_by_text("You are watching")).to_be_visible()
    for name in ("Play", "Reset", "New simulation", "Build", "Fork"):
        expect(viewer.page.get_by_role("button", name=name, exact=True)).to_be_hidden()
    inputs = service.get(f"/v1/sessions/{player.session}/log")["inputs"]
    viewer.page.keyboard.press("Space")
    viewer.drag([(0.4, 0.3), (0.6, 0.35)])
    player.page.get_by_role("button", name="Play", exact=True).click()
    viewer.wait_for(f"Number(body.frame) > {player.frame}")
    assert service.get(f"/v1/sessions/{player.session}/log")["inputs"] == inputs
    # What steers is drawn for the viewer as well, and for the player after a reload.
    player.press_until("o", "body.tool === 'oval'")
    player.page.locator("#speed").fill("-2")
    # So is the hand that pushes.
    player.press_until("p", "body.tool === 'push'")
    player.drag([(0.4, 0.3), (0.6, 0.35)], release=False)
    viewer.wait_for("body.hand === 'true'")
    player.page.mouse.up()
    viewer.wait_for("body.hand === 'false'")
    player.press_until("o", "body.tool === 'oval'")
    player.page.locator("#hold").fill("100")
    player.drag([(0.35, 0.4), (0.65, 0.7)])
    player.wait_for("body.control === 'following'")
    player.press_until("Space", "body.playing === 'false'")
    viewer.wait_for("body.seen === 'ellipse'")
    viewer.eventually(lambda: viewer.page.evaluate(_GREENS) > 100)
    viewer.eventually(lambda: viewer.page.evaluate(_AMBERS) > 30)
    player.page.reload()
    player.wait_for("body.state === 'live' && body.seen === 'ellipse'")
    # When the session ends, the viewer is told, and may start anew.
    service.end(player.session)
    viewer.wait_for("body.state === 'lost'")
    banner = viewer.page.locator("#banner")
    expect(banner).to_contain_text("This simulation has ended.")
    banner.get_by_role("button").click()
    viewer.wait_for(LIVE)
    expect(viewer.page.get_by_role("button", name="New simulation")).to_be_visible()
