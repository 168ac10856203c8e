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


@pytest.mark.long
def test_a_page_of_ones_own_draws_and_pushes(
    visit: Visit, folder: Path, service: LiveService, port: int
) -> None:
    visit.page.goto(f"http://127.0.0.1:{port}/stream.html")
    visit.page.wait_for_function("() => /^frame [1-9]/.test(document.getElementById('text').textContent)")
    box = visit.page.locator("canvas").bounding_box()
    at = [(box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in ((0.4, 0.7), (0.6, 0.6))]
    visit.page.mouse.move(*at[0])
    visit.page.mouse.down()
    visit.page.mouse.move(*at[1], steps=4)
    visit.page.mouse.up()
    session = service.get("/v1/sessions")["sessions"][-1]["id"]
    visit.eventually(lambda: len(service.get(f"/v1/sessions/{session}/log")["inputs"]) > 1)
    blue = "() => document.querySelector('canvas').getContext('2d').getImageData(0, 0, 800, 800).data"
    assert visit.page.evaluate(f"({blue})().filter((byte, i) => i % 4 === 2 && byte === 255).length") > 5000
