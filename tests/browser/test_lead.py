"""Sessions that this tab simulates: from the server, back to it and here again, with the same bits."""

import json
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, Route
from tests.browser.conftest import LiveService, Open, Visit, collect

import hybridmpm_service

WORKER = "**/net/lead-worker.js"
SLOWEST = "const SLOWEST = 0.9"


class Messages:
    """What a page sends to the server and gets from it; the tab leads however slow it is."""

    def __init__(self, slowest: float = 0.0) -> None:
        self.sent: list[dict[str, Any]] = []
        self.got: list[dict[str, Any]] = []
        self._slowest = slowest

    def prepare(self, page: Page) -> None:
        """Listen to a page before it is loaded."""

        def changed(route: Route) -> None:
            answer = route.fetch()
            assert SLOWEST in answer.text()
            route.fulfill(
                response=answer, body=answer.text().replace(SLOWEST, f"const SLOWEST = {self._slowest}")
            )

        page.route(WORKER, changed)
        collect(page, "framesent", self.sent)
        collect(page, "framereceived", self.got)

    def inputs(self) -> int:
        """Return the number of pushes that were reported."""
        return sum(len(one["inputs"]) for one in self.sent if one["type"] == "led")

    def asked(self) -> set[str]:
        """Return the digests of this tab when it ended its lead."""
        return {one["digest"] for one in self.sent if one["type"] == "unlead"}

    def answered(self) -> set[str]:
        """Return the digests of the server at the same time."""
        return {one["digest"] for one in self.got if one["type"] == "unlead" and one["reason"] == "asked for"}


def attached(
    open_page: Open, service: LiveService, body: dict[str, Any], messages: Messages
) -> tuple[Visit, str]:
    """Open a session, 30 frames old, in a tab that then plays it."""
    session = service.post("/v1/sessions", body)["id"]
    service.advance(session, 30)
    query = f"renderer=canvas2d&simulate=here&session={session}"
    visit = open_page(query, prepare=messages.prepare, until="body.state === 'live'")
    return visit, session


def play_here(visit: Visit) -> None:
    """Play until this tab simulates."""
    visit.press_until("Space", "body.playing === 'true'")
    visit.wait_for("body.simulated === 'here'")


def push(visit: Visit, messages: Messages) -> None:
    """Push through the fluid until the server has got some of it."""
    visit.page.mouse.up()
    visit.page.keyboard.press("p")
    already = messages.inputs()
    visit.drag([(0.3, 0.2), (0.5, 0.25), (0.6, 0.2)], release=False)
    visit.eventually(lambda: messages.inputs() > already or visit.value("simulated") != "here")


def push_and_pause(visit: Visit, messages: Messages) -> None:
    """Push through the fluid, and pause in the midst; wait until the server has computed all that was shown.

    A tab that a busy machine keeps silent for long loses its lead, and is to play once more.
    """
    already = len(messages.answered())
    while len(messages.answered()) == already:
        visit.press_until("Space", "body.playing === 'true'")
        visit.wait_for("body.simulated === 'here'")
        push(visit, messages)
        visit.press_until("Space", "body.playing === 'false' && body.simulated === 'server'")
    assert messages.asked() >= messages.answered()


def replays(service: LiveService, session: str) -> dict[str, Any]:
    """Compute a session again from its log, end both, and return the log."""
    log: dict[str, Any] = service.get(f"/v1/sessions/{session}/log")
    again = service.post("/v1/sessions", {"log": log})
    assert (again["frame"], again["notice"]) == (log["frame"], None)
    service.end(session)
    service.end(again["id"])
    return log


@pytest.mark.parametrize(
    ("name", "coarse"),
    [
        ("water_2d", None),
        pytest.param("sand_3d", None, marks=pytest.mark.long),
        pytest.param("water_2d", "1/16", marks=pytest.mark.long),
        pytest.param("wheel", None, marks=pytest.mark.long),
    ],
)
def test_a_session_moves_to_the_tab_and_back_in_mid_splash(
    open_page: Open, service: LiveService, name: str, coarse: str | None
) -> None:
    messages = Messages()
    body: dict[str, Any] = {"scenario": name, "seed": 3}
    if name == "wheel":
        file = Path(hybridmpm_service.__file__).parent / "page" / "gallery" / "water-wheel.json"
        body = {"scene": json.loads(file.read_text(encoding="utf-8"))}
    if coarse is not None:
        body["coarse"] = coarse
    visit, session = attached(open_page, service, body, messages)
    push_and_pause(visit, messages)
    # The hand is still held, the server goes on with it, and then this tab.
    here = service.get(f"/v1/sessions/{session}")["frame"]
    visit.wait_for(f"Number(body.frame) === {here}")
    service.advance(session, 7)
    push_and_pause(visit, messages)
    visit.page.mouse.up()
    begun = [one for one in messages.got if one["type"] == "lead"]
    assert begun[0]["frame"] >= 30
    assert any(one["frame"] >= here + 7 and one["push"] is not None for one in begun)
    assert len(replays(service, session)["inputs"]) > 3


def test_the_server_goes_on_from_the_log_when_the_tab_is_gone(open_page: Open, service: LiveService) -> None:
    messages = Messages()
    visit, session = attached(open_page, service, {"scenario": "water_2d", "seed": 3}, messages)
    other = open_page(f"renderer=canvas2d&watch={session}", until="body.state === 'live'")
    play_here(visit)
    push(visit, messages)
    other.wait_for("Number(body.frame) > 30")
    visit.page.close()
    known = max(one["upto"] for one in messages.got if one["type"] == "led")
    other.wait_for(f"Number(body.frame) > {known} && body.playing === 'true'")
    assert replays(service, session)["inputs"][-1]["push"] is None


def test_a_tab_that_is_too_slow_leaves_the_session_to_the_server(
    open_page: Open, service: LiveService
) -> None:
    messages = Messages(slowest=1e9)
    visit, session = attached(open_page, service, {"scenario": "water_2d", "seed": 3}, messages)
    play_here(visit)
    assert visit.page.locator("#simulated").inner_text() in ("here", "on the server")
    visit.wait_for("body.simulated === 'server'")
    visit.eventually(lambda: len(messages.answered()) == 1)
    assert messages.asked() == messages.answered()
    assert visit.page.locator("#simulated").inner_text() == "on the server"
    frame = service.get(f"/v1/sessions/{session}")["frame"]
    visit.wait_for(f"Number(body.frame) > {frame + 5}")
    assert len([one for one in messages.sent if one["type"] == "lead"]) == 1


HOOK = [[[0.3, 0.3], [0.7, 0.3], [0.7, 0.65], [0.55, 0.65], [0.55, 0.45], [0.3, 0.45]]]
ARROW = {"kind": "arrow", "points": [[0.3, 0.3], [0.55, 0.5]]}
IN_TURN = [
    {"sketch": {"kind": "shape", "outlines": HOOK}, "frames": 80, "hold": 20},
    {"sketch": ARROW, "frames": 60},
]
"""Places in the shape are matched anew on the way."""


@pytest.mark.parametrize(
    ("name", "coarse"),
    [
        ("water_2d", None),
        pytest.param("water_3d", None, marks=pytest.mark.long),
        pytest.param("water_2d", "1/16", marks=pytest.mark.long),
        pytest.param("water_ramps_2d", None, marks=pytest.mark.long),
    ],
)
def test_a_tab_follows_sketches_under_a_hand(
    open_page: Open, service: LiveService, name: str, coarse: str | None
) -> None:
    messages = Messages()
    body = {"scenario": name, "seed": 3} | ({} if coarse is None else {"coarse": coarse})
    visit, session = attached(open_page, service, body, messages)
    service.post(f"/v1/sessions/{session}/sketches", {"keyframes": IN_TURN})
    push_and_pause(visit, messages)
    while service.get(f"/v1/sessions/{session}")["control"]["phase"] != "done":
        push_and_pause(visit, messages)
    visit.page.mouse.up()
    begun = [one["steered_until"] for one in messages.got if one["type"] == "lead"]
    assert begun[0] == 30 + 160
    replays(service, session)


@pytest.mark.long
def test_a_sketch_that_is_drawn_steers_in_the_tab(open_page: Open, service: LiveService) -> None:
    messages = Messages()
    visit, session = attached(open_page, service, {"scenario": "water_2d", "seed": 3}, messages)
    visit.page.locator("#speed").fill("-2")
    visit.eventually(lambda: service.get(f"/v1/sessions/{session}")["speed"] < 0.02)
    play_here(visit)
    visit.page.keyboard.press("a")
    path = f"/v1/sessions/{session}"
    for number, end in enumerate([(0.6, 0.5), (0.4, 0.5)], start=1):
        # The second one replaces the first in mid-motion.
        visit.drag([(0.4, 0.3), (0.5, 0.4), end])
        visit.eventually(lambda number=number: (service.get(path)["control"] or {}).get("number") == number)
        visit.eventually(
            lambda number=number: (
                [one["steered_until"] is None for one in messages.got if one["type"] == "lead"][number:]
                == [False]
            )
        )
        visit.wait_for("body.simulated === 'here'")
        assert service.get(path)["control"]["phase"] in ("steering", "out_of_reach")
    # It is taken back, and the tab goes on without.
    visit.page.keyboard.press("Escape")
    visit.eventually(lambda: service.get(path)["control"] is None)
    visit.wait_for("body.simulated === 'here'")
    visit.press_until("Space", "body.playing === 'false' && body.simulated === 'server'")
    assert messages.asked() == messages.answered()
    replays(service, session)
