"""What a key may do: each route declares a scope, and no way leads past it."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from starlette.routing import BaseRoute
from tests.service.conftest import problem
from tests.service.keys.conftest import Keyed
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from hybridmpm_service import Settings, create_app
from hybridmpm_service.http.guard import need_of
from hybridmpm_service.keys.callers import SCOPES

FILES = ("/", "/index.html", "/embed", "/main.js")
OPEN = {("GET", path) for path in (*FILES, "/livez", "/readyz", "/openapi.json", "/metrics")}
"""All that is answered without a key; the last one to programs on this machine."""
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "BREW")


def leaves(routes: list[BaseRoute]) -> Iterator[BaseRoute]:
    """Yield each route, those of routers as well."""
    for route in routes:
        inner = getattr(getattr(route, "original_router", route), "routes", None)
        yield from leaves(inner) if inner else [route]


ROUTES = list(leaves(create_app(Settings()).routes))
CALLS = sorted(
    {
        (method, re.sub(r"{[^}]*}", "0" * 32, getattr(route, "path", "/")))
        for route in ROUTES
        for method in getattr(route, "methods", None) or ()
    }
)


def test_each_route_below_v1_declares_its_scope() -> None:
    found = [route for route in ROUTES if str(getattr(route, "path", "")).startswith("/v1")]
    assert len(found) > 25
    assert {need_of(route) for route in found} == {"view", "steer", "create"}


def test_a_route_without_a_scope_stops_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    (route,) = [one for one in ROUTES if getattr(one, "path", "") == "/v1/models"]
    monkeypatch.delattr(route.endpoint, "needs")  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="declares no scope"):
        create_app(Settings())


@pytest.mark.parametrize(("method", "path"), CALLS)
def test_no_route_but_the_open_ones_answers_without_a_key(keyed: Keyed, method: str, path: str) -> None:
    anybody = keyed.client("")
    for one in {method, "GET", "HEAD", "OPTIONS"}:
        answer = anybody.request(one, path)
        if one == "OPTIONS":
            assert answer.status_code in {204, 404, 405}
            assert answer.content == b"" or answer.status_code != 204
        elif ({"HEAD": "GET"}.get(one, one), path) in OPEN:
            assert answer.status_code in {200, 405}
        else:
            assert answer.status_code == 401, (one, path)
            assert answer.headers["www-authenticate"] == "Bearer"
            assert len(answer.content) == 0 or problem(answer, 401)["type"].endswith("key-refused")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("path", ["/v1/sessions/", "/v1", "/v1/none", "/v1/sessions/a/b/c", "//v1/sessions"])
def test_an_unknown_address_below_v1_says_nothing_without_a_key(keyed: Keyed, method: str, path: str) -> None:
    answer = keyed.client("").request(method, path)
    may_be_open = path.startswith("//") or method == "OPTIONS"
    assert answer.status_code in ({401, 404, 405} if may_be_open else {401})


NEEDS = {
    (method, route.path): need_of(route)  # type: ignore[attr-defined]
    for route in ROUTES
    if str(getattr(route, "path", "")).startswith("/v1")
    for method in getattr(route, "methods", None) or ()
}


@pytest.mark.parametrize(
    ("name", "has"), [("screen", ("view",)), ("hand", ("view", "steer")), ("anna", SCOPES[:3])]
)
def test_a_key_is_refused_what_its_scopes_lack(keyed: Keyed, name: str, has: tuple[str, ...]) -> None:
    client = keyed.client(name)
    for (method, pattern), need in NEEDS.items():
        answer = client.request(method, re.sub(r"{[^}]*}", "0" * 32, pattern))
        assert (answer.status_code == 403) == (need not in has), (method, pattern)
        if need not in has:
            assert f"{name} may not do this: it needs the scope {need}" in problem(answer, 403)["detail"]


def test_a_key_that_only_views_commands_nothing_on_a_stream(keyed: Keyed) -> None:
    path = keyed.create()
    options: Any = {"additional_headers": {"Authorization": f"Bearer {keyed.tokens['screen']}"}}
    with keyed.service.stream(path, **options) as stream:
        assert stream.text("hello")["session"]["key"] == "anna"
        commands = [
            *({"type": kind} for kind in ("play", "pause", "step", "reset", "push_end")),
            {"type": "speed", "value": 0.5},
            {"type": "push", "point": [0.5, 0.5], "velocity": [1, 0], "radius": 0.1},
        ]
        for command in commands:
            stream.send(**command)
            told = stream.text("problem")
            assert (told["status"], told["problem"]) == (403, "urn:hybridmpm:problem:scope-missing")
    info = keyed.client("anna").get(path).json()
    assert (info["frame"], info["playing"], info["speed"]) == (0, False, 0.25)


@pytest.mark.parametrize(
    ("header", "text"),
    [
        ("Bearer", "must be Authorization: Bearer KEY"),
        ("Basic TOKEN", "must be Authorization"),
        ("TOKEN", "must be Authorization"),
        ("Bearer TOKEN TOKEN", "not known"),
        ("Bearer TOKENx", "not known"),
        ("Bearer xTOKEN", "not known"),
        ("Bearer hmpm_anna_", "not known"),
        ("Bearer hmpm_", "not known"),
        ("Bearer hmpm_nobody_" + "a" * 43, "not known"),
        ("Bearer " + "a" * 30_000, "not known"),
        ("Bearer hmpm_anna_\xe9", "not known"),
        ("Bearer hmpl_", "this link was changed"),
        ("Bearer\tTOKEN", "must be Authorization"),
    ],
)
def test_a_wrong_key_is_refused_everywhere(keyed: Keyed, header: str, text: str) -> None:
    value = header.replace("TOKEN", keyed.tokens["anna"]).encode("latin-1")
    for path in ("/v1/sessions", "/livez", "/"):
        answer = keyed.client("").get(path, headers={"Authorization": value})
        assert text in problem(answer, 401)["detail"]
    upper = keyed.tokens["anna"].swapcase()
    problem(keyed.client("").get("/v1/models", headers={"Authorization": f"Bearer {upper}"}), 401)


@pytest.mark.parametrize("start", ["Bearer ", "bearer ", "BEARER   "])
def test_the_name_of_the_scheme_has_any_case(keyed: Keyed, start: str) -> None:
    headers = {"Authorization": start + keyed.tokens["anna"]}
    assert keyed.client("").get("/v1/models", headers=headers).status_code == 200


def test_two_keys_in_one_request_are_refused(keyed: Keyed) -> None:
    pair = [("Authorization", f"Bearer {keyed.tokens[name]}") for name in ("anna", "bob")]
    assert "more than one key" in problem(keyed.client("").get("/v1/sessions", headers=pair), 401)["detail"]


@pytest.mark.parametrize("query", ["key=TOKEN", "access_token=TOKEN", "TOKEN", "a=%68mpm_anna_x"])
def test_a_key_in_the_address_is_refused_even_beside_a_header(keyed: Keyed, query: str) -> None:
    for name in ("", "anna"):
        answer = keyed.client(name).get(f"/v1/sessions?{query.replace('TOKEN', keyed.tokens['anna'])}")
        assert "replace it" in problem(answer, 400)["detail"]
        assert keyed.tokens["anna"] not in answer.text


def test_a_stream_takes_its_key_as_a_subprotocol_and_does_not_repeat_it(keyed: Keyed) -> None:
    path = keyed.create()
    with keyed.service.stream(path, subprotocols=["hybridmpm", keyed.tokens["anna"]]) as stream:
        assert stream.connection.subprotocol == "hybridmpm"
        stream.send(type="play")
        stream.reach(2)
    for offered in (
        None,
        ["hybridmpm"],
        ["hybridmpm", "hmpm_anna_x"],
        [keyed.tokens["anna"], keyed.tokens["bob"]],
    ):
        with (
            pytest.raises(InvalidStatus) as refused,
            connect(f"ws://{keyed.service.address}{path}/stream", subprotocols=offered),  # type: ignore[arg-type]
        ):
            pass
        response = refused.value.response
        assert response.status_code == 401
        assert json.loads(response.body or b"")["title"] == "A key is needed"
    with keyed.service.stream(path, subprotocols=[keyed.tokens["bob"]]) as stream:
        assert stream.end() == 4404


def test_the_document_names_the_key_and_the_scopes() -> None:
    document = create_app(Settings()).openapi()
    assert document["components"]["securitySchemes"]["key"]["scheme"] == "bearer"
    paths = document["paths"]
    assert paths["/v1/sessions"]["post"]["security"] == [{}, {"key": ["create"]}]
    assert paths["/livez"]["get"]["security"] == []
    for path, item in paths.items():
        for operation in item.values():
            assert ("401" in operation["responses"]) == path.startswith("/v1")
