"""Crowds at one thing: listeners of a job, keys of a cache, and downloads of a log; no clock decides."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.responses import Response
from tests.service.conftest import WAIT_SECONDS

from hybridmpm_service.http import jobs as module
from hybridmpm_service.http import logs
from hybridmpm_service.http.jobs import JobBody, events
from hybridmpm_service.jobs import Job, Progress, Result
from hybridmpm_service.routes import calls
from hybridmpm_service.routes.calls import Idempotency
from hybridmpm_service.sessions.inputs import PushInput
from hybridmpm_service.sessions.revival import SessionLog
from hybridmpm_service.sessions.turns import CLIENT, Client


def test_four_hundred_listeners_cost_a_job_one_event_for_each_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_LOOK_SECONDS", 0.0)
    monkeypatch.setattr(module, "_SECONDS_PER_LISTENER", 0.0)
    made: list[int] = []
    describe = JobBody.of

    def noted(job: Job) -> JobBody:
        made.append(job.progress.done)
        return describe(job)

    monkeypatch.setattr(JobBody, "of", noted)

    async def play() -> None:
        heard: list[list[bytes]] = [[] for _ in range(400)]

        async def work(progress: Progress, _folder: Path) -> Result:
            for done in range(1, 5):
                progress.update(done, 4)
                # All are to hear of it before the next change.
                while not all(len(one) == done for one in heard):  # noqa: ASYNC110 - no event
                    await asyncio.sleep(0)
            return Result(file=tmp_path, media_type="text/plain")

        async def listen(to: list[bytes]) -> None:
            async for event in events(job, asyncio.Event()):
                to.append(event)  # noqa: PERF401 - the job reads it meanwhile

        job = Job("recording", "s", work, tmp_path, lambda: 0.0, run="")
        while not job.progress.done:  # noqa: ASYNC110 - there is no event
            await asyncio.sleep(0)
        async with asyncio.timeout(WAIT_SECONDS), asyncio.TaskGroup() as group:
            for one in heard:
                group.create_task(listen(one))
        assert all(one == heard[0] for one in heard)
        assert [event.startswith(b"event: running") for event in heard[0]] == [True] * 4 + [False]
        assert made == [1, 2, 3, 4, 4]
        assert module._listeners[job] == 0

    asyncio.run(play())


def test_a_client_with_many_keys_forgets_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls, "_MOST", 8)

    async def play() -> None:
        cache, done = Idempotency(), list[str]()

        async def post(client: Client, key: str) -> None:
            async def body() -> bytes:
                return b"{}"

            async def work() -> Response:
                done.append(key)
                return Response(b"made")

            CLIENT.set(client)
            url, headers = SimpleNamespace(path="/v1/sessions", query=""), {calls.HEADER: key}
            request: Any = SimpleNamespace(url=url, headers=headers, body=body)
            assert (await cache.once(request, work)).body == b"made"

        modest, neighbour, greedy = Client("a", 1), Client("b", 1), Client("b", 2)
        await post(modest, "modest")
        await post(neighbour, "neighbour")
        for number in range(100):
            await post(greedy, f"greedy {number}")
        del done[:]
        for client, key in ((modest, "modest"), (neighbour, "neighbour"), (greedy, "greedy 99")):
            await post(client, key)
        assert done == []
        await post(greedy, "greedy 0")
        assert done == ["greedy 0"]

    asyncio.run(play())


def test_a_log_that_many_download_is_written_once(
    service: Any, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = service.http.get(f"{path}/log").json()
    hand = {"point": [0.5, 0.4], "velocity": [0.0, 0.0], "radius": 0.05, "cap": 15.0}
    pushes = [{"kind": "push", "frame": 0, "push": hand | {"cap": 1.0 + cap}} for cap in range(1000)]
    made = service.http.post("/v1/sessions", json={"log": log | {"inputs": pushes}}).json()
    monkeypatch.setattr(PushInput, "model_dump_json", None)
    starts, write = list[SessionLog](), logs._start_of

    def noted(log: SessionLog) -> bytes:
        starts.append(log)
        return write(log)

    monkeypatch.setattr(logs, "_start_of", noted)
    service.http.get(made["links"]["log"])
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: service.http.get(made["links"]["log"]), range(16)))
    assert {answer.status_code for answer in answers} == {200}
    assert all(answer.json() == log | {"inputs": pushes} for answer in answers)
    assert len(starts) == 1
    service.http.delete(made["links"]["self"])
