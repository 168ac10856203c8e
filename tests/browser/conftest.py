"""The real service in a process of its own, and a real Chromium to look at its page."""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Self

import httpx
import pytest
from playwright.sync_api import Browser, ConsoleMessage, Error, Page, ViewportSize, expect, sync_playwright

CHROMIUM_FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",  # WebGL2 without a graphics card
    "--disable-background-networking",
]
VIEWPORT: ViewportSize = {"width": 1100, "height": 740}
"""The page in its wide layout, stage and tools in sight; without a graphics card every pixel takes time."""
LIVE = "body.state === 'live' && Number(body.frame) > 0"
WIDTHS = [1100, pytest.param(390, marks=pytest.mark.long)]
"""Widths of panels that have one layout; those that a phone arranges otherwise are tested at both."""
PATIENCE_MS = 60_000
"""Longest wait of a test for something that has to happen; a loaded machine may draw one picture a second."""
expect.set_options(timeout=PATIENCE_MS)


def find_chromium() -> str | None:
    """Return the path of the system's Chromium, or None."""
    candidates = [os.environ.get("HYBRIDMPM_CHROMIUM", ""), "chromium", "chromium-browser"]
    return next((path for name in candidates if name and (path := shutil.which(name))), None)


def free_port() -> int:
    """Return a TCP port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class LiveService:
    """`python -m hybridmpm_service` with settings and a port of its own; may be stopped and started again."""

    def __init__(self, **settings: str) -> None:
        self._settings = {f"HYBRIDMPM_{name.upper()}": value for name, value in settings.items()}
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Start and wait until a session can be created; the error is what it printed."""
        address = {"HYBRIDMPM_PORT": str(self.port), "HYBRIDMPM_HOST": "127.0.0.1"}
        # How busy this machine is decides nothing in tests of the page.
        environment = os.environ | {"HYBRIDMPM_MAX_LOAD": "64"} | self._settings | address
        with tempfile.TemporaryFile() as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "hybridmpm_service"],
                env=environment,
                stdout=log,
                stderr=subprocess.STDOUT,
            )
            deadline = time.monotonic() + 60
            while time.monotonic() < deadline and self._process.poll() is None:
                if self._is_ready():
                    return
                time.sleep(0.1)
            self.stop()
            log.seek(0)
            raise RuntimeError(f"the service did not start: {log.read().decode(errors='replace')}")

    def stop(self) -> None:
        """End the process; sessions in it are gone."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Let the process stand still, as one that hangs."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._process.send_signal(signal.SIGCONT)

    def get(self, path: str) -> Any:
        """Return the JSON of a path."""
        return httpx.get(self.url + path, timeout=60).raise_for_status().json()

    def post(self, path: str, body: Any) -> Any:
        """Post JSON to a path and return the answer's."""
        return httpx.post(self.url + path, json=body, timeout=120).raise_for_status().json()

    def end(self, session: str) -> None:
        """Delete a session."""
        httpx.delete(f"{self.url}/v1/sessions/{session}").raise_for_status()

    def advance(self, session: str, frames: int) -> Any:
        """Advance a session and return its description."""
        return self.post(f"/v1/sessions/{session}/advance", {"frames": frames})

    def _is_ready(self) -> bool:
        try:
            return httpx.get(self.url + "/readyz", timeout=2).status_code == httpx.codes.OK
        except httpx.TransportError:
            return False


@dataclass
class Visit:
    """One open page: what the browser shows, and what went wrong in it."""

    page: Page
    errors: list[str] = field(default_factory=list)

    def note_error(self, error: Error) -> None:
        """Keep an exception that the page did not catch."""
        self.errors.append(str(error))

    def note_line(self, line: ConsoleMessage) -> None:
        """Keep an error that the console shows."""
        if line.type == "error":
            self.errors.append(line.text)

    def leave(self, *, close: bool) -> None:
        """Close the tab, or leave it empty, with no button down and nothing of a test in it."""
        if close:
            self.page.close()
            return
        self.page.mouse.up()
        self.page.unroute_all()
        if self.page.url.startswith("http"):
            self.page.evaluate("localStorage.clear(); sessionStorage.clear()")
        self.page.goto("about:blank")
        self.page.remove_listener("pageerror", self.note_error)
        self.page.remove_listener("console", self.note_line)

    def value(self, name: str) -> str | None:
        """Return the data attribute `name` of the body."""
        return self.page.locator("body").get_attribute(f"data-{name}")

    def wait_for(self, condition: str) -> None:
        """Wait until a JavaScript expression over `body` (the data attributes) holds."""
        self.page.wait_for_function(f"() => {{ const body = document.body.dataset; return {condition}; }}")

    def pause_at(self, frame: int) -> None:
        """Let the simulation run past a frame, then pause it."""
        self.wait_for(f"body.state === 'live' && Number(body.frame) >= {frame}")
        self.press_until("Space", "body.playing === 'false'")

    @property
    def frame(self) -> int:
        """Frame of the simulation that is shown."""
        return int(self.value("frame") or -1)

    @property
    def session(self) -> str:
        """Identifier of the session that is shown."""
        return self.value("session") or ""

    def press_until(self, key: str, condition: str) -> None:
        """Press a key and wait for what it does."""
        self.page.keyboard.press(key)
        self.wait_for(condition)

    def eventually(self, condition: Callable[[], bool]) -> None:
        """Wait, with the page going on, until a condition outside of the page holds."""
        for _ in range(PATIENCE_MS // 100):
            if condition():
                return
            self.page.wait_for_timeout(100)
        raise AssertionError(f"not true within {PATIENCE_MS // 1000} seconds")

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        """Return where a world point of the flat (or front) view lies on the screen."""
        box = self.page.locator("#overlay").bounding_box()
        scale = box["width"] / (0.8 + 2 * 0.035)  # walls at 0.1 and 0.9, and the margin of camera.js
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        return middle[0] + (x - 0.5) * scale, middle[1] - (y - 0.5) * scale

    def drag(self, points: list[tuple[float, float]], *, release: bool = True) -> None:
        """Draw through world points with the mouse."""
        self.page.mouse.move(*self.pixel(*points[0]))
        self.page.mouse.down()
        for point in points[1:]:
            self.page.mouse.move(*self.pixel(*point), steps=2)
        if release:
            self.page.mouse.up()


def collect(page: Page, event: str, into: list[Any]) -> None:
    """Collect the JSON messages of a page's streams: those of the event "framesent" or "framereceived"."""

    def note(message: str | bytes) -> None:
        if isinstance(message, str):
            into.append(json.loads(message))

    page.on("websocket", lambda socket: socket.on(event, note))


Open = Callable[..., Visit]


@pytest.fixture(scope="package")
def service() -> Iterator[LiveService]:
    with LiveService() as live:
        yield live


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    # It ends with the package: Playwright's own event loop would disturb asyncio in other tests.
    chromium = find_chromium()
    if chromium is None:
        missing = "no Chromium found: install Debian's package `chromium` or set HYBRIDMPM_CHROMIUM"
        if os.environ.get("CI") == "true":
            pytest.fail(missing)
        pytest.skip(missing)
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        yield running
        running.close()


@pytest.fixture(scope="package")
def tab(browser: Browser) -> Iterator[Page]:
    """Return a tab that tests may use one after the other: a new one takes the browser half a second."""
    page = browser.new_page()
    yield page
    page.close()


@pytest.fixture
def open_page(browser: Browser, service: LiveService, tab: Page) -> Iterator[Open]:
    """Open the page of the service, and find at the end that no page complained in its console.

    A test's first page is loaded into the shared tab, which is empty before and after. What a test wants to
    `prepare` stays with a tab, so such a page gets one of its own. The function returns once `until` holds,
    an expression as of `Visit.wait_for`, and the page rests at `paused_at`, however slow the machine is.
    """
    visits: list[Visit] = []

    def open_one(
        query: str = "renderer=canvas2d",
        viewport: ViewportSize | None = None,
        prepare: Callable[[Page], None] | None = None,
        until: str = "",
        paused_at: int | None = None,
    ) -> Visit:
        page = tab if prepare is None and not visits else browser.new_page()
        page.set_viewport_size(viewport or VIEWPORT)
        if prepare is not None:
            prepare(page)
        page.set_default_timeout(PATIENCE_MS)
        visit = Visit(page)
        page.on("pageerror", visit.note_error)
        page.on("console", visit.note_line)
        if paused_at is not None:
            # With reduced motion nothing plays by itself.
            page.emulate_media(reduced_motion="reduce")
        # A test whose tab is to simulate says so: whether it keeps the pace depends on the machine.
        home = "" if "simulate=" in query else "simulate=server&"
        page.goto(f"{service.url}/?{home}{query}")
        visits.append(visit)
        if until:
            visit.wait_for(until)
        if paused_at is not None:
            visit.wait_for("body.state === 'live'")
            page.emulate_media(reduced_motion="null")
            if paused_at > 0:
                service.advance(visit.session, paused_at)
            visit.wait_for(f"body.frame === '{paused_at}'")
        return visit

    yield open_one
    for visit in visits:
        visit.leave(close=visit.page is not tab)
    assert [visit.errors for visit in visits] == [[] for _ in visits]
