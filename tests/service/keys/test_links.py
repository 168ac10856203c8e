"""Links: they show one session, for a time, until they are taken back."""

import time
from collections.abc import Callable
from typing import Any

import pytest
from itsdangerous import URLSafeSerializer
from tests.service.conftest import problem
from tests.service.keys.conftest import Keyed

from hybridmpm_service.errors import KeyRefusedError
from hybridmpm_service.keys.ring import Ring


def link(keyed: Keyed, path: str, name: str = "anna", **body: Any) -> str:
    """Return the token of a link to a session."""
    answer = keyed.client(name).post(f"{path}/links", json=body)
    assert answer.status_code == 201, answer.text
    return str(answer.json()["token"])


def test_a_link_shows_one_session_and_changes_nothing(keyed: Keyed) -> None:
    path, other = keyed.create("anna"), keyed.create("anna")
    made = keyed.client("anna").post(f"{path}/links", json={"seconds": 60}).json()
    assert made["page"] == f"/?watch={path.rpartition('/')[2]}#link={made['token']}"
    assert 0 < made["until"] - time.time() <= 60
    viewer = keyed.client(made["token"])
    for part in ("", "/particles", "/force", "/log"):
        assert viewer.get(f"{path}{part}").status_code == 200
        problem(viewer.get(f"{other}{part}"), 404)
    assert [one["links"]["self"] for one in viewer.get("/v1/sessions").json()["sessions"]] == [path]
    assert viewer.get("/v1/jobs").json()["jobs"] == []
    for method, address in (("POST", f"{path}/advance"), ("POST", "/v1/sessions"), ("DELETE", path)):
        problem(viewer.request(method, address, json={}), 403)
    problem(viewer.post(f"{path}/links", json={}), 403)
    with keyed.service.stream(path, subprotocols=["hybridmpm", made["token"]]) as stream:
        stream.text("hello")
        stream.send(type="play")
        assert stream.text("problem")["status"] == 403
    with keyed.service.stream(other, subprotocols=["hybridmpm", made["token"]]) as stream:
        assert stream.end() == 4404


def test_a_link_ends_when_it_is_taken_back_and_its_streams_with_it(keyed: Keyed) -> None:
    path = keyed.create("anna")
    token = link(keyed, path)
    with keyed.service.stream(path, subprotocols=["hybridmpm", token]) as stream:
        stream.text("hello")
        problem(keyed.client("screen").delete(f"{path}/links"), 403)
        problem(keyed.client("bob").delete(f"{path}/links"), 404)
        assert keyed.client("anna").delete(f"{path}/links").status_code == 204
        assert stream.end() == 4401
    told = problem(keyed.client(token).get(path), 401)
    assert told["detail"] == "this link was taken back: ask for a new one"
    assert keyed.client(link(keyed, path)).get(path).status_code == 200


def test_a_link_ends_with_its_time_its_key_and_its_secret(keyed: Keyed) -> None:
    path = keyed.create("anna")
    session = keyed.service.session(path)
    now = 1000.0
    ring = Ring(keyed.file, lambda: now)
    caller = ring.caller(keyed.tokens["anna"])
    token, until = ring.link(caller, session, 0, 60)
    assert until == 1060
    assert ring.caller(token).session == session.id
    seen = ring.caller(token)
    now = 1060.0
    assert not seen.is_valid()
    with pytest.raises(KeyRefusedError, match="expired"):
        ring.caller(token)
    problem(keyed.client(token).get(path), 401)
    now = 1000.0
    text = keyed.file.read_text("utf-8")
    try:
        secret = text.split()[1]
        keyed.file.write_text(text.replace(secret, "ab" * 32), "utf-8")
        with pytest.raises(KeyRefusedError, match="was changed"):
            Ring(keyed.file, lambda: now).caller(token)
        lines = [line for line in text.splitlines() if " anna " not in line and "of=anna" not in line]
        keyed.file.write_text("\n".join(lines), "utf-8")
        with pytest.raises(KeyRefusedError, match="the key that made this link"):
            Ring(keyed.file, lambda: now).caller(token)
    finally:
        keyed.file.write_text(text, "utf-8")


def test_a_changed_link_is_refused(keyed: Keyed) -> None:
    path, other = keyed.create("anna"), keyed.create("bob")
    token = link(keyed, path)
    body, _, signature = token.removeprefix("hmpl_").rpartition(".")
    content = URLSafeSerializer("x").load_payload(body.encode())
    changed = [[other.rpartition("/")[2], *content[1:]], [content[0], content[1] + 10**6, *content[2:]]]
    forged = [
        *(URLSafeSerializer("x").dump_payload(one).decode() + f".{signature}" for one in changed),
        *(
            str(URLSafeSerializer(secret, salt="hybridmpm link").dumps(content))
            for secret in ("", "x", "ab" * 32)
        ),
        *(body, f"{body}.", f"{body}.{signature}a", f"{body}..{signature}", f".{body}.{signature}"),
        f"{body}.{signature[:-1]}",
    ]
    for one in forged:
        assert "was changed" in problem(keyed.client(f"hmpl_{one}").get(path), 401)["detail"], one


def test_an_admin_links_to_the_session_of_another(keyed: Keyed) -> None:
    path = keyed.create("anna")
    assert keyed.client(link(keyed, path, "boss")).get(path).status_code == 200


@pytest.mark.parametrize("seconds", [0, -1, 2_592_001, 1.5, True, None])
def test_the_time_of_a_link_is_bounded(keyed: Keyed, seconds: Any) -> None:
    problem(keyed.client("anna").post(f"{keyed.create()}/links", json={"seconds": seconds}), 422)


def test_a_key_that_is_deleted_ends_its_calls_its_streams_and_its_listeners(
    start_keyed: Callable[..., Keyed], caplog: pytest.LogCaptureFixture
) -> None:
    keyed = start_keyed()
    path, anna = keyed.create("anna"), keyed.client("anna")
    text = keyed.file.read_text("utf-8")
    with keyed.service.stream(path, subprotocols=["hybridmpm", keyed.tokens["anna"]]) as stream:
        stream.text("hello")
        keyed.file.write_text(text + "key anna\n", "utf-8")
        keyed.reload()
        assert f"line {text.count(chr(10)) + 1} of" in caplog.text
        assert anna.get(path).status_code == 200, "a damaged file changes nothing"
        lines = [line for line in text.splitlines() if " anna " not in line and "of=anna" not in line]
        keyed.file.write_text("\n".join(lines), "utf-8")
        keyed.reload()
        assert stream.end() == 4401
    problem(anna.get(path), 401)
    problem(keyed.client("bob").get(path), 404)
    assert keyed.client("boss").get(path).json()["key"] == "anna"


def test_without_keys_no_link_is_needed(service: Any, path: str) -> None:
    assert "no link is needed" in problem(service.http.post(f"{path}/links", json={}), 400)["detail"]
    assert service.http.get(path, headers={"Authorization": "Bearer x"}).status_code == 200
    with service.stream(path, subprotocols=["hybridmpm"]) as stream:
        assert stream.connection.subprotocol == "hybridmpm"
        stream.text("hello")
