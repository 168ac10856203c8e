"""A small twin of the load test, and its errors where the service fails."""

import asyncio
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import numpy as np
import pytest
from click.testing import CliRunner
from websockets.asyncio.server import ServerConnection, serve

from hybridmpm import SimulationError
from hybridmpm.stream_frames import Frame, encode
from hybridmpm_lab.commands import cli
from hybridmpm_lab.service import measurements, server
from hybridmpm_lab.service.attacks import ATTACKS
from hybridmpm_lab.service.hostile import uploads
from hybridmpm_lab.service.viewers import Viewer, watching


def run(file: Path, *options: str) -> dict[tuple[str, int, int], float | None]:
    """Run the command, and return the values by measure, sessions and viewers."""
    result = CliRunner().invoke(cli, ["service", *options, "--json", str(file)])
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    assert all(row["measure"] in result.output for row in rows)
    assert all(row["command"].startswith("python -m hybridmpm_lab service --") for row in rows)
    assert all({"machine", "threads", "date", "commit", "solver_version"} <= set(row) for row in rows)
    figures = {(row["measure"], row["sessions"], row["viewers"]): row["value"] for row in rows}
    assert len(figures) == len(rows)
    return figures


def test_a_small_twin_of_the_measurement(tmp_path: Path) -> None:
    parts = [word for name in ("intervals", "sockets", "push", "hostile") for word in ("--part", name)]
    sizes = ["--sessions", "2", "--viewers", "3", "--seconds", "0.2", "--repeats", "1"]
    figures: Any = run(tmp_path / "service.json", *parts, *sizes)
    for crowd in ((2, 1), (1, 3)):
        p50, p95, p99 = (figures[f"frame interval p{share}", *crowd] for share in (50, 95, 99))
        assert 0 < p50 <= p95 <= p99
        assert figures["load of the viewers", *crowd] > 0
    assert figures["frame interval by plain sockets p99", 2, 1] > 0
    assert (
        0 < figures["push to moved particles, p50", 1, 1] <= figures["push to moved particles, worst", 1, 1]
    )
    assert figures["hostile upload, slowest answer", 1, 0] > 0
    # A refusal has at least the fields of a problem.
    assert 0.1 < figures["hostile upload, largest answer", 1, 0] < 64
    assert not [measure for measure, *_ in figures if "restart" in measure or "1 KB/s" in measure]


@pytest.mark.parametrize("kills", [2, pytest.param(200, marks=[pytest.mark.long, pytest.mark.timeout(3600)])])
def test_kills_cost_nothing_that_was_acknowledged(tmp_path: Path, kills: int) -> None:
    figures: Any = run(tmp_path / "service.json", "--part", "kills", "--kills", str(kills), "--seed", "1")
    values = {measure: value for (measure, *_), value in figures.items()}
    assert values["kills under load"] == kills
    assert values["logs compared with uninterrupted runs"] >= 4 * kills
    assert values["frames of these logs"] > 0
    assert values["logs whose digests differ"] == 0
    assert values["sessions, frames, inputs and deletions lost"] == 0


@pytest.mark.long
def test_the_other_parts_of_the_measurement(tmp_path: Path) -> None:
    parts = [word for name in ("real-time", "sketch", "restart", "visit") for word in ("--part", name)]
    figures: Any = run(tmp_path / "service.json", *parts, "--kept", "2", "--seconds", "1", "--repeats", "3")
    # A player catches up at most a tenth of a second at once.
    assert 0 < figures["least time scale, coarse 1/16, aim 1", 8, 1] < 1.2
    assert figures["sketch to the first steered frame, first sketch", 1, 1] > 0
    sketch = [figures[f"sketch to the first steered frame, {which}", 1, 1] for which in ("p50", "worst")]
    assert 0 < sketch[0] <= sketch[1]
    assert figures["restart after kill -9, until all sessions answer", 2, 0] > 0
    assert figures["first motion, second visit at 1.6 Mbit/s, 150 ms", 1, 1] > 0.3
    assert figures["age of frames at 1.6 Mbit/s, 150 ms, water_2d, p50", 1, 2] > 0.07


def test_a_small_twin_of_the_attacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = "empty pongs at 1 MB/s"
    monkeypatch.setattr(measurements, "ATTACKS", {name: ATTACKS[name]})
    figures: Any = run(tmp_path / "attacks.json", "--part", "attacks", "--seconds", "0.5")
    assert {measure for measure, *_ in figures} == {
        f"{measure} beside {name}"
        for measure in ("GET p99", "POST worst", "frame interval p99", "memory", "end on SIGTERM")
    }
    waits = [row for row in json.loads((tmp_path / "attacks.json").read_text()) if row["unit"] == "ms"]
    assert len(waits) == 3
    assert all(row["calm"] > 0 and row["value"] > 0 for row in waits)


def test_a_service_that_does_not_start_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server.sys, "executable", "false")
    with pytest.raises(SimulationError, match="ended with code 1 before it listened"), server.running():
        pass


def watched(send: Callable[[ServerConnection], Any], use: Callable[[Viewer], Any]) -> Any:
    """Watch a server that sends something to each viewer."""

    async def run() -> Any:
        async with serve(send, "127.0.0.1", 0) as running:
            port = next(iter(running.sockets)).getsockname()[1]
            session: Any = SimpleNamespace(id="1")
            async with watching(f"http://127.0.0.1:{port}", session) as viewer:
                return await use(viewer)

    return asyncio.run(run())


def frame(time: float, *, steered: bool = False) -> bytes:
    positions = np.zeros((1, 2), np.float32)
    return encode(Frame(number=1, time=time, solver_ms=0.0, steered=steered, positions=positions))


def test_a_viewer_records_when_frames_come() -> None:
    async def send(stream: ServerConnection) -> None:
        await stream.recv()
        await stream.send('{"type":"hello"}')
        for index in range(3):
            await stream.send(frame(0.01 * index, steered=index == 2))
            await asyncio.sleep(0.02)
        await stream.wait_closed()

    async def use(viewer: Viewer) -> None:
        steered = viewer.expect(lambda one: one.steered)
        await viewer.send("play")
        assert await viewer.arrival(steered) > 0
        assert len(viewer.intervals()) == 2
        assert viewer.time_scale() == pytest.approx(20 / viewer.intervals().sum())
        viewer.forget()
        with pytest.raises(SimulationError, match="fewer than two frames"):
            viewer.intervals()

    watched(send, use)


@pytest.mark.parametrize(
    ("message", "error"),
    [('{"type":"problem","status":422}', "422"), (None, "closed a stream: .*4404")],
)
def test_a_viewer_reports_why_no_frame_comes(message: str | None, error: str) -> None:
    async def send(stream: ServerConnection) -> None:
        if message is None:
            await stream.close(4404)
        else:
            await stream.send(message)
            await stream.wait_closed()

    async def use(viewer: Viewer) -> None:
        with pytest.raises(SimulationError, match=error):
            await viewer.arrival(viewer.expect(lambda _: True))

    watched(send, use)


@pytest.mark.parametrize("status", [200, 500])
def test_a_hostile_upload_has_to_be_refused(monkeypatch: pytest.MonkeyPatch, status: int) -> None:
    created = {"id": "1", "frame": 0}

    def answer(request: httpx.Request) -> httpx.Response:
        made = request.url.path == "/v1/sessions" and b"scenario" in request.content
        return httpx.Response(201, json=created) if made else httpx.Response(status)

    def client(**options: Any) -> httpx.AsyncClient:
        return real(**options, transport=httpx.MockTransport(answer))

    real = httpx.AsyncClient
    monkeypatch.setattr(httpx, "AsyncClient", client)
    monkeypatch.setattr(measurements, "uploads", lambda: uploads()[2:3])
    service: Any = SimpleNamespace(address="http://service")
    with pytest.raises(SimulationError, match=f"answers a hostile upload with {status}"):
        asyncio.run(measurements.hostile_uploads(service))


@pytest.mark.long
def test_the_costs_of_the_door_and_the_sizes_of_sessions(tmp_path: Path) -> None:
    if shutil.which("haproxy", path=f"{os.environ['PATH']}:/usr/sbin") is None:
        pytest.skip("needs HAProxy: apt-get install haproxy")
    figures: Any = run(
        tmp_path / "door.json", "--part", "door", "--part", "sizes", "--calls", "20", "--seconds", "1"
    )
    ways = ("without keys", "with keys", "through HAProxy", "with keys through HAProxy")
    for what in ("GET of a session", "command of a stream to its status"):
        times = [figures[f"{what} {way}, lower quartile", 1, 1] for way in ways]
        assert min(times) > 0
        added = figures[f"{what}, added by keys", 1, 1]
        assert added == pytest.approx(times[1] - times[0], abs=2e-3)
    for scenario in ("water_2d", "water_3d"):
        assert figures[f"particles of a session of {scenario}", 4, 1] > 500
        assert figures[f"memory of a session of {scenario}", 4, 1] > 0
        assert figures[f"load of a session of {scenario} at a quarter of real time", 4, 1] > 0
