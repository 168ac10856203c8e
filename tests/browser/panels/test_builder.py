"""A scene made by hand: its things are placed by mouse, finger and keyboard, checked, and simulated."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from playwright.sync_api import Locator, expect
from tests.browser.conftest import LiveService, Open, Visit

from hybridmpm import MeshObstacle, Scene

pytestmark = pytest.mark.browser

Point = tuple[float, float]


def _builder(open_page: Open, width: int = 1100) -> Visit:
    """Open the page and the dialog, with an empty box in it."""
    size = {"width": width, "height": 844}
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=3", viewport=size, paused_at=1)
    visit.page.get_by_role("button", name="Build").click()
    # It begins with the scene that is shown.
    expect(_things(visit)).to_have_count(2)
    visit.page.get_by_role("button", name="Empty box").click()
    expect(_things(visit)).to_have_count(0)
    return visit


def _things(visit: Visit) -> Locator:
    return visit.page.locator("#build-picture .thing")


def _press(visit: Visit, kind: str) -> None:
    visit.page.locator(f"#build-kinds [data-kind={kind}]").click()


def _pixel(visit: Visit, point: Point, *, top: bool = False) -> Point:
    """Return where a point lies on the screen: the walls are at 0.1 and 0.9, in a margin of 4 %.

    From above (`top`) it is (x, z), and z points down.
    """
    picture = visit.page.locator("#build-top" if top else "#build-picture")
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    scale = box["width"] * 0.92 / 0.8
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    up = (point[1] - 0.5) * scale
    return middle[0] + (point[0] - 0.5) * scale, middle[1] + (up if top else -up)


def _drag(visit: Visit, start: Point, end: Point, *, finger: bool, top: bool = False) -> None:
    (x, y), (to_x, to_y) = _pixel(visit, start, top=top), _pixel(visit, end, top=top)
    if not finger:
        visit.page.mouse.move(x, y)
        visit.page.mouse.down()
        visit.page.mouse.move(to_x, to_y, steps=4)
        visit.page.mouse.up()
        return
    hand = visit.page.context.new_cdp_session(visit.page)
    hand.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
    for kind, place in (
        ("Start", (x, y)),
        ("Move", ((x + to_x) / 2, (y + to_y) / 2)),
        ("Move", (to_x, to_y)),
    ):
        touch = {"type": f"touch{kind}", "touchPoints": [{"x": place[0], "y": place[1]}]}
        hand.send("Input.dispatchTouchEvent", touch)
    hand.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    hand.send("Emulation.setTouchEmulationEnabled", {"enabled": False})
    hand.detach()


def _drag_thing(visit: Visit, index: int, to: Point) -> None:
    """Drag a thing by its middle to another place."""
    box = _things(visit).nth(index).bounding_box()
    visit.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    visit.page.mouse.down()
    visit.page.mouse.move(*_pixel(visit, to), steps=4)
    visit.page.mouse.up()


def _simulated(visit: Visit, service: LiveService) -> dict[str, Any]:
    """Simulate the draft, and return the scene that the service got."""
    before = visit.session
    visit.page.locator("#build-start").click()
    visit.wait_for(f"body.state === 'live' && body.session !== '{before}' && Number(body.frame) > 0")
    expect(visit.page.locator("#builder")).to_be_hidden()
    scene: dict[str, Any] = service.get(f"/v1/sessions/{visit.session}/log")["scene"]
    return scene


@pytest.mark.parametrize(("width", "hand"), [(1100, "mouse"), (390, "finger")])
def test_a_scene_is_drawn_and_simulated(open_page: Open, service: LiveService, width: int, hand: str) -> None:
    finger = hand == "finger"
    visit = _builder(open_page, width)
    _press(visit, "water")
    # What a button adds lies in the middle: it is moved, then taken at a corner.
    _drag(visit, (0.5, 0.5), (0.3, 0.3), finger=finger)
    _drag(visit, (0.38, 0.38), (0.44, 0.42), finger=finger)
    # The kind stays chosen: a drag on free ground draws one more.
    _drag(visit, (0.6, 0.6), (0.7, 0.75), finger=finger)
    visit.page.locator("#build-numbers").get_by_label("Material").select_option("mud")
    expect(visit.page.locator("#build-name")).to_have_text("Mud")
    _press(visit, "ramp")
    _press(visit, "emitter")
    visit.page.get_by_label("Flows").select_option("left")
    expect(_things(visit)).to_have_count(4)
    visit.page.locator("#build-delete").click()
    _press(visit, "sink")
    scene = _simulated(visit, service)
    first, second = scene["bodies"]
    assert (first["material"]["kind"], first["shape"]) == ("water", "box")
    assert first["lower"] + first["upper"] == pytest.approx([0.22, 0.22, 0.44, 0.42], abs=0.012)
    assert (second["material"]["kind"], second["material"]["yield_stress"]) == ("liquid", 146)
    assert second["lower"] + second["upper"] == pytest.approx([0.6, 0.6, 0.7, 0.75], abs=0.012)
    assert [len(scene[part]) for part in ("obstacles", "emitters", "sinks")] == [1, 0, 1]
    assert visit.page.evaluate("document.documentElement.scrollWidth") == width


def test_all_of_it_goes_by_the_keyboard(open_page: Open, service: LiveService) -> None:
    visit = _builder(open_page)
    keys = visit.page.keyboard
    for kind in ("sand", "block"):
        visit.page.locator(f"[data-kind={kind}]").focus()
        keys.press("Enter")
    told = "Obstacle, 0.16 m by 0.16 m, at 0.272 m, 0.5 m"
    expect(visit.page.locator(":focus")).to_have_attribute("aria-label", told)
    keys.press("ArrowRight")
    keys.press("Shift+ArrowUp")
    keys.press("Shift+Tab")
    expect(visit.page.locator("#build-name")).to_have_text("Sand")
    keys.press("ArrowUp")
    keys.press("Delete")
    expect(_things(visit)).to_have_count(1)
    keys.press("Control+z")
    expect(_things(visit)).to_have_count(2)
    scene = _simulated(visit, service)
    (sand,), (block,) = scene["bodies"], scene["obstacles"]
    assert sand["lower"] + sand["upper"] == pytest.approx([0.42, 0.43, 0.58, 0.59])
    assert block["lower"] + block["upper"] == pytest.approx([0.202, 0.42, 0.362, 0.59])


def test_faults_are_named_and_nothing_is_lost(open_page: Open, service: LiveService) -> None:
    visit = _builder(open_page)
    session = visit.session
    _press(visit, "water")
    _press(visit, "elastic")
    middle = visit.page.get_by_label("Middle x")
    middle.fill("0.05")
    middle.blur()
    visit.page.locator("#build-start").click()
    status, findings = visit.page.locator("#build-status"), visit.page.locator("#build-findings")
    expect(status).to_have_text("This scene cannot run as it is.")
    expect(findings).to_contain_text("“Jelly”")
    expect(visit.page.locator("#build-picture .wrong")).to_have_count(1)
    assert visit.session == session
    # The draft is there when the dialog is opened again, and the finding leads to its thing.
    visit.page.get_by_role("button", name="Close").last.click()
    visit.page.get_by_role("button", name="Build").click()
    expect(_things(visit)).to_have_count(2)
    findings.get_by_role("button", name="Show").first.click()
    expect(visit.page.locator("#build-name")).to_have_text("Jelly")
    visit.page.get_by_role("combobox", name="Shape").select_option("ball")
    visit.page.get_by_label("Middle x").fill("0.75")
    visit.page.get_by_label("Middle x").blur()
    scene = _simulated(visit, service)
    assert [body["shape"] for body in scene["bodies"]] == ["box", "ball"]
    assert scene["bodies"][1]["center"][0] == pytest.approx(0.75)


def test_a_drawing_becomes_a_solid_or_a_body_and_a_bad_file_says_why(
    open_page: Open, service: LiveService, tmp_path: Path
) -> None:
    visit = _builder(open_page, 390)
    ring = "M0 0H40V30H0Z M10 10V20H30V10Z"
    for name, text in (
        ("ring.svg", f'<svg xmlns="http://www.w3.org/2000/svg"><path d="{ring}"/></svg>'),
        ("bad.svg", "no"),
        ("notes.txt", "no"),
        ("large.svg", " " * 17_000_000),
    ):
        (tmp_path / name).write_text(text)
    chosen, status = visit.page.locator("#build-chosen"), visit.page.locator("#build-status")
    for name, fault in [
        ("notes.txt", "choose an SVG or PNG file, or, for 3D,"),
        ("large.svg", "it has 17.0 MB, more than the service takes; make it smaller."),
        ("bad.svg", "the file cannot be read as SVG: "),
    ]:
        chosen.set_input_files(tmp_path / name)
        expect(status).to_contain_text(f"{name} is not read: {fault}")
        expect(status).to_be_in_viewport()
    visit.page.route("**/v1/shapes*", lambda route: route.fulfill(body="no"), times=1)
    chosen.set_input_files(tmp_path / "ring.svg")
    expect(status).to_contain_text("ring.svg is not read: ")
    visit.errors.clear()  # the browser itself reports the status 422
    drop = """(text) => [0, 1].forEach(() => {
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([text], "ring.svg"));
      document.getElementById("build-picture").dispatchEvent(new DragEvent("drop", { dataTransfer }));
    })"""
    visit.page.evaluate(drop, (tmp_path / "ring.svg").read_text())  # both get room of their own
    expect(_things(visit)).to_have_count(2)
    first, second = (_things(visit).nth(k).bounding_box()["x"] for k in (0, 1))
    assert abs(first - second) > 20
    visit.page.locator("#build-delete").click()
    expect(_things(visit)).to_have_count(1)
    _things(visit).first.focus()
    # A line of its own for each outline, none between them.
    outlines = _things(visit).locator("path")
    expect(outlines).to_have_attribute("d", re.compile(r"^M([^M]*L){4}[^M]*M([^M]*L){4}[^ML]*$"))
    visit.page.get_by_label("Height").fill("0.3")
    visit.page.get_by_label("Height").press("Tab")
    _press(visit, "water")
    chosen.set_input_files(tmp_path / "ring.svg")
    visit.page.get_by_label("Acts as").select_option("material")
    visit.page.locator("#build-numbers").get_by_label("Material").select_option("elastic")
    scene = _simulated(visit, service)
    (solid,), (_, body) = scene["obstacles"], scene["bodies"]
    heights = [y for _, y in solid["vertices"]]
    assert max(heights) - min(heights) == pytest.approx(0.3, abs=0.002)
    assert (body["shape"], body["material"]["kind"], len(body["vertices"])) == ("polygon", "elastic", 10)


def test_rigid_bodies_are_placed_turned_and_taken_back(open_page: Open, service: LiveService) -> None:
    visit = _builder(open_page)
    _press(visit, "water")
    _drag(visit, (0.5, 0.5), (0.5, 0.2), finger=False)
    _press(visit, "crate")
    things = _things(visit)
    expect(things.nth(1)).to_have_attribute("aria-label", "Rigid box, 0.16 m by 0.16 m, at 0.5 m, 0.5 m")
    # The handle above it turns it.
    _drag(visit, (0.5, 0.63), (0.37, 0.5), finger=False)
    fields = visit.page.locator("#build-fields")
    expect(fields.get_by_label("Turned")).to_have_value("90")
    for label, number in (("Turned", "30"), ("Width", "0.2"), ("Density", "300")):
        fields.get_by_label(label).fill(number)
        fields.get_by_label(label).blur()
    _press(visit, "ball")
    _drag_thing(visit, 2, (0.75, 0.6))
    _press(visit, "wedge")
    _drag_thing(visit, 3, (0.25, 0.7))
    expect(things).to_have_count(4)
    # Of the polygon the corner at the right is drawn out, which its hull follows.
    _drag(visit, (0.33, 0.7), (0.4, 0.72), finger=False)
    _press(visit, "crate")
    expect(things).to_have_count(5)
    visit.page.keyboard.press("Delete")
    expect(things).to_have_count(4)
    visit.page.locator("#build-undo").click()
    expect(things).to_have_count(5)
    visit.page.locator("#build-undo").click()
    expect(things).to_have_count(4)
    expect(visit.page.locator("#build-status")).to_contain_text("Runs")
    crate, ball, wedge = _simulated(visit, service)["rigid"]
    assert (crate["density"], ball["shape"], wedge["shape"]) == (300, "ball", "hull")
    assert crate["rotation"] == pytest.approx(0.5236, abs=1e-3)
    assert [crate["upper"][0] - crate["lower"][0], crate["upper"][1] - crate["lower"][1]] == pytest.approx(
        [0.2, 0.16]
    )
    assert ball["center"] == pytest.approx([0.75, 0.6], abs=5e-3)
    assert wedge["points"][0] == pytest.approx([0.4, 0.72], abs=5e-3)
    visit.wait_for("body.renderer === 'canvas2d'")
    assert not visit.errors


def _set(visit: Visit, **numbers: float) -> None:
    """Fill number fields; an underscore stands for a space."""
    for label, value in numbers.items():
        field = visit.page.locator("#build-numbers").get_by_label(label.replace("_", " "))
        field.fill(str(value))
        field.press("Tab")


@pytest.mark.parametrize(
    ("width", "hand"), [pytest.param(1100, "mouse", marks=pytest.mark.long), (390, "finger")]
)
def test_a_scene_in_space_is_built_simulated_and_saved(
    open_page: Open, service: LiveService, tmp_path: Path, width: int, hand: str
) -> None:
    finger = hand == "finger"
    visit = _builder(open_page, width)
    page = visit.page
    page.get_by_role("button", name="Empty 3D box").click()
    # From the front it is moved, from above it is drawn out and moved.
    _press(visit, "water")
    _drag(visit, (0.5, 0.5), (0.3, 0.3), finger=finger)
    _drag(visit, (0.38, 0.58), (0.5, 0.7), finger=finger, top=True)
    _drag(visit, (0.3, 0.5), (0.3, 0.4), finger=finger, top=True)
    _press(visit, "crate")
    expect(page.locator("#build-top .selected")).to_have_attribute(
        "aria-label", "Rigid box, 0.16 m by 0.16 m by 0.16 m, at 0.5 m, 0.5 m, 0.5 m"
    )
    _set(visit, Middle_x=0.6, Middle_y=0.6, Density=300, Spin_y=2)
    # The blue handle turns it about the sight: here about z, then about y.
    _drag(visit, (0.6, 0.73), (0.47, 0.6), finger=finger)
    expect(page.locator("#build-numbers").get_by_label("Turned z")).to_have_value("90")
    _press(visit, "rod")
    page.locator("#build-numbers").get_by_label("Axis").select_option("z")
    _set(visit, Length=0.3, Radius=0.05, Middle_x=0.3, Middle_y=0.6, Middle_z=0.5)
    _drag(visit, (0.3, 0.35), (0.3, 0.25), finger=finger, top=True)
    _press(visit, "gem")
    page.locator("#build-delete").click()
    expect(_things(visit)).to_have_count(3)
    # A surface of a file, as a rigid body.
    trimesh.creation.icosphere(subdivisions=1).export(tmp_path / "stone.stl")
    page.locator("#build-chosen").set_input_files(tmp_path / "stone.stl")
    expect(_things(visit)).to_have_count(4)
    page.get_by_label("Acts as").select_option("rigid")
    _set(visit, Middle_x=0.75, Middle_y=0.25, Middle_z=0.7, Density=2500)
    keys = page.keyboard
    page.locator("#build-picture .selected").focus()
    for key in ("ArrowRight", "PageDown", "PageUp", "Control+z"):
        keys.press(key)
    expect(page.locator("#build-status")).to_contain_text("Runs")
    # What is seen aslant shows the body.
    brown = page.evaluate(
        """() => {
          const { width, height } = document.getElementById("build-preview");
          const context = document.getElementById("build-preview").getContext("2d");
          const pixels = new Uint32Array(context.getImageData(0, 0, width, height).data.buffer);
          const channels = (rgb) => [0, 8, 16].map((shift) => (rgb >> shift) & 255);
          const isBrown = ([red, green, blue]) => red > 1.3 * green && green > 1.3 * blue;
          return pixels.filter((rgb) => isBrown(channels(rgb))).length / pixels.length;
        }"""
    )
    assert brown > 0.005
    with page.expect_download() as saved:
        page.locator("#build-save").click()
    saved.value.save_as(tmp_path / "mine.yaml")
    scene = _simulated(visit, service)
    read = Scene.load(tmp_path / "mine.yaml")
    # The service lowers the limit of particles.
    limited = read.model_copy(update={"max_particles": scene["max_particles"]})
    assert limited == Scene.from_json(json.dumps(scene))
    (water,), (crate, rod, stone) = scene["bodies"], scene["rigid"]
    assert water["lower"] + water["upper"] == pytest.approx([0.22, 0.22, 0.32, 0.5, 0.38, 0.6], abs=0.012)
    assert (crate["density"], crate["angular_velocity"]) == (300, [0, 2, 0])
    assert crate["rotation"] == pytest.approx([0, 0, np.pi / 2], abs=0.03)
    assert rod["start"] + rod["end"] == pytest.approx([0.3, 0.6, 0.25, 0.3, 0.6, 0.65], abs=0.012)
    assert (rod["radius"], stone["shape"]) == (0.05, "hull")
    corners = np.array(stone["points"])
    assert (corners.min(axis=0) + corners.max(axis=0)) / 2 == pytest.approx([0.76, 0.25, 0.71], abs=1e-3)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert not visit.errors


@pytest.mark.long
def test_a_scene_of_a_file_is_changed_and_keeps_the_rest(open_page: Open, service: LiveService) -> None:
    # Its triangles are a text.
    surface = trimesh.creation.icosphere(3, 0.1)
    solid = MeshObstacle(vertices=np.asarray(surface.vertices) + 0.5, triangles=np.asarray(surface.faces))
    stone = solid.model_dump(mode="json", exclude_none=True)
    scene = {
        "dim": 3,
        "world": {"size": [2, 1, 1]},
        "resolution": 16,
        "walls": {"lower": [0.1] * 3, "upper": [1.9, 0.9, 0.9]},
        "bodies": [],
        "obstacles": [{"shape": "half_space", "point": [0.5, 0.2, 0.5], "normal": [0.3, 1, 0]}, stone],
        "emitters": [
            {
                "shape": "round",
                "center": [1.5, 0.7, 0.5],
                "radius": 0.1,
                "velocity": [0, -1, 0],
                "start": 0.01,
            }
        ],
    }
    scene["emitters"][0]["material"] = "water"
    session = service.post("/v1/sessions", {"scene": scene})["id"]
    visit = open_page(f"renderer=canvas2d&simulate=server&session={session}", until="body.state === 'live'")
    visit.page.get_by_role("button", name="Build").click()
    expect(_things(visit)).to_have_count(3)
    visit.page.locator("#build-picture .water").focus()
    visit.page.keyboard.press("ArrowRight")
    visit.page.keyboard.press("PageDown")
    visit.page.locator('#build-picture [data-index="1"]').focus()
    visit.page.keyboard.press("ArrowUp")
    built = _simulated(visit, service)
    assert built["emitters"][0]["center"] == pytest.approx([1.51, 0.7, 0.51])
    assert built["emitters"][0]["start"] == pytest.approx(0.01)
    assert built["obstacles"][1]["triangles"] == stone["triangles"]
    moved = np.array(built["obstacles"][1]["vertices"]) - stone["vertices"]
    np.testing.assert_allclose(moved, [[0, 0.01, 0]] * len(moved), atol=1e-9)
    assert (built["obstacles"][0]["normal"], built["world"]) == ([0.3, 1, 0], scene["world"])
    service.end(session)
