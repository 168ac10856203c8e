"""The door: each route of the application is behind it, those to come as well."""

import json
import re
import socket
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from starlette.routing import BaseRoute
from tests.service.conftest import WAIT_SECONDS

from hybridmpm_service import Settings, create_app
from hybridmpm_service.http.requests import MAX_VALUES

TOO_MUCH = {
    "values": b'{"scene":{"dim":2,"bodies":[' + b"{}," * MAX_VALUES + b"{}]}}",
    "bytes": b'{"scene":"' + bytes(1 << 24) + b'"}',
}
"""Bodies of which no route may parse a byte."""


def _routes(routes: list[BaseRoute]) -> Iterator[tuple[str, str]]:
    """Yield the method and the path of each route, and "" as the method of a WebSocket."""
    for route in routes:
        path = re.sub(r"{[^}]*}", "0" * 32, getattr(route, "path", "/"))
        inner = getattr(getattr(route, "original_router", route), "routes", None)
        if inner:
            yield from _routes(inner)
        elif "websocket" in type(route).__name__.lower():
            yield "", path
        else:
            yield from ((method, path) for method in sorted(getattr(route, "methods", None) or {"GET"}))


APP = create_app(Settings(port=0))
ROUTES = sorted({*_routes(APP.routes), ("GET", "/main.js")})


def _raw(service: Any, head: str, body: bytes = b"") -> bytes:
    host, _, port = service.address.partition(":")
    answer = b""
    with socket.create_connection((host, int(port)), timeout=WAIT_SECONDS) as connection:
        connection.sendall(head.encode())
        try:
            connection.sendall(body)
            while part := connection.recv(1 << 16):
                answer += part
        except ConnectionError:
            pass
    return answer


def test_the_routes_are_found() -> None:
    documented = {
        (method.upper(), re.sub(r"{[^}]*}", "0" * 32, path))
        for path, operations in APP.openapi()["paths"].items()
        for method in operations
    }
    assert {*documented, ("", f"/v1/sessions/{'0' * 32}/stream"), ("GET", "/")} <= set(ROUTES)


@pytest.mark.parametrize("kind", TOO_MUCH)
@pytest.mark.parametrize(("method", "path"), [route for route in ROUTES if route[0]])
def test_no_route_takes_a_body_beyond_the_limits(service: Any, method: str, path: str, kind: str) -> None:
    body = TOO_MUCH[kind]
    head = f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n"
    head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    answer = _raw(service, head, body)
    assert re.match(rb"HTTP/1.1 (413|422) ", answer) or not answer, answer[:200]
    if answer and method != "HEAD":
        told = json.loads(answer.partition(b"\r\n\r\n")[2])["detail"]
        assert "may have at most" in told


@pytest.mark.parametrize("path", [path for method, path in ROUTES if method == "GET" and path != "/metrics"])
def test_head_is_answered_like_get_without_a_body(service: Any, path: str) -> None:
    get, head = service.http.get(path), service.http.head(path)
    assert (head.status_code, head.content) == (get.status_code, b"")
    assert head.headers.get("content-length") == get.headers.get("content-length")


@pytest.mark.parametrize("path", ["/", "/livez", "/readyz"])
@pytest.mark.parametrize("method", ["GET", "HEAD", "OPTIONS"])
def test_checks_of_load_balancers_need_no_host(service: Any, method: str, path: str) -> None:
    answer = _raw(service, f"{method} {path} HTTP/1.0\r\n\r\n")
    assert re.match(rb"HTTP/1.[01] 20[04] ", answer), answer[:200]


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_a_page_of_another_site_may_not_use_the_service(
    service: Any, problem: Callable[..., Any], site: str
) -> None:
    headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors"}
    problem(service.http.get("/v1/sessions", headers=headers), 403)
    problem(service.http.post("/v1/sessions", json={}, headers=headers), 403)
    # A link may lead to the page.
    link = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate"}
    assert service.http.get("/", headers=link).status_code == 200
    problem(service.http.post("/v1/sessions", json={}, headers=link), 403)
    own = {"Sec-Fetch-Site": "same-origin", "Origin": f"http://{service.address}"}
    assert service.http.post("/v1/sessions", json={}, headers=own).status_code == 422


def test_bodies_together_have_a_bounded_memory(
    service: Any, problem: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridmpm_service.http.door.MAX_BODIES_BYTES", 1 << 17)
    large = b'{"scenario":"' + b"x" * (1 << 18) + b'"}'
    headers = {"Content-Type": "application/json"}
    refused = service.http.post("/v1/sessions", content=large, headers=headers)
    assert "memory" in problem(refused, 503)["detail"]
    problem(service.http.post("/v1/sessions", content=large[:1000], headers=headers), 422)
    monkeypatch.undo()
    problem(service.http.post("/v1/sessions", content=large, headers=headers), 422)


def test_answers_together_have_a_bounded_memory(
    service: Any, path: str, problem: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridmpm_service.http.door._PIECE_BYTES", 1 << 10)
    monkeypatch.setattr("hybridmpm_service.http.door.MAX_ANSWERS_BYTES", 1)
    # One is sent, however large it is.
    assert len(service.http.get(f"{path}/particles").json()["positions"]) > 100
    monkeypatch.setattr("hybridmpm_service.http.door.Door._reserve", lambda *_: False)
    problem(service.http.get(f"{path}/particles"), 503)
    monkeypatch.undo()
    assert service.http.get(f"{path}/particles").status_code == 200
