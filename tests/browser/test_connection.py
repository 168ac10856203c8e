"""What the page does when the server, the session or the connection goes away."""

from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import WebSocketRoute, expect

from .conftest import LIVE, LiveService, Open

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def service() -> Iterator[LiveService]:
    """Return a service of our own, because we stop it."""
    with LiveService() as live:
        yield live


@pytest.mark.long
def test_a_restarted_server_computes_the_session_again(open_page: Open, service: LiveService) -> None:
    visit = open_page(until="body.state === 'live' && Number(body.frame) > 5")
    visit.drag([(0.4, 0.3), (0.6, 0.35)])
    visit.pause_at(20)
    first, before = visit.session, service.get(f"/v1/sessions/{visit.session}/log")
    assert before["inputs"]
    visit.page.wait_for_function(
        "(digest) => JSON.parse(sessionStorage.getItem('hybridmpm.log'))?.log.digest === digest",
        arg=before["digest"],
    )
    service.stop()
    visit.wait_for("body.state === 'reconnecting'")
    expect(visit.page.locator("#banner")).to_contain_text("does not answer")
    service.start()
    expect(visit.page.locator("#toasts")).to_contain_text("computed again to frame")
    visit.wait_for(f"body.session !== '{first}' && body.state === 'live'")
    expect(visit.page.locator("#banner")).to_be_hidden()
    after = service.get(f"/v1/sessions/{visit.session}/log")
    assert (after["frame"], after["digest"]) == (before["frame"], before["digest"])
    assert visit.value("playing") == "false"
    # A log outlives a reload; where there is none, the address begins anew.
    second = visit.session
    service.stop()
    service.start()
    visit.page.reload()
    visit.wait_for(f"body.session !== '{second}' && body.frame === '{before['frame']}'")
    visit.errors.clear()  # the browser itself reports the connections that failed


def test_a_server_that_hangs_is_not_live(open_page: Open, service: LiveService) -> None:
    visit = open_page(until=LIVE)
    with service.held():
        expect(visit.page.locator("#connection")).to_have_text("No answer")
        expect(visit.page.locator("#banner")).to_contain_text("No answer for more than 2 s")
    expect(visit.page.locator("#connection")).to_have_text("Live")
    expect(visit.page.locator("#banner")).to_be_hidden()
    frame = visit.frame
    visit.wait_for(f"Number(body.frame) > {frame + 2}")


def test_broken_connection_resumes_the_same_session(open_page: Open) -> None:
    sockets: list[WebSocketRoute] = []

    def relay(socket: WebSocketRoute) -> None:
        sockets.append(socket)
        socket.connect_to_server()

    visit = open_page(prepare=lambda page: page.route_web_socket("**/stream*", relay), until=LIVE)
    first, frame = visit.session, visit.frame
    sockets[0].close(code=1011, reason="cut by the test")
    visit.eventually(lambda: len(sockets) == 2)
    visit.wait_for(f"body.state === 'live' && body.session === '{first}' && Number(body.frame) > {frame + 5}")
    assert visit.page.locator("#banner").is_hidden()


def test_deleted_session_is_reported_as_gone(open_page: Open, service: LiveService) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=0", until=LIVE)
    httpx.delete(f"{service.url}/v1/sessions/{visit.session}").raise_for_status()
    visit.wait_for("body.state === 'lost'")
    assert visit.page.get_by_role("button", name="Start a new one").is_visible()


def test_joined_session_stays_when_the_page_leaves(open_page: Open, service: LiveService) -> None:
    made = httpx.post(f"{service.url}/v1/sessions", json={"scenario": "sand_2d", "seed": 3}, timeout=60)
    session = made.raise_for_status().json()["id"]
    service.advance(session, 4)
    visit = open_page(f"renderer=canvas2d&session={session}")
    visit.wait_for(f"body.state === 'live' && body.session === '{session}' && body.frame === '4'")
    assert visit.value("playing") == "false"
    assert visit.page.locator("#scenario").input_value() == "sand_2d"
    visit.page.goto("about:blank")
    visit.page.wait_for_timeout(500)
    assert service.get(f"/v1/sessions/{session}")["frame"] == 4


@pytest.mark.long
def test_a_slow_line_is_shown(open_page: Open) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=3&simulate=server", until=LIVE)
    expect(visit.page.locator("#home")).to_have_text("simulated on the server")
    log = visit.page.context.new_cdp_session(visit.page)
    line = {"offline": False, "latency": 150, "downloadThroughput": 60e3, "uploadThroughput": 60e3}
    log.send("Network.emulateNetworkConditions", line)
    expect(visit.page.locator("#home")).to_have_text("simulated on the server, slow line")
    expect(visit.page.locator("#fps")).to_contain_text("the line brings")
    fast = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
    log.send("Network.emulateNetworkConditions", fast)
    visit.wait_for("Number(body.frame) > 200")
