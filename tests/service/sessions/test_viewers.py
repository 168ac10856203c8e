"""Mailboxes keep the newest messages and never wait; messages to all viewers are made once."""

import asyncio

import numpy as np
import pytest

from hybridmpm.stream_frames import Frame, FrameMessage
from hybridmpm_service.sessions.viewers import MAX_PROBLEMS, Audience, Mailbox, MailboxClosed, Signal

pytestmark = pytest.mark.anyio


def _message(number: int) -> FrameMessage:
    positions = np.zeros((1, 2), np.float32)
    return FrameMessage(Frame(number=number, time=0.0, solver_ms=1.0, steered=False, positions=positions))


async def test_only_the_newest_frame_waits() -> None:
    frames, box = [_message(number) for number in range(100)], Mailbox()
    for frame in frames:
        box.put_frame(frame)
        box.put_status()
    assert [await box.take(), await box.take()] == [Signal.STATUS, frames[-1]]


async def test_problems_come_first_and_all_but_not_without_end() -> None:
    frame, box = _message(0), Mailbox()
    box.put_frame(frame)
    for number in range(MAX_PROBLEMS + 5):
        box.put_problem(ValueError(number))
    *problems, last = [await box.take() for _ in range(MAX_PROBLEMS + 1)]
    assert [str(problem) for problem in problems] == [str(number) for number in range(5, MAX_PROBLEMS + 5)]
    assert last is frame


async def test_taking_waits_for_the_next_message() -> None:
    later, box = _message(0), Mailbox()
    taking = asyncio.create_task(box.take())
    await asyncio.sleep(0)
    assert not taking.done()
    box.put_frame(later)
    assert await taking is later


async def test_closing_ends_the_stream_once_with_its_code() -> None:
    box = Mailbox()
    box.put_frame(_message(0))
    box.close(4404, "deleted")
    box.close(1001, "too late")
    with pytest.raises(MailboxClosed, match="deleted"):
        await box.take()
    assert (await box.closed()).code == 4404


async def test_a_posted_frame_and_status_are_the_same_for_all() -> None:
    audience, made = Audience(), iter(["first", "second"])
    mailboxes = [audience.join() for _ in range(100)]
    frame = _message(1)
    audience.post_status()
    audience.post_frame(frame)
    for mailbox in mailboxes:
        assert await mailbox.take() is Signal.STATUS
        assert audience.status(lambda: next(made)) == "first"
        assert await mailbox.take() is frame
    audience.post_status()
    assert audience.status(lambda: next(made)) == "second"


async def test_a_viewer_that_left_gets_no_messages() -> None:
    audience = Audience()
    gone, there = audience.join(), audience.join()
    audience.leave(gone)
    assert audience
    audience.close(1001, "the end")
    assert (await there.closed()).code == 1001
    waiting = asyncio.ensure_future(gone.closed())
    await asyncio.sleep(0)
    assert not waiting.done()
    waiting.cancel()
    audience.leave(there)
    assert not audience
