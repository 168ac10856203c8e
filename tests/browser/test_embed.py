"""Pages of other sites that show simulations: those of docs/examples/web, opened from another origin."""

import functools
import http.server
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from .conftest import LIVE, PATIENCE_MS, LiveService, Visit, free_port

pytestmark = pytest.mark.browser

AXE = (Path(__file__).parent / "axe" / "axe.min.js").read_text(encoding="utf-8")
EXAMPLES = Path(__file__).parents[2] / "docs" / "examples" / "web"


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Print nothing."""


@pytest.fixture(scope="module")
def port() -> int:
    """Return the port of the other site, which the service admits by the name 127.0.0.1 alone."""
    return free_port()


@pytest.fixture(scope="module")
def service(port: int) -> Iterator[LiveService]:
    """Return a service that admits the other site."""
    with LiveService(cors_origins=f"http://127.0.0.1:{port}") as live:
        yield live


@pytest.fixture(scope="module")
def folder(port: int, service: LiveService, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Serve the examples with the address of the service in place of the usual one."""
    copies = tmp_path_factory.mktemp("web")
    for example in EXAMPLES.glob("*.html"):
        text = example.read_text(encoding="utf-8").replace("http://127.0.0.1:8000", service.url)
        (copies / example.name).write_text(text, encoding="utf-8")
    handler = functools.partial(_Quiet, directory=copies)
    with http.server.ThreadingHTTPServer(("127.0.0.1", port), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield copies
        server.shutdown()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Visit]:
    """Return a tab, and find at the end that its console has no error."""
    page = browser.new_page(viewport={"width": 700, "height": 900})
    page.set_default_timeout(PATIENCE_MS)
    visit = Visit(page)
    page.on("console", visit.note_line)
    page.on("pageerror", visit.note_error)
    yield visit
    page.close()
    assert visit.errors == []


def test_a_frame_of_another_site_shows_the_stage(visit: Visit, folder: Path, port: int) -> None:
    visit.page.goto(f"http://127.0.0.1:{port}/embed.html")
    hourglass, drop = visit.page.frames[1:]
    for frame in (hourglass, drop):
        frame.wait_for_function(f"() => {{ const body = document.body.dataset; return {LIVE}; }}")
        assert frame.evaluate("document.documentElement.scrollHeight <= innerHeight")
        expect(frame.locator("#scene-form")).to_be_hidden()
        assert (
            frame.evaluate(f"{AXE}; axe.run().then(({{violations}}) => violations.map(({{id}}) => id))") == []
        )
    expect(hourglass.get_by_role("button", name="Pause")).to_be_visible()
    expect(drop.get_by_role("button", name="Pause")).to_be_hidden()
    assert drop.locator("#view").bounding_box()["height"] > 500


@pytest.mark.long
def test_other_sites_may_not_show_it(visit: Visit, folder: Path, port: int) -> None:
    visit.page.goto(f"http://localhost:{port}/embed.html")
    visit.eventually(lambda: any("frame-ancestors" in text for text in visit.errors))
    assert not [frame for frame in visit.page.frames[1:] if frame.locator("#view").count()]
    visit.errors.clear()  # the browser itself reports the refusal


def test_an_element_shows_a_scene_and_is_commanded(visit: Visit, folder: Path, port: int) -> None:
    visit.page.goto(f"http://127.0.0.1:{port}/element.html")
    visit.page.wait_for_function(
        "() => Number(document.getElementById('text').textContent.split(' ')[0]) > 0.2"
    )
    look = """() => {
      const { state, status } = document.querySelector("hybridmpm-view");
      return [state, status.playing, status.particles];
    }"""
    state, playing, particles = visit.page.evaluate(look)
    assert (state, playing) == ("live", True)
    assert particles > 1000
    (frame,) = visit.page.frames[1:]
    assert frame.title() == "Drop - hybridmpm"
    visit.page.evaluate("""() => {
      window.least = Infinity;
      const note = ({ detail: { time } }) => (window.least = Math.min(window.least, time));
      document.querySelector("hybridmpm-view").addEventListener("frame", note);
    }""")
    visit.page.get_by_role("button", name="again").click()
    visit.page.wait_for_function("() => window.least < 0.2")
    visit.page.evaluate("() => document.querySelector('hybridmpm-view').pause()")
    frame.wait_for_function("() => document.body.dataset.playing === 'false'")


def test_a_page_of_another_site_pushes_and_leads_by_the_client(
    visit: Visit, folder: Path, service: LiveService, port: int
) -> None:
    visit.page.goto(f"http://127.0.0.1:{port}/push.html")
    visit.page.wait_for_function("() => Number(document.querySelector('canvas').dataset.frame) > 0")
    box = visit.page.locator("canvas").bounding_box()
    at = [(box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in ((0.4, 0.7), (0.6, 0.6))]
    visit.page.mouse.move(*at[0])
    visit.page.mouse.down()
    visit.page.mouse.move(*at[1], steps=4)
    visit.page.mouse.up()
    visit.page.get_by_role("button").click()
    visit.page.wait_for_function("() => / g .*frames/.test(document.getElementById('text').textContent)")
    path = f"/v1/sessions/{service.get('/v1/sessions')['sessions'][-1]['id']}"
    visit.eventually(
        lambda: {"push", "sketch"} <= {one["kind"] for one in service.get(f"{path}/log")["inputs"]}
    )
    blue = "() => document.querySelector('canvas').getContext('2d').getImageData(0, 0, 800, 800).data"
    assert visit.page.evaluate(f"({blue})().filter((byte, i) => i % 4 === 2 && byte === 255).length") > 5000
    script = """async (service) => {
      const { Client } = await import(`${service}/client.js`);
      const created = new Client(service).create({ scenario: "water_2d", seed: -1 });
      const { message, status, kind, fields } = await created.catch((problem) => problem);
      return { message, status, kind, fields: fields.map(({ field }) => field) };
    }"""
    problem = visit.page.evaluate(script, service.url)
    assert (problem["status"], problem["fields"]) == (422, ["body.seed"])
    assert problem["message"].startswith("The request is not valid: body.seed: ")
    visit.errors.clear()  # the browser itself reports the refusal


@pytest.mark.long
def test_a_page_of_ones_own_draws_the_stream(visit: Visit, folder: Path, port: int) -> None:
    visit.page.goto(f"http://127.0.0.1:{port}/stream.html")
    visit.page.wait_for_function("() => /^frame [1-9]/.test(document.getElementById('text').textContent)")
    blue = "() => document.querySelector('canvas').getContext('2d').getImageData(0, 0, 800, 800).data"
    assert visit.page.evaluate(f"({blue})().filter((byte, i) => i % 4 === 2 && byte === 255).length") > 5000
