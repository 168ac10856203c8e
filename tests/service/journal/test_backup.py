"""A state folder that is copied while the service runs, and restored elsewhere."""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.service.conftest import WAIT_SECONDS, Service


@pytest.mark.long
def test_a_copy_of_a_running_service_restores_each_session_with_its_bits(
    start: Callable[..., Service], tmp_path: Path
) -> None:
    state, copy = tmp_path / "state", tmp_path / "copy"
    service = start(state_folder=str(state))
    playing, resting, gone = (service.create() for _ in range(3))
    seen = service.http.post(f"{resting}/advance", json={"frames": 7}).json()["frame"]
    service.http.delete(gone)
    with service.stream(playing) as stream:
        stream.send(type="push", point=[0.5, 0.5], velocity=[1.0, 0.5], radius=0.2)
        stream.send(type="play")
        stream.reach(5)
        shown = service.http.get(f"{playing}/particles").json()["frame"]
        done = subprocess.run(
            [sys.executable, "-m", "hybridmpm_service.sessions.backup", str(state), str(copy)],
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout == "2 sessions copied\n"
        stream.reach(shown + 20)
    restored = start(state_folder=str(copy))
    deadline = time.monotonic() + WAIT_SECONDS
    while {503} & {restored.http.get(path).status_code for path in (playing, resting)}:
        assert time.monotonic() < deadline
    log = restored.http.get(f"{playing}/log").json()
    # What a client has seen is there, and what came after the copy is not.
    assert shown <= log["frame"]
    assert len(log["inputs"]) >= 1
    assert restored.http.get(playing).json()["notice"] is None
    again = service.http.post("/v1/sessions", json={"log": log}).json()
    assert again["notice"] is None, "the same bits as an uninterrupted run"
    logs = [one.http.get(f"{resting}/log").json() for one in (service, restored)]
    assert logs[0] == logs[1]
    assert logs[1]["frame"] == seen
