"""The page of a service with keys: it asks once, and a link shows a session without one."""

import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, expect

from hybridmpm_service.keys.file import add

from .conftest import LIVE, PATIENCE_MS, LiveService, Open

pytestmark = pytest.mark.browser


class Keyed(LiveService):
    """A service with a key."""

    def __init__(self, folder: Path) -> None:
        self.token = add(folder / "keys", "anna", "view,steer,create")
        super().__init__(keys=str(folder / "keys"))
        self.http = httpx.Client(
            base_url=self.url, timeout=60, headers={"Authorization": f"Bearer {self.token}"}
        )


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Keyed]:
    """Return a service with keys."""
    with Keyed(tmp_path_factory.mktemp("keys")) as live, live.http:
        yield live


def test_the_page_asks_for_a_key_until_it_is_known_and_never_again_in_its_tab(
    open_page: Open, service: Keyed
) -> None:
    visit = open_page("renderer=canvas2d&scenario=water_2d&seed=0", prepare=lambda _tab_of_its_own: None)
    page = visit.page
    dialog = page.get_by_role("dialog", name="This server needs a key")
    expect(dialog).to_be_visible()
    expect(dialog.get_by_role("alert")).to_be_empty()
    page.get_by_label("Key", exact=True).fill("hmpm_anna_wrong")
    page.keyboard.press("Enter")
    expect(dialog.get_by_role("alert")).to_contain_text("not known")
    page.get_by_label("Key", exact=True).fill(f" {service.token} ")
    page.get_by_role("button", name="Use this key").click()
    visit.wait_for(LIVE)
    expect(dialog).to_be_hidden()
    page.reload()
    visit.wait_for(LIVE)
    expect(dialog).to_be_hidden()
    assert service.token not in page.url
    page.get_by_role("button", name="Film").click()
    expect(page.locator("#share-text")).to_have_text(re.compile(r"Filming: \d+ of \d+|saved"))
    visit.errors.clear()  # the browser itself reports the calls that were refused


def test_a_link_shows_a_session_without_a_key_and_ends(open_page: Open, service: Keyed) -> None:
    made = service.http.post("/v1/sessions", json={"scenario": "sand_2d", "seed": 3}).json()
    path = made["links"]["self"]
    service.http.post(f"{path}/advance", json={"frames": 4}).raise_for_status()
    link = service.http.post(f"{path}/links", json={}).json()
    query = link["page"].removeprefix("/?").replace("#", "&renderer=canvas2d#")
    visit = open_page(query, prepare=lambda _tab_of_its_own: None)
    visit.wait_for(f"body.state === 'live' && body.session === '{made['id']}' && body.frame === '4'")
    page = visit.page
    expect(page.get_by_role("dialog", name="This server needs a key")).to_be_hidden()
    expect(page.locator("#watching")).to_be_visible()
    page.keyboard.press("Space")
    page.mouse.move(400, 400)
    page.mouse.down()
    page.mouse.move(500, 400, steps=4)
    page.mouse.up()
    service.http.delete(f"{path}/links").raise_for_status()
    expect(page.get_by_role("alert").first).to_contain_text("This link was taken back")
    described = service.http.get(path).json()
    assert (described["frame"], described["playing"]) == (4, False)
    assert page.evaluate("sessionStorage.length") == 0
    visit.errors.clear()  # the browser itself reports the calls that were refused


@pytest.mark.long
def test_an_element_gives_its_key_to_the_page_in_it(browser: Browser, service: Keyed) -> None:
    page = browser.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(f"{service.url}/client.d.ts")
    script = """async (key) => {
      await import("/element.js");
      const view = document.createElement("hybridmpm-view");
      Object.assign(view, { key });
      view.setAttribute("scenario", "water_2d");
      view.setAttribute("controls", "off");
      document.body.replaceChildren(view);
    }"""
    state = "document.querySelector('hybridmpm-view').state"
    page.evaluate(script, service.token)
    page.wait_for_function(f"() => {state} === 'live'")
    frame = page.frames[1]
    assert service.token not in frame.url
    expect(frame.get_by_role("dialog", name="This server needs a key")).to_be_hidden()
    # A wrong one is not tried for ever: the page in the element asks.
    frame.evaluate("sessionStorage.clear()")
    page.evaluate(script, "hmpm_anna_wrong")
    expect(page.frames[1].get_by_role("dialog", name="This server needs a key")).to_be_visible()
    # A link needs no key.
    made = service.http.post("/v1/sessions", json={"scenario": "water_2d"}).json()
    link = service.http.post(f"{made['links']['self']}/links", json={}).json()["token"]
    show = """([watch, link]) => {
      const view = document.querySelector("hybridmpm-view");
      view.key = null;
      view.removeAttribute("scenario");
      view.setAttribute("watch", watch);
      view.setAttribute("link", link);
    }"""
    page.evaluate(show, [made["id"], link])
    page.wait_for_function(
        "(id) => document.querySelector('hybridmpm-view').status?.id === id", arg=made["id"]
    )
    page.close()
