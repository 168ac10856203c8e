"""What all viewers of a session get is made once."""

import asyncio

import numpy as np

from hybridmpm.stream_frames import Frame, FrameMessage
from hybridmpm_service.sessions.viewers import Audience, Signal


def _message(number: int) -> FrameMessage:
    positions = np.zeros((1, 2), np.float32)
    return FrameMessage(Frame(number=number, time=0.0, solver_ms=1.0, steered=False, positions=positions))


def test_a_posted_frame_and_status_are_the_same_for_all() -> None:
    async def scene() -> None:
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

    asyncio.run(scene())


def test_who_leaves_gets_nothing_any_more() -> None:
    async def scene() -> None:
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

    asyncio.run(scene())
