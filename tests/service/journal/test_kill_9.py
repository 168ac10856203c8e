"""The process is killed at any moment; what it had acknowledged is there when it is started again."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

_ARROW = {"strokes": [{"points": [[0.5, 0.5], [0.6, 0.55]], "kind": "arrow"}], "frames": 30}
_RESTART_SECONDS = 30.0
"""Far above what a restart takes."""


@contextmanager
def _server(folder: Path) -> Iterator[tuple[subprocess.Popen[str], httpx.Client]]:
    """Run a server as a process of its own, and kill it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "hybridmpm_service", "--port", "0", "--state-folder", str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"HYBRIDMPM_MAX_LOAD": "64"},
    )
    try:
        assert process.stdout is not None
        found = re.search(r"http://[\d.:]+", process.stdout.readline())
        assert found is not None
        with httpx.Client(base_url=found[0], timeout=WAIT_SECONDS) as client:
            yield process, client
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()


class _Client:
    """Somebody who uses a session until the server dies, and remembers what was acknowledged."""

    def __init__(self, client: httpx.Client, path: str, seed: int) -> None:
        self._client, self._path, self._random = client, path, random.Random(seed)
        self.frame = 0
        self.sketches = 0
        self._thread = threading.Thread(target=self._use)
        self._thread.start()

    def end(self) -> None:
        """Wait until it has noticed that the server is gone."""
        self._thread.join(WAIT_SECONDS)
        assert not self._thread.is_alive()

    def _use(self) -> None:
        stream = f"ws{str(self._client.base_url).removeprefix('http').rstrip('/')}{self._path}/stream"
        with (
            suppress(httpx.HTTPError, WebSocketException, OSError),
            connect(stream, close_timeout=0.1) as hand,
        ):
            while True:
                hand.send(json.dumps(self._push()))
                answer = self._client.post(f"{self._path}/advance", json={"frames": 3})
                self.frame = _body(answer)["frame"]
                if self._random.random() < 0.3:
                    answer = self._client.post(f"{self._path}/sketches", json=_ARROW)
                    self.sketches = _body(answer)["number"]
                if self._random.random() < 0.2:
                    hand.send(json.dumps({"type": "push_end"}))

    def _push(self) -> dict[str, Any]:
        point = [self._random.uniform(0.4, 0.6), 0.4]
        return {"type": "push", "point": point, "velocity": [0.5, 0.2], "radius": 0.1}


def _body(answer: httpx.Response) -> dict[str, Any]:
    assert answer.is_success, answer.text
    body: dict[str, Any] = answer.json()
    return body


def _revived(client: httpx.Client, path: str) -> dict[str, Any]:
    """Return the log of a session of a server that has just been started."""
    end = time.monotonic() + _RESTART_SECONDS
    while (answer := client.get(f"{path}/log")).status_code == 503 and time.monotonic() < end:
        time.sleep(0.01)
    return _body(answer)


@pytest.mark.parametrize(
    "cycles", [2, pytest.param(200, marks=[pytest.mark.long, pytest.mark.timeout(3600)])]
)
def test_what_was_acknowledged_is_there_after_kill_9(tmp_path: Path, cycles: int) -> None:
    path, known, when = None, None, random.Random(7)
    for cycle in range(cycles):
        with _server(tmp_path) as (process, client):
            if path is None:
                path = _body(client.post("/v1/sessions", json={"scene": SMALL_SCENE}))["links"]["self"]
            log = _revived(client, path)
            if known is not None:
                assert log["frame"] >= known.frame
                numbers = [one["number"] for one in log["inputs"] if one["kind"] == "sketch"]
                assert numbers == list(range(1, len(numbers) + 1))
                assert len(numbers) >= known.sketches
            if cycle % 50 == 1:
                # The uninterrupted course of the same inputs ends in the same state.
                again = _body(client.post("/v1/sessions", json={"log": log}))
                assert (again["frame"], again["notice"]) == (log["frame"], None)
                client.delete(again["links"]["self"])
            known = _Client(client, path, cycle)
            time.sleep(when.uniform(0.02, 0.5))
            process.send_signal(signal.SIGKILL)
            known.end()
    with _server(tmp_path) as (_, client):
        assert path is not None
        log = _revived(client, path)
        again = _body(client.post("/v1/sessions", json={"log": log}))
        assert (again["frame"], again["notice"]) == (log["frame"], None)
