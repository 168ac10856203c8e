"""What all viewers of a session get is made once."""

import asyncio

from hybridmpm_service.sessions.viewers.audience import Audience
from hybridmpm_service.sessions.viewers.mailbox import Signal


def test_a_posted_frame_and_status_are_the_same_for_all() -> None:
    async def scene() -> None:
        audience, made = Audience(), iter(["first", "second"])
        mailboxes = [audience.join() for _ in range(100)]
        frame = b"frame"
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
