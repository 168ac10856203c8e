"""What a first and a second visit of the page cost on a slow line: times, requests and bytes in Chromium."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from playwright.sync_api import Browser, BrowserContext, sync_playwright

from hybridmpm_lab.harness.browser import launched
from hybridmpm_lab.service.server import Server, running

LINES: dict[str, dict[str, float] | None] = {
    "without a limit": None,
    "at 1.6 Mbit/s, 150 ms": {"latency": 150, "downloadThroughput": 200e3, "uploadThroughput": 94e3},
}
"""Lines: latency of a request [ms] and throughputs [bytes/s], as Chromium emulates them."""
AIM = 2.5
"""Longest time until the first motion on the slow line [s]."""
_PATIENCE = 120_000
_MEASURES = {"first paint": "s", "first motion": "s", "requests": "-", "kB": "kB"}
_NOTE_MOTION = """new MutationObserver((_, self) => {
  if (!(Number(document.body?.dataset.frame) > 0)) return;
  self.disconnect();
  window.moved = performance.now();
}).observe(document, { subtree: true, attributes: true, childList: true });"""
_PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime"


@dataclass
class _Wire:
    """What went over the line, by events of Chromium's network log."""

    start: float | None = None  # of the first request [s]
    requests: dict[str, float] = field(default_factory=dict)
    loads: list[tuple[float, float]] = field(default_factory=list)  # times [s], bytes

    def begin(self, event: Any) -> None:
        if not event["request"]["url"].startswith("http"):
            return
        self.start = self.start or event["timestamp"]
        self.requests[event["requestId"]] = event["timestamp"] - self.start

    def answer(self, event: Any) -> None:
        if event["response"].get("fromDiskCache"):
            self.spare(event)

    def spare(self, event: Any) -> None:
        self.requests.pop(event["requestId"], None)

    def end(self, event: Any) -> None:
        self.load(event, event["encodedDataLength"])

    def frame(self, event: Any) -> None:
        text = event["response"]
        # Binary messages are logged in base 64.
        self.load(event, len(text["payloadData"]) * (0.75 if text["opcode"] == 2 else 1))

    def load(self, event: Any, size: float) -> None:
        self.loads.append((event["timestamp"] - (self.start or event["timestamp"]), size))


def visits(repeats: int) -> Iterator[tuple[str, float, str, float | None]]:
    """Yield measures of the page with values, units and aims: medians over `repeats` browsers.

    Raises
    ------
    ConfigError
        There is no Chromium.
    """
    with running() as server, sync_playwright() as playwright:
        browser = launched(playwright)
        for line, limits in LINES.items():
            found: dict[str, list[dict[str, float]]] = {"first visit": [], "second visit": []}
            for _ in range(repeats):
                _visit_twice(browser, server, limits, found)
            for visit, rows in found.items():
                for name, unit in (
                    ("first paint", "s"),
                    ("first motion", "s"),
                    ("requests", "-"),
                    ("kB", "kB"),
                ):
                    aim = AIM if name == "first motion" and limits else None
                    what = name if unit == "s" else f"{name} until the first motion"
                    yield f"{what}, {visit} {line}", float(np.median([row[name] for row in rows])), unit, aim
        browser.close()


def _visit_twice(
    browser: Browser, server: Server, limits: Any, found: dict[str, list[dict[str, float]]]
) -> None:
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    for visit in found.values():
        visit.append(_visited(context, server, limits))
    context.close()


def _visited(context: BrowserContext, server: Server, limits: Any) -> dict[str, float]:
    page, wire = context.new_page(), _Wire()
    page.add_init_script(_NOTE_MOTION)
    log = context.new_cdp_session(page)
    log.send("Network.enable")
    if limits:
        log.send("Network.emulateNetworkConditions", {"offline": False, **limits})
    log.on("Network.requestWillBeSent", wire.begin)
    log.on("Network.requestServedFromCache", wire.spare)
    log.on("Network.responseReceived", wire.answer)
    log.on("Network.loadingFinished", wire.end)
    log.on("Network.webSocketFrameReceived", wire.frame)
    page.goto(server.address, wait_until="commit")
    page.wait_for_function("() => window.moved > 0", timeout=_PATIENCE)
    moved = page.evaluate("window.moved") / 1000
    paint = page.evaluate(_PAINT) / 1000
    page.close()
    return {
        "first paint": paint,
        "first motion": moved,
        "requests": sum(time <= moved for time in wire.requests.values()),
        "kB": sum(size for time, size in wire.loads if time <= moved) / 1000,
    }
