"""Who may ask: a foreign web site must not reach the service through the user's browser."""

from collections.abc import Callable
from typing import Any

import pytest
from tests.service.conftest import problem

FRIEND = "https://studio.example"


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "[", "localhost.evil:80"])
def test_a_foreign_host_name_is_refused_on_loopback(service: Any, host: str) -> None:
    problem(service.http.get("/livez", headers={"Host": host}), 421)


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:1234", "127.0.0.1:8000", "[::1]:8000"])
def test_every_name_of_this_machine_is_served(service: Any, host: str) -> None:
    assert service.http.get("/livez", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1.evil.example"])
def test_a_foreign_origin_may_change_nothing(service: Any, path: str, origin: str) -> None:
    headers = {"Origin": origin}
    problem(service.http.delete(path, headers=headers), 403)
    problem(service.http.post(f"{path}/advance", json={}, headers=headers), 403)
    files = {"sketch": ("s.png", b"")}
    problem(service.http.post(f"{path}/sketches", files=files, headers=headers), 403)
    assert service.http.get(path).json()["frame"] == 0


def test_our_own_page_may(service: Any, path: str) -> None:
    headers = {"Origin": f"http://{service.address}"}
    assert service.http.post(f"{path}/advance", json={}, headers=headers).status_code == 200


def test_no_other_origin_is_told_that_it_may_read(service: Any) -> None:
    answer = service.http.get("/livez", headers={"Origin": FRIEND})
    assert "access-control-allow-origin" not in answer.headers


def test_a_listed_front_end_may_do_everything(start: Callable[..., Any]) -> None:
    service = start(cors_origins=(FRIEND,))
    headers = {"Origin": FRIEND}
    preflight = headers | {
        "Access-Control-Request-Method": "POST",
        "Access-Control-Request-Headers": "content-type",
    }
    allowed = service.http.options("/v1/sessions", headers=preflight)
    assert allowed.status_code == 200
    assert allowed.headers["access-control-allow-origin"] == FRIEND
    path = service.create()
    answer = service.http.post(f"{path}/advance", json={}, headers=headers)
    assert answer.headers["access-control-allow-origin"] == FRIEND
    refused = service.http.get("/v1/sessions/nobody", headers=headers)
    assert refused.headers["access-control-allow-origin"] == FRIEND
    with service.stream(path, origin=FRIEND) as stream:
        assert stream.receive()["type"] == "hello"
    # It can read what is answered before and instead of a route, too.
    misdirected = service.http.get("/livez", headers=headers | {"Host": "evil.example"})
    service.session(path).log = None  # a fault
    for answer, status in ((misdirected, 421), (service.http.get(f"{path}/log", headers=headers), 500)):
        assert problem(answer, status)["status"] == status
        assert answer.headers["access-control-allow-origin"] == FRIEND
        assert "Origin" in answer.headers["vary"]
    stranger = preflight | {"Origin": "https://evil.example"}
    problem(service.http.options("/v1/sessions", headers=stranger), 400)


def test_a_listed_host_name_replaces_the_loopback_names(start: Callable[..., Any]) -> None:
    service = start(allowed_hosts=("fluid.example",))
    assert service.http.get("/livez", headers={"Host": "fluid.example"}).status_code == 200
    problem(service.http.get("/livez"), 421)
