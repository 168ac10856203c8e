"""Sessions and jobs belong to a key: others cannot see, change, copy or count them."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS, problem
from tests.service.keys.conftest import Keyed
from websockets.sync.client import connect

from hybridmpm_service.keys.file import add

RECORDING = {"frames": 2, "format": "npz"}
ARROW = {"strokes": [{"points": [[0.4, 0.5], [0.6, 0.6]], "kind": "arrow"}]}


def ended(client: Any, job: dict[str, Any]) -> dict[str, Any]:
    """Wait until a job has ended; return its description."""
    deadline = time.monotonic() + WAIT_SECONDS
    while job["phase"] == "running":
        assert time.monotonic() < deadline
        time.sleep(0.01)
        job = client.get(job["links"]["self"]).json()
    return job


def test_a_session_of_another_is_as_one_that_never_was(keyed: Keyed) -> None:
    path = keyed.create("anna")
    bob = keyed.client("bob")
    calls: list[tuple[str, str, Any]] = [
        *(("GET", part, None) for part in ("", "/log", "/particles", "/force", "/pressure", "/decisions")),
        ("POST", "/advance", {"frames": 1}),
        ("POST", "/fork", None),
        ("POST", "/sketches", ARROW),
        ("POST", "/trajectories", ARROW),
        ("POST", "/recordings", RECORDING),
        ("POST", "/links", {}),
        *(("DELETE", part, None) for part in ("/links", "/sketches", "")),
    ]
    for method, part, body in calls:
        answer = bob.request(method, f"{path}{part}", json=body)
        never = bob.request(method, f"/v1/sessions/{'0' * 32}{part}", json=body)
        told = [one.text.replace(path.rpartition("/")[2], "ID") for one in (answer, never)]
        assert problem(answer, 404)["type"].endswith("session-not-found"), (method, part)
        assert told[0] == told[1].replace("0" * 32, "ID")
    with keyed.service.stream(
        path, additional_headers={"Authorization": bob.headers["Authorization"]}
    ) as stream:
        assert stream.end() == 4404
    assert bob.get("/v1/sessions").json()["sessions"] == []
    anna = keyed.client("anna")
    assert anna.get(path).json()["frame"] == 0
    assert {one["key"] for one in anna.get("/v1/sessions").json()["sessions"]} == {"anna"}
    assert path in {
        one["links"]["self"] for one in keyed.client("boss").get("/v1/sessions").json()["sessions"]
    }
    assert keyed.client("boss").delete(path).status_code == 204


def test_a_fork_or_a_copy_of_a_log_is_of_whoever_makes_it(keyed: Keyed) -> None:
    path = keyed.create("anna")
    boss, bob = keyed.client("boss"), keyed.client("bob")
    fork = boss.post(f"{path}/fork").json()
    assert fork["key"] == "boss"
    problem(keyed.client("anna").get(fork["links"]["self"]), 404)
    copy = bob.post("/v1/sessions", json={"log": boss.get(f"{path}/log").json()}).json()
    assert copy["key"] == "bob"
    for one in (path, fork["links"]["self"], copy["links"]["self"]):
        boss.delete(one)


def test_a_job_of_another_is_as_one_that_never_was(keyed: Keyed) -> None:
    path = keyed.create("anna")
    anna, bob = keyed.client("anna"), keyed.client("bob")
    jobs = [
        anna.post(f"{path}/recordings", json=RECORDING).json(),
        anna.post(
            f"{path}/trajectories", json=ARROW | {"frames": 2}, headers={"Prefer": "respond-async"}
        ).json(),
    ]
    for job in jobs:
        done = ended(anna, job)
        assert (done["phase"], done["key"]) == ("done", "anna")
        for part in ("self", "events", "result"):
            never = f"/v1/jobs/{job['id'][:8]}{'0' * 24}{'' if part == 'self' else f'/{part}'}"
            answers = [bob.get(one).text.replace(job["id"], "ID") for one in (job["links"][part], never)]
            assert answers[0] == answers[1].replace(never.split("/")[3], "ID")
            problem(bob.get(job["links"][part]), 404)
        problem(bob.delete(job["links"]["self"]), 404)
        problem(keyed.client("screen").delete(job["links"]["self"]), 403)
        assert keyed.client("screen").get(job["links"]["result"]).status_code == 200
    assert bob.get("/v1/jobs").json()["jobs"] == []
    assert len(anna.get("/v1/jobs").json()["jobs"]) == 2
    for job in jobs:
        assert keyed.client("hand").delete(job["links"]["self"]).status_code == 204


def test_an_idempotency_key_is_of_its_key(keyed: Keyed) -> None:
    headers, body = {"Idempotency-Key": "same"}, {"scene": SMALL_SCENE}
    made = [
        keyed.client(name).post("/v1/sessions", json=body, headers=headers).json() for name in ("anna", "bob")
    ]
    again = keyed.client("bob").post("/v1/sessions", json=body, headers=headers).json()
    assert made[0]["id"] != made[1]["id"] == again["id"]
    assert [one["key"] for one in made] == ["anna", "bob"]
    problem(keyed.client("screen").post("/v1/sessions", json=body, headers=headers), 403)


def test_quotas_bound_sessions_jobs_load_and_bytes(start_keyed: Callable[..., Keyed], tmp_path: Path) -> None:
    keyed = start_keyed(state_folder=str(tmp_path / "state"))
    keyed.add("small", "view,steer,create", "sessions=2", "jobs=1")
    keyed.add("idle", "view,steer,create", "load=0")
    keyed.add("full", "view,steer,create", "bytes=1000")
    keyed.reload()
    small, path = keyed.client("small"), keyed.create("small")
    keyed.create("small")
    told = problem(small.post("/v1/sessions", json={"scene": SMALL_SCENE}), 429)
    assert "'small' has 2 sessions, and may have 2" in told["detail"]
    problem(small.post(f"{path}/fork"), 429)
    keyed.create("anna")
    job = small.post(f"{path}/recordings", json=RECORDING).json()
    ended(small, job)
    # What has ended gives way, as in the table of all.
    assert small.post(f"{path}/recordings", json=RECORDING).status_code == 202
    problem(small.get(job["links"]["self"]), 404)
    assert len(small.get("/v1/jobs").json()["jobs"]) == 1
    options: Any = {"additional_headers": {"Authorization": f"Bearer {keyed.tokens['idle']}"}}
    with keyed.service.stream(keyed.create("idle"), **options) as stream:
        stream.send(type="play")
        assert stream.text("problem")["problem"] == "urn:hybridmpm:problem:quota-used"
    path = keyed.create("full")
    told = problem(keyed.client("full").post("/v1/sessions", json={"scene": SMALL_SCENE}), 429)
    assert "and it may have 1000: delete one" in told["detail"]
    problem(keyed.client("full").post(f"{path}/recordings", json=RECORDING), 429)


def test_a_full_table_of_jobs_forgets_no_job_of_those_who_have_few(start_keyed: Callable[..., Keyed]) -> None:
    keyed = start_keyed(max_jobs=4)
    anna, bob = keyed.client("anna"), keyed.client("bob")
    first = ended(anna, anna.post(f"{keyed.create('anna')}/recordings", json=RECORDING).json())
    path = keyed.create("bob")
    for _ in range(6):
        ended(bob, bob.post(f"{path}/recordings", json=RECORDING).json())
    assert anna.get(first["links"]["self"]).json()["phase"] == "done"
    assert len(bob.get("/v1/jobs").json()["jobs"]) == 3


def test_no_line_of_the_log_shows_a_token_and_each_names_the_key(tmp_path: Path) -> None:
    file = tmp_path / "keys"
    token = add(file, "anna", "view,steer,create")
    flags = ["--port", "0", "--keys", str(file), "--log-level", "debug", "--log-format", "json"]
    with subprocess.Popen(
        [sys.executable, "-m", "hybridmpm_service", *flags],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        address = str(process.stdout.readline()).split()[3].removeprefix("http://")  # type: ignore[union-attr]
        with httpx.Client(base_url=f"http://{address}", timeout=WAIT_SECONDS) as client:
            headers = {"Authorization": f"Bearer {token}"}
            made = client.post("/v1/sessions", json={"scene": SMALL_SCENE}, headers=headers).json()
            path = made["links"]["self"]
            link = client.post(f"{path}/links", json={}, headers=headers).json()["token"]
            for one in (token, link):
                headers = {"Authorization": f"Bearer {one}", "X-Request-ID": one[:64]}
                client.get(path, headers=headers)
                client.get(f"/v1/sessions/{one}", headers=headers)
                client.get(f"/v1/sessions?key={one}", headers=headers)
                client.get(f"/{one}/x")
                options: Any
                for options in ({"subprotocols": ["hybridmpm", one]}, {"additional_headers": headers}):
                    with connect(f"ws://{address}{path}/stream", compression=None, **options) as stream:
                        stream.recv(timeout=WAIT_SECONDS)
            metrics = client.get("/metrics").text
        process.send_signal(signal.SIGTERM)
        lines = process.communicate(timeout=WAIT_SECONDS)[1]
    assert "hybridmpm_requests_total" in metrics
    for one in (token, link):
        assert one[12:40] not in metrics + lines
    records = [json.loads(line) for line in lines.splitlines()]
    assert {"anna", "link of anna"} <= {one.get("key") for one in records}
    assert any("127.0.0.1 anna GET" in one["message"] for one in records)
    assert any("sec-websocket-protocol" in one["message"].lower() for one in records)


def test_metrics_are_for_keys_where_others_may_read_them(start_keyed: Callable[..., Keyed]) -> None:
    keyed = start_keyed(metrics="all")
    away = {"X-Forwarded-For": "203.0.113.5"}
    problem(keyed.client("").get("/metrics", headers=away), 401)
    assert keyed.client("screen").get("/metrics", headers=away).status_code == 200
    assert keyed.client("").get("/metrics").status_code == 200
    # A proxy that passes on what a client claims does not make it a program on this machine.
    problem(keyed.client("").get("/metrics", headers={"X-Forwarded-For": "127.0.0.1"}), 401)
