"""What particles are coloured by, and the chart of the latest frames."""

import pytest
from playwright.sync_api import expect
from tests.browser.conftest import WIDTHS, LiveService, Open, Visit

pytestmark = pytest.mark.browser

_HUES = """(canvas) => {
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [canvas.width, canvas.height];
  const context = copy.getContext("2d");
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  const found = { violet: 0, sand: 0, any: 0 };
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] < 200) continue;
    found.any += 1;
    if (data[i + 2] > 1.3 * data[i] && data[i] > data[i + 1]) found.violet += 1;
    if (data[i] > 1.3 * data[i + 2] && data[i] > data[i + 1]) found.sand += 1;
  }
  return found;
}"""
"""Numbers of pixels: of the low end of the scale, of the look of sand, and of all that is drawn."""


def _hues(visit: Visit) -> dict[str, int]:
    visit.page.wait_for_timeout(300)
    found: dict[str, int] = visit.page.locator("#particles").evaluate(_HUES)
    return found


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scenario", ["sand_2d", pytest.param("sand_3d", marks=pytest.mark.long)])
def test_particles_are_coloured_by_what_is_chosen(
    open_page: Open, service: LiveService, scenario: str, width: int
) -> None:
    visit = open_page(
        f"renderer=canvas2d&scenario={scenario}&seed=3&coarse=1%2F16",
        viewport={"width": width, "height": 844},
        paused_at=0,
    )
    assert _hues(visit)["sand"] > 100
    expect(visit.page.locator("#scale")).to_be_hidden()
    visit.page.get_by_label("Colour particles by").select_option("Speed")
    expect(visit.page.locator("#scale")).to_have_text("Speed 04 m/s")
    assert "colour=speed" in visit.page.url
    # At the start all is at rest: the low end of the scale.
    still = _hues(visit)
    assert still["violet"] > 0.8 * still["any"] > 0
    assert still["sand"] == 0
    visit.page.get_by_label("Colour particles by").select_option("Density")
    expect(visit.page.locator("#scale-title")).to_have_text("Density")
    assert _hues(visit)["violet"] < 0.2 * still["violet"]
    visit.page.get_by_label("Colour particles by").select_option("Pressure")
    expect(visit.page.locator("#scale-high")).to_have_text("0.1 kPa")
    # Nothing presses on what falls.
    fallen = _hues(visit)
    assert fallen["violet"] > 0.8 * fallen["any"] > 0
    visit.page.get_by_label("Colour particles by").select_option("Density")
    visit.page.reload()
    # The session is the same, and still at its start.
    visit.wait_for("body.state === 'live'")
    expect(visit.page.locator("#scale-title")).to_have_text("Density")
    assert visit.page.evaluate("document.documentElement.scrollWidth") == width


@pytest.mark.parametrize("scenario", [pytest.param("water_2d", marks=pytest.mark.long), "water_3d"])
def test_webgl_has_the_same_scale(open_page: Open, service: LiveService, scenario: str) -> None:
    visit = open_page(f"renderer=webgl2&scenario={scenario}&seed=3&coarse=1%2F16&colour=speed", paused_at=0)
    visit.wait_for("body.renderer === 'webgl2'")
    visit.page.wait_for_timeout(300)
    shot = visit.page.locator("#view").screenshot()
    found = visit.page.evaluate(
        f"""async (bytes) => {{
            const bitmap = await createImageBitmap(new Blob([new Uint8Array(bytes)]));
            return ({_HUES})(bitmap);
        }}""",
        list(shot),
    )
    assert found["violet"] > 200
    visit.errors = [text for text in visit.errors if "GPU stall" not in text]


def test_density_and_volume_of_a_regular_body(open_page: Open, service: LiveService) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=3&coarse=1%2F16")
    found = visit.page.evaluate(
        """async () => {
            const { densityOf } = await import('/stage/quantities.js');
            const spacing = 0.01, positions = [];
            for (let i = 0; i < 20; i += 1) for (let j = 0; j < 30; j += 1) {
                positions.push(65535 * (0.3 + (i + 0.5) * spacing), 65535 * (0.2 + (j + 0.5) * spacing));
            }
            const frame = { positions: Uint16Array.from(positions), count: 600, dim: 2 };
            const { bytes, volume } = densityOf(frame, spacing);
            return { middle: bytes[10 * 30 + 15], corner: bytes[0], volume };
        }"""
    )
    # The byte 255 stands for twice the density at rest; the body has 0.2 m by 0.3 m.
    assert found["middle"] / 127.5 == pytest.approx(1, abs=0.03)
    assert found["corner"] < 0.7 * found["middle"]
    assert found["volume"] == pytest.approx(0.06, rel=0.03)
