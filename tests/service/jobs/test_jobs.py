"""Jobs over HTTP: progress, results, cancelling, and what becomes of them."""

import asyncio
import io
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS, problem

from hybridmpm import MpmSolver, Scene
from hybridmpm.stream_frames import decode
from hybridmpm_service import jobs
from hybridmpm_service.errors import JobNotFoundError
from hybridmpm_service.jobs import JobTable, Progress, Result
from hybridmpm_service.sessions.journal import locked

ARROW = {"strokes": [{"points": [[0.4, 0.4], [0.5, 0.5]], "kind": "arrow"}], "frames": 12, "hold": 3}


@pytest.fixture(scope="module")
def service(start_module: Callable[..., Any]) -> Any:
    return start_module(max_jobs=3)


@pytest.fixture
def session(service: Any) -> Iterator[str]:
    path = service.create()
    yield path
    service.http.delete(path)
    for job in service.http.get("/v1/jobs").json()["jobs"]:
        service.http.delete(job["links"]["self"])


def _slow(service: Any, session: str) -> None:
    """Make frames of copies of a session take long, on any machine."""
    simulation = service.session(session).simulation
    copy = simulation.copy

    def slow() -> Any:
        twin = copy()
        advance = twin.advance

        def late(frames: int = 1, force: Any = None) -> None:
            time.sleep(0.02)
            advance(frames, force)

        twin.advance = late
        return twin

    simulation.copy = slow


def _record(service: Any, session: str, **body: Any) -> httpx.Response:
    answer: httpx.Response = service.http.post(f"{session}/recordings", json=body)
    return answer


def _trace(service: Any, session: str, body: Any = ARROW, **headers: str) -> httpx.Response:
    answer: httpx.Response = service.http.post(f"{session}/trajectories", json=body, headers=headers)
    return answer


def test_a_recording_is_that_of_the_library_and_the_session_stays(service: Any, session: str) -> None:
    service.http.post(f"{session}/advance", json={"frames": 2})
    answer = _record(service, session, frames=6, every=2)
    assert answer.status_code == 202
    assert answer.headers["Location"] == answer.json()["links"]["self"]
    job = service.ended(answer.json())
    assert (job["kind"], job["phase"], job["done"], job["total"]) == ("recording", "done", 6, 6)
    assert job["session"] == session.rpartition("/")[2]
    result = service.http.get(job["links"]["result"])
    assert result.headers["Content-Type"] == "application/x-npz"
    arrays = np.load(io.BytesIO(result.content), allow_pickle=False)
    solver = MpmSolver(Scene.parse(SMALL_SCENE))
    solver.advance(8)
    assert arrays["frames"].tolist() == [2, 4, 6, 8]
    assert np.array_equal(arrays["positions"][-1], solver.positions)
    assert service.http.get(session).json()["frame"] == 2


@pytest.mark.parametrize(("form", "media_type"), [("gif", "image/gif"), ("png", "image/png")])
def test_pictures_are_drawn(service: Any, session: str, form: str, media_type: str) -> None:
    job = service.ended(_record(service, session, frames=6, every=3, format=form, width=96).json())
    assert job["problem"] is None
    result = service.http.get(job["links"]["result"])
    assert result.headers["Content-Type"] == media_type
    with Image.open(io.BytesIO(result.content)) as picture:
        assert picture.format == form.upper()
        assert picture.height > 0


@pytest.mark.parametrize("accept", ["application/json", "application/x-npz"])
def test_a_trajectory_as_a_job_is_the_one_that_is_answered_at_once(
    service: Any, session: str, accept: str
) -> None:
    now = _trace(service, session, Accept=accept)
    answer = _trace(service, session, Accept=accept, Prefer="respond-async, wait=5")
    assert (now.status_code, answer.status_code) == (200, 202)
    assert answer.headers["Preference-Applied"] == "respond-async"
    job = service.ended(answer.json())
    assert (job["kind"], job["done"], job["total"]) == ("trajectory", 15, 15)
    result = service.http.get(job["links"]["result"])
    assert result.headers["Content-Type"] == accept
    if accept == "application/json":
        found, expected = result.json(), now.json()
        assert found.pop("planning_ms") > 0
        expected.pop("planning_ms")
        assert found == expected
    else:
        one, other = (np.load(io.BytesIO(each.content)) for each in (result, now))
        assert all(np.array_equal(one[name], other[name]) for name in other.files)


def test_events_report_the_progress_until_the_end(service: Any, session: str) -> None:
    job = _record(service, session, frames=600, every=100).json()
    with service.http.stream("GET", job["links"]["events"]) as stream:
        assert stream.headers["Content-Type"].startswith("text/event-stream")
        text = "".join(stream.iter_text())
    events = [dict(line.split(": ", 1) for line in one.split("\n")) for one in text.split("\n\n")[:-1]]
    bodies = [json.loads(event["data"]) for event in events]
    assert [event["event"] for event in events] == [body["phase"] for body in bodies]
    assert bodies[-1]["phase"] == "done"
    counts = [body["done"] for body in bodies]
    assert counts == sorted(counts)
    assert counts[-1] == bodies[-1]["total"] == 600


def test_a_deleted_job_ends_and_is_forgotten(service: Any, session: str) -> None:
    _slow(service, session)
    job = _record(service, session, frames=2000).json()
    assert service.http.get(job["links"]["result"]).status_code == 409
    assert service.http.delete(job["links"]["self"]).status_code == 204
    for name in ("self", "events", "result"):
        gone = service.http.get(job["links"][name])
        assert gone.status_code == 404
        assert gone.json()["type"] == "urn:hybridmpm:problem:job-not-found"
    # Its thread ends with the frame that it computed: the next job of the session begins soon.
    assert service.ended(_record(service, session, frames=1).json())["phase"] == "done"


def test_a_job_ends_with_its_session(service: Any, session: str) -> None:
    _slow(service, session)
    job = _record(service, session, frames=2000).json()
    service.http.delete(session)
    ended = service.ended(job)
    assert ended["phase"] == "failed"
    assert ended["problem"]["type"] == "urn:hybridmpm:problem:session-not-found"
    assert service.http.get(job["links"]["result"]).status_code == 404


def test_there_are_never_more_jobs_than_allowed(service: Any, session: str) -> None:
    short = service.ended(_record(service, session, frames=1).json())
    _slow(service, session)
    long = [_record(service, session, frames=2000).json() for _ in range(3)]
    # The one that has ended made room, and now there is none.
    assert service.http.get(short["links"]["self"]).status_code == 404
    refused = _record(service, session, frames=1)
    assert refused.status_code == 503
    assert int(refused.headers["Retry-After"]) > 0
    assert refused.json()["type"] == "urn:hybridmpm:problem:too-many-jobs"
    listed = service.http.get("/v1/jobs").json()["jobs"]
    assert [job["id"] for job in listed] == [job["id"] for job in long]


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"frames": 2001}, "body.frames"),
        ({"frames": 1500, "format": "gif", "speed": 0.05}, "body.speed"),
        ({"frames": 5, "format": "exe"}, "body.format"),
        ({"frames": 5, "film": True}, "body.film"),
    ],
)
def test_an_invalid_recording_is_refused(
    service: Any, session: str, body: dict[str, Any], field: str
) -> None:
    answer = _record(service, session, **body)
    assert answer.status_code == 422
    assert [error["field"] for error in answer.json()["errors"]] == [field]


def test_a_frame_that_fails_is_the_problem_of_the_job(service: Any, session: str) -> None:
    def fail(_frames: int = 1, _force: Any = None) -> None:
        raise MemoryError("no memory")

    simulation = service.session(session).simulation
    twin = simulation.copy()
    twin.advance = fail
    simulation.copy = lambda: twin
    ended = service.ended(_record(service, session, frames=3).json())
    assert ended["problem"]["status"] == 500
    assert "memory" not in json.dumps(ended)


def test_results_lie_on_disk_as_long_as_the_service_runs(start: Callable[..., Any]) -> None:
    service = start()
    job = service.ended(_record(service, service.create(), frames=2).json())
    table: JobTable = service.app.state.jobs
    file = table.get(job["id"]).result.file  # type: ignore[union-attr]
    assert file.exists()
    running = _record(service, service.create(), frames=2000).json()
    folder = table.get(running["id"]).folder.parent
    service.stop()
    assert not folder.exists()


def test_a_job_of_an_earlier_run_is_told_lost(start: Callable[..., Any]) -> None:
    service = start()
    job = service.ended(_record(service, service.create(), frames=2).json())
    # The same process stands in for a later one.
    service.app.state.jobs._jobs.clear()
    service.app.state.jobs.run = "0badcafe"
    for name in ("self", "events", "result"):
        body = problem(service.http.get(job["links"][name]), 410)
        assert body["type"] == "urn:hybridmpm:problem:job-lost"
        assert "lost when an earlier run ended. Begin it again" in body["detail"]
    problem(service.http.get("/v1/jobs/nonsense"), 404)


def test_folders_of_killed_processes_are_deleted_and_no_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jobs.tempfile, "gettempdir", lambda: str(tmp_path))
    killed, alive, foreign = (tmp_path / name for name in ("hybridmpm-jobs-k", "hybridmpm-jobs-a", "other"))
    for folder in (killed, alive, foreign):
        folder.mkdir()
        (folder / "result").write_bytes(b"!")
    # Locks are of processes: within one, SQLite lets a second connection in only where the first is closed.
    with closing(locked(alive)):
        JobTable(4, 10.0, time.monotonic)
    assert [folder.exists() for folder in (killed, alive, foreign)] == [False, True, True]


def test_jobs_are_forgotten_in_time(tmp_path: Path) -> None:
    async def use() -> None:
        now = 0.0
        table = JobTable(4, 10.0, lambda: now)

        async def work(progress: Progress, folder: Path) -> Result:
            progress.update(1, 1)
            (folder / "made").write_bytes(b"!")
            return Result(file=folder / "made", media_type="text/plain")

        job = table.begin("recording", "s", work)
        while job.phase == "running":  # noqa: ASYNC110 - a job has no event
            await asyncio.sleep(0.001)
        now = 9.0
        table.expire()
        assert table.get(job.id).result is not None
        now = 10.5
        table.expire()
        with pytest.raises(JobNotFoundError, match="ended more than 10 s ago"):
            table.get(job.id)
        assert not job.folder.exists()
        await table.close()

    asyncio.run(use())


def test_frames_of_a_trajectory_leave_as_they_are_computed(service: Any, session: str) -> None:
    """The first frame is read while the last one is held back."""
    gate = threading.Event()
    simulation = service.session(session).simulation
    twin = simulation.copy()
    advance, count = twin.advance, 0

    def held(frames: int = 1, force: Any = None) -> None:
        nonlocal count
        count += 1
        if count == 10:
            assert gate.wait(WAIT_SECONDS)
        advance(frames, force)

    expected = np.array(_trace(service, session).json()["positions"][-1])
    simulation.copy = lambda: twin
    twin.advance = held
    frames = []
    headers = {"Accept": "application/x-hybridmpm-frames"}
    with service.http.stream("POST", f"{session}/trajectories", json=ARROW, headers=headers) as stream:
        assert stream.status_code == 200
        assert stream.headers["Content-Type"] == "application/x-hybridmpm-frames"
        for frame in _frames(stream.iter_raw()):
            frames.append(frame)
            if len(frames) == 1:
                assert count <= 10
                gate.set()
    assert [frame.number for frame in frames] == list(range(16))
    assert np.abs(frames[-1].positions - expected).max() <= 1 / 65535


def _frames(pieces: Iterator[bytes]) -> Iterator[Any]:
    data = b""
    for piece in pieces:
        data += piece
        while len(data) >= 4:
            size = int.from_bytes(data[:4], "little")
            if size == 0:
                return
            if len(data) < 4 + size:
                break
            yield decode(data[4 : 4 + size])
            data = data[4 + size :]
    raise AssertionError("the stream was cut off")


def test_a_stream_that_cannot_begin_is_a_problem(service: Any, session: str) -> None:
    answer = _trace(service, session, ARROW | {"cap": -1}, Accept="application/x-hybridmpm-frames")
    assert answer.status_code == 422
    service.http.delete(session)
    gone = _trace(service, session, Accept="application/x-hybridmpm-frames")
    assert gone.status_code == 404


def test_a_request_with_a_key_acts_once(service: Any, session: str) -> None:
    def post(path: str, body: Any, key: str) -> httpx.Response:
        answer: httpx.Response = service.http.post(path, json=body, headers={"Idempotency-Key": key})
        return answer

    first = post("/v1/sessions", {"scene": SMALL_SCENE}, "one")
    again = post("/v1/sessions", {"scene": SMALL_SCENE}, "one")
    other = post("/v1/sessions", {"scene": SMALL_SCENE}, "two")
    assert first.status_code == again.status_code == 201
    assert first.content == again.content
    assert first.headers["Location"] == again.headers["Location"] != other.headers["Location"]
    path = f"{session}/advance"
    for _ in range(3):
        assert post(path, {"frames": 2}, "a").json()["frame"] == 2
    assert post(path, {"frames": 2}, "b").json()["frame"] == 4
    misused = post(path, {"frames": 3}, "a")
    assert misused.status_code == 422
    assert misused.json()["type"] == "urn:hybridmpm:problem:idempotency-key-reused"
    # The same key at another address is another one.
    assert post(f"{session}/fork", None, "a").status_code == 201
    for answer in (first, other):
        service.http.delete(answer.json()["links"]["self"])


def test_keys_that_arrive_together_act_once(service: Any, session: str) -> None:
    frames = []

    def post() -> None:
        answer = service.http.post(
            f"{session}/advance", json={"frames": 300}, headers={"Idempotency-Key": "x"}
        )
        frames.append(answer.json()["frame"])

    threads = [threading.Thread(target=post) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(WAIT_SECONDS)
    assert frames == [300] * 4


@pytest.mark.parametrize("key", ["", "k" * 201])
def test_keys_have_a_length(service: Any, session: str, key: str) -> None:
    answer = service.http.post(f"{session}/advance", json={}, headers={"Idempotency-Key": key})
    assert answer.status_code == 422
    assert "1 to 200 characters" in answer.json()["detail"]


def test_a_refusal_with_a_key_is_repeated(service: Any, session: str) -> None:
    answers = [
        service.http.post(f"{session}/advance", json={"frames": 0}, headers={"Idempotency-Key": "bad"})
        for _ in range(2)
    ]
    assert [answer.status_code for answer in answers] == [422, 422]
