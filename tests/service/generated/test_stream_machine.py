"""Any order of commands, viewers and calls: the session is where a simple model of it says."""

import contextlib
import itertools
import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from tests.service.conftest import WAIT_SECONDS

from hybridmpm.stream_frames import decode

CLOSE_DELETED = 4404
MOST_VIEWERS = 3
NONSENSE = (
    "",
    "{",
    "[]",
    "null",
    '{"type": "dance"}',
    '{"type": "step", "frames": 0}',
    '{"type": "step", "frames": 1e9}',
    '{"type": "step", "frames": true}',
    '{"type": "speed", "value": "0.5"}',
    '{"type": "speed", "value": NaN}',
    '{"type": "push", "point": [0.5], "velocity": [1, 0], "radius": 0.1}',
    '{"type": "push", "point": [0.5, 0.5], "velocity": [1, 0], "radius": 0}',
    '{"type": "play", "loudly": true}',
    "[" * 500,
)
_SPEEDS = itertools.cycle([round(0.01 + 0.0005 * index, 4) for index in range(1900)])

viewers = st.integers(0, MOST_VIEWERS - 1)
counts = st.integers(1, 4)


class SessionMachine(RuleBasedStateMachine):
    """A session with some viewers, and what has to be true of it."""

    service: Any

    @initialize()
    def begin(self) -> None:
        self.path = self.service.create()
        self.frame: int | None = 0
        self.playing = False
        self.streams: list[tuple[contextlib.ExitStack, Any]] = []

    def teardown(self) -> None:
        for stack, _ in self.streams:
            stack.close()
        self.service.http.delete(self.path)

    def _info(self) -> dict[str, Any]:
        answer = self.service.http.get(self.path)
        assert answer.status_code == 200, answer.text
        return answer.json()  # type: ignore[no-any-return]

    def _do(self, index: int, **command: Any) -> None:
        """Send a command, and wait until the session has obeyed it: commands of a stream keep their order."""
        stream = self.streams[index % len(self.streams)][1]
        stream.send(**command)
        self._settle(stream)

    def _settle(self, stream: Any) -> None:
        marker = next(_SPEEDS)
        stream.send(type="speed", value=marker)
        stream.status(speed=marker)

    def _note_rest(self) -> None:
        """Take the frame at which a player has stopped; a turn that runs is ended by then."""
        self.playing = False
        self.frame = self.service.http.post(f"{self.path}/advance", json={"frames": 1}).json()["frame"]

    @precondition(lambda self: len(self.streams) < MOST_VIEWERS)
    @rule(version=st.sampled_from(["1", "2"]))
    def join(self, version: str) -> None:
        stack = contextlib.ExitStack()
        stream = stack.enter_context(self.service.stream(self.path, version))
        self.streams.append((stack, stream))
        hello = stream.receive()
        assert (hello["type"], hello["version"]) == ("hello", int(version))
        number = decode(stream.frame()).number
        assert self.playing or number == self.frame

    @precondition(lambda self: self.streams)
    @rule(index=viewers)
    def leave(self, index: int) -> None:
        stack, _ = self.streams.pop(index % len(self.streams))
        stack.close()
        if not self.streams and self.playing:
            deadline = time.monotonic() + WAIT_SECONDS
            while self._info()["playing"]:
                assert time.monotonic() < deadline
            self._note_rest()

    @precondition(lambda self: self.streams)
    @rule(index=viewers)
    def play(self, index: int) -> None:
        self._do(index, type="play")
        self.playing, self.frame = True, None

    @precondition(lambda self: self.streams)
    @rule(index=viewers)
    def pause(self, index: int) -> None:
        self._do(index, type="pause")
        if self.playing:
            self._note_rest()

    @precondition(lambda self: self.streams)
    @rule(index=viewers, frames=counts)
    def step(self, index: int, frames: int) -> None:
        if self.playing:
            self.pause(index)
        assert self.frame is not None
        self._do(index, type="step", frames=frames)
        self.frame += frames

    @precondition(lambda self: self.streams)
    @rule(index=viewers)
    def reset(self, index: int) -> None:
        self._do(index, type="reset")
        if not self.playing:
            self.frame = 0

    @precondition(lambda self: self.streams)
    @rule(index=viewers, ends=st.booleans())
    def push(self, index: int, ends: bool) -> None:  # noqa: FBT001 - hypothesis draws it
        if ends:
            self._do(index, type="push_end")
        else:
            self._do(index, type="push", point=[0.5, 0.5], velocity=[1.0, 0.5], radius=0.1)

    @precondition(lambda self: self.streams)
    @rule(index=viewers, text=st.sampled_from(NONSENSE) | st.text(max_size=20))
    def talk_nonsense(self, index: int, text: str) -> None:
        stream = self.streams[index % len(self.streams)][1]
        stream.connection.send(text)
        assert 400 <= stream.text("problem")["status"] < 500
        self._settle(stream)

    @rule(frames=counts)
    def advance(self, frames: int) -> None:
        answer = self.service.http.post(f"{self.path}/advance", json={"frames": frames})
        assert answer.status_code == 200
        if self.frame is not None:
            self.frame += frames
            assert answer.json()["frame"] == self.frame

    @rule()
    def delete(self) -> None:
        assert self.service.http.delete(self.path).status_code == 204
        for stack, stream in self.streams:
            assert stream.end() == CLOSE_DELETED
            stack.close()
        self.begin()

    @invariant()
    def the_session_is_where_the_model_says(self) -> None:
        if hasattr(self, "path"):
            info = self._info()
            assert info["playing"] == self.playing
            assert self.frame is None or info["frame"] == self.frame


@pytest.fixture(scope="module")
def machine(start_module: Callable[..., Any]) -> type[SessionMachine]:
    return type("Machine", (SessionMachine,), {"service": start_module()})


_QUIET = settings(deadline=None, suppress_health_check=list(HealthCheck))


def test_a_few_stories(machine: type[SessionMachine]) -> None:
    few = settings(_QUIET, max_examples=8, stateful_step_count=12, derandomize=True)
    run_state_machine_as_test(machine, settings=few)


@pytest.mark.long
def test_many_stories(machine: type[SessionMachine]) -> None:
    run_state_machine_as_test(machine, settings=settings(_QUIET, max_examples=300, stateful_step_count=50))
