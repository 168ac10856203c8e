"""`hybridmpm.client` against a running service, with and without asyncio."""

import asyncio
import inspect
import io
import re
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import MpmSolver, Scene, scenarios
from hybridmpm.client import (
    AsyncClient,
    AsyncJob,
    AsyncSession,
    AsyncStream,
    Client,
    Frame,
    Job,
    ServiceError,
    Session,
    Stream,
    StreamClosedError,
    UnreachableError,
)
from hybridmpm.control import Arrow, Keyframe, Stroke, push
from hybridmpm.control.sketch.render import render_png
from hybridmpm.errors import ConfigError

ARROW = [[0.3, 0.3], [0.5, 0.5]]


@pytest.fixture(scope="module")
def service(start_module: Callable[..., Any]) -> Any:
    return start_module()


@pytest.fixture
def client(service: Any) -> Iterator[Client]:
    with Client(f"http://{service.address}") as client:
        yield client
        for session in client.sessions():
            session.delete()


def test_every_call_of_the_service_has_its_method(service: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths of the OpenAPI document against those that the methods of the clients request."""
    document = service.http.get("/openapi.json").json()
    ids = {"{session_id}": "ID", "{name}": "NAME", "{job_id}": "ID"}
    there = {
        (method.upper(), "/".join(ids.get(part, part) for part in path.split("/")))
        for path, methods in document["paths"].items()
        for method in methods
    }
    requested = set()

    async def request(self: AsyncClient, method: str, path: str, **options: Any) -> Any:
        requested.add((method, path))
        raise ServiceError({"detail": "", "status": 400, "type": ""})

    monkeypatch.setattr(AsyncClient, "request", request)
    client = AsyncClient()
    session = AsyncSession(client, {"id": "ID"})
    job = AsyncJob(client, {"id": "ID"})
    monkeypatch.setattr(job, "events", _nothing)
    for call in (
        *(client.ready(), client.scenarios(), client.scenario("NAME"), client.models(), client.plan("NAME")),
        *(client.create("NAME"), client.check("NAME"), client.sessions(), client.session("ID")),
        client.outlines(text="O", center=(0.5, 0.5), height=0.3),
        client.shape(b"", "svg", center=(0.5, 0.5), height=0.3),
        *(client.make_dataset("NAME", 1), client.jobs(), client.job("ID")),
        *(session.refresh(), session.advance(), session.particles(), session.fork(), session.log()),
        *(
            session.start_file(),
            session.ways(),
            session.surface(),
            session.decisions(),
            session.steer(ARROW),
            session.force(),
            session.sketch(),
            session.pressure(),
            session.release(),
        ),
        *(session.trace(ARROW), session.record(1), session.delete(), job.result(), job.delete()),
        *(session.link(), session.take_links_back()),
    ):
        with pytest.raises(ServiceError):
            asyncio.run(call)
    # Supervisors request /livez; events are read as they come.
    others = {("GET", "/livez"), ("GET", "/v1/jobs/ID/events")}
    assert requested == there - others


async def _nothing() -> AsyncIterator[Any]:
    return
    yield


def test_both_clients_have_the_same_methods() -> None:
    for waiting, awaited in (
        (Client, AsyncClient),
        (Session, AsyncSession),
        (Job, AsyncJob),
        (Stream, AsyncStream),
    ):
        pairs = [
            {
                name: [(each.name, each.default) for each in inspect.signature(method).parameters.values()]
                for name, method in vars(kind).items()
                if callable(method) and not name.startswith("_")
            }
            for kind in (waiting, awaited)
        ]
        pairs[1].pop("request", None)
        assert pairs[0] == pairs[1]


def test_calls_of_several_threads_and_of_a_running_event_loop_do_not_disturb_each_other(
    client: Client,
) -> None:
    async def within() -> list[Any]:
        return client.models()

    with ThreadPoolExecutor() as pool:
        found = list(pool.map(lambda _: client.models(), range(8)))
    assert all(one == found[0] for one in [*found, asyncio.run(within())])


def test_a_session_computes_what_the_library_does(client: Client) -> None:
    assert client.ready()
    assert {"water_2d", "sand_3d"} <= {one["name"] for one in client.scenarios()}
    assert "fluids_2d" in {one["name"] for one in client.models()}
    scene = client.scenario("water_2d", seed=7)
    solver = MpmSolver(scene)
    assert scene.to_json() == scenarios.water_2d(seed=7).to_json()
    for session in (client.create("water_2d", 7), client.create(scene=scene)):
        assert session.advance(3)["frame"] == 3
        particles = session.particles()
        solver.reset()
        solver.advance(3)
        assert particles.frame == 3
        assert particles.time == pytest.approx(0.0075)
        assert np.array_equal(particles.positions, solver.positions)
        assert np.array_equal(particles.velocities, solver.velocities)
        assert np.array_equal(particles.ids, solver.ids)
        assert set(particles.types) == {5}
    assert [one.id for one in client.sessions()][-1] == session.id
    assert client.session(session.id).info == session.refresh()
    assert repr(session) == f"Session({session.id}, frame 3)"


def test_a_scene_is_checked_before_it_is_a_session(client: Client) -> None:
    scene = client.scenario("water_2d", seed=7)
    found = client.check(scene=scene)
    assert found["ok"]
    assert found["substeps"] == client.check("water_2d", 7)["substeps"]
    assert found["particles"] == MpmSolver(scene).particle_count
    assert not client.check(scene={"dim": 4})["ok"]
    with pytest.raises(ConfigError, match="exactly one of scenario and scene"):
        client.check()


def test_forks_logs_and_deletes(client: Client) -> None:
    session = client.create("water_2d", 3, solver="hybrid")
    session.advance(25)
    assert session.decisions()[0]["mode"] == "neural"
    fork, again = session.fork(), client.create(log=session.log())
    for other in (fork, again):
        assert other.id != session.id
        assert np.array_equal(other.particles().positions, session.particles().positions)
    fork.delete()
    with pytest.raises(ServiceError, match="there is no session") as raised:
        fork.refresh()
    assert (raised.value.status, raised.value.kind) == (404, "session-not-found")


@pytest.mark.parametrize("form", ["points", "stroke", "bytes", "file", "sketch", "keyframes"])
def test_a_sketch_steers_in_every_form(client: Client, tmp_path: Path, form: str) -> None:
    session = client.create("water_2d", 1)
    (tmp_path / "arrow.png").write_bytes(render_png(Arrow(np.array(ARROW))))
    drawing: Any = {
        "points": np.array(ARROW),
        "stroke": Stroke(points=[(0.3, 0.3), (0.5, 0.5)]),
        "bytes": (tmp_path / "arrow.png").read_bytes(),
        "file": tmp_path / "arrow.png",
        "sketch": Arrow(np.array(ARROW)),
        "keyframes": [Keyframe(Arrow(np.array(ARROW)), 20), Keyframe(Arrow(np.array(ARROW)), 20, who=0)],
    }[form]
    settings: Any = {} if form == "keyframes" else {"frames": 40}
    answer = session.steer(drawing, cap=9.0, **settings)
    assert answer["sketch"]["kind"] == "arrow"
    assert (answer["frames"], answer["needs"]["cap"]) == (40, 9.0)
    assert session.force()["frame"] == session.pressure()["frame"] == 0
    session.advance(2)
    assert session.info["control"]["frames_done"] == 2
    session.release()
    assert session.refresh()["control"] is None or session.info["control"]["phase"] == "done"


def test_a_trajectory_repeats_the_motion(client: Client) -> None:
    session = client.create("water_2d", 1)
    motion = session.trace(ARROW, kind="arrow", stride=1, frames=6, method="analytic")
    solver = MpmSolver(scenarios.water_2d(seed=1))
    solver.advance(6, motion.force)
    assert motion.frame_indices.tolist() == list(range(7))
    assert np.array_equal(motion.positions[-1], solver.positions)
    assert motion.centroids.shape == (7, 2)
    assert motion.mean_force.shape == (6, 2)
    assert session.refresh()["frame"] == 0


def test_a_stream_shows_frames_and_takes_commands(client: Client) -> None:
    session = client.create("water_2d", 1)
    with session.stream() as stream:
        assert stream.hello["session"]["id"] == session.id
        first = next(stream.frames())
        stream.step(2)
        after = next(frame for frame in stream.frames() if frame.number == 2)
        assert first.positions.shape == after.positions.shape
        stream.push([0.5, 0.3], [1.0, 0.0], 0.2)
        stream.speed(1.0)
        stream.play()
        numbers = [frame.number for frame in islice(stream.frames(), 3)]
        assert numbers == sorted(set(numbers))
        stream.let_go()
        stream.pause()
        stream.reset()
        assert next(frame for frame in stream.frames() if frame.number == 0)
        stream.speed(7.0)
        with pytest.raises(ServiceError, match="less than or equal to 1") as raised:
            for _ in stream:
                pass
        assert raised.value.status == 422
        session.delete()
        with pytest.raises(StreamClosedError, match="code 4404") as closed:
            for _ in stream:
                pass
        assert closed.value.code == 4404
        with pytest.raises(StreamClosedError):
            stream.play()


def test_a_client_with_the_solver_computes_the_frames(client: Client) -> None:
    scene = scenarios.water_2d(3)
    session, solver = client.create(scene=scene), MpmSolver(scene)
    with session.stream() as stream:

        def text(kind: str) -> dict[str, Any]:
            return next(one for one in stream if isinstance(one, dict) and one["type"] == kind)

        stream.play()
        stream.lead()
        begun = text("lead")
        frame = begun["frame"]
        solver.advance(frame)
        assert begun["digest"] == solver.digest()
        assert session.start_file().startswith(b"HMPMPLAY")
        hand = {"point": [0.5, 0.3], "velocity": [1.0, 0.0], "radius": 0.2}
        solver.advance(1)
        solver.advance(2, push(**hand))
        stream.led(frame + 3, [{"frame": frame + 1, "push": hand}])
        assert text("led")["upto"] == frame + 3
        stream.unlead(solver.digest())
        assert text("unlead")["digest"] == solver.digest()


def test_a_stream_of_a_long_world_is_in_metres(client: Client) -> None:
    body = {"shape": "box", "material": "water", "lower": [1.0, 0.0], "upper": [1.6, 0.3]}
    scene = {"dim": 2, "resolution": 50, "world": {"size": [1.6, 0.6]}, "bodies": [body]}
    session = client.create(scene=Scene.parse(scene))
    particles = session.particles()
    with session.stream() as stream:
        assert stream.hello["scene"]["world"] == {"size": [1.6, 0.6]}
        frame = next(stream.frames())
        np.testing.assert_allclose(frame.positions, particles.positions, atol=1.6 / 65535)
        assert frame.positions[:, 0].max() > 1.5
        stream.push([1.3, 0.1], [0.0, 2.0], 1.5)
        stream.step(20)
        moved = next(frame for frame in stream.frames() if frame.number == 20)
        # A problem would have been raised; without the push the block would lie on the floor.
        assert moved.positions[:, 1].max() > 0.32
    steered = session.steer([[1.2, 0.2], [0.6, 0.3]])
    assert steered["sketch"]["points"] == [[1.2, 0.2], [0.6, 0.3]]
    assert steered["goal"]["path"][-1][0] == pytest.approx(steered["goal"]["path"][0][0] - 0.6, abs=1e-3)
    with pytest.raises(ServiceError, match=r"points\[1\].*must be in \[0, 1.6\] x \[0, 0.6\] m"):
        session.steer([[1.2, 0.2], [1.2, 0.7]])


def test_the_same_with_asyncio(service: Any) -> None:
    async def use() -> list[int]:
        async with AsyncClient(f"http://{service.address}") as client:
            session = await client.create("water_2d", 7, coarse="1/16")
            await session.advance(2)
            particles, fork = await asyncio.gather(session.particles(), session.fork())
            assert particles.positions.shape == (session.info["particles"], 2)
            async with fork.stream() as stream:
                assert stream.hello["session"]["coarse"] == "1/16"
                await stream.step(2)
                seen: list[int] = []
                async for frame in stream.frames():
                    assert isinstance(frame, Frame)
                    seen.append(frame.number)
                    if frame.number == 4:
                        break
            answer = await session.steer(ARROW, frames=20)
            assert answer["frames"] == 20
            for one in (session, fork):
                await one.delete()
            with pytest.raises(ServiceError):
                await session.refresh()
            return seen

    assert asyncio.run(use())[-1] == 4


def test_jobs_report_progress_and_return_files(client: Client) -> None:
    session = client.create("water_2d", 1)
    job = session.record(50, every=25)
    events = list(job.events())
    assert events[-1]["phase"] == job.info["phase"] == "done"
    assert (events[-1]["done"], events[-1]["total"]) == (50, 50)
    with np.load(io.BytesIO(job.result())) as arrays:
        assert arrays["frames"].tolist() == [0, 25, 50]
    assert [one.id for one in client.jobs()] == [job.id]
    assert repr(client.job(job.id)) == f"Job({job.id}, done)"
    job.delete()
    assert client.jobs() == []
    with pytest.raises(ServiceError, match="there is no job") as raised:
        list(job.events())
    assert raised.value.kind == "job-not-found"

    async def use() -> bytes:
        async with AsyncClient(client.address) as awaited:
            mine = await awaited.session(session.id)
            job = await mine.record(6, every=3, format="gif", width=64)
            made = await job.result()
            await job.delete()
            return made

    assert asyncio.run(use()).startswith(b"GIF89a")


def test_errors_name_the_field_and_the_remedy(client: Client) -> None:
    with pytest.raises(ServiceError, match=r"body\.seed: ") as raised:
        client.create("water_2d", -1)
    assert raised.value.status == 422
    assert [field for field, _text in raised.value.fields] == ["body.seed"]
    with pytest.raises(ServiceError, match="water_2d") as unknown:
        client.scenario("water_9d")
    assert unknown.value.status == 404
    with pytest.raises(ConfigError, match="exactly one of scenario, scene and log"):
        client.create("water_2d", scene=scenarios.water_2d())
    with pytest.raises(ConfigError, match="kind belongs to points"):
        client.create("water_2d").steer(b"", kind="arrow")


def test_a_service_that_is_full_says_when_to_try_again(start: Callable[..., Any]) -> None:
    service = start(max_sessions=1)
    with Client(f"http://{service.address}") as client:
        client.create("water_2d")
        with pytest.raises(ServiceError) as raised:
            client.create("water_2d")
        assert (raised.value.status, raised.value.kind) == (503, "too-many-sessions")
        assert raised.value.retry_after is not None
        assert raised.value.retry_after > 0


def test_a_missing_service_and_a_late_answer_have_different_errors(service: Any) -> None:
    with (
        Client("http://127.0.0.1:9") as nobody,
        pytest.raises(UnreachableError, match="start one with `hybridmpm serve`"),
    ):
        nobody.ready()
    with Client(f"http://{service.address}", timeout=60) as client:
        session = client.create("water_2d")
        with session.stream() as stream:
            # A session at rest sends its state once, and then a status four times a second.
            stream._awaited._timeout = 0.05
            with pytest.raises(UnreachableError, match="not answered in time"):
                for _ in stream:
                    pass
        session.delete()


def test_the_example_of_the_interface_runs(service: Any, capsys: pytest.CaptureFixture[str]) -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "http-api.md"
    example, *_ = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    exec(example.replace("http://127.0.0.1:8000", f"http://{service.address}"), {})  # noqa: S102 - our own
    said = capsys.readouterr().out.split("\n")
    off = re.match(r"off by ([\d.e-]+) m", said[0])
    assert off is not None, said
    assert float(off[1]) < 0.05
    assert re.match(r"\d+ \(\d+, 2\)", said[1]), said
