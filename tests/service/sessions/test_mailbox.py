"""A mailbox keeps what is new and never makes anyone wait."""

import asyncio

import pytest

from hybridmpm_service.sessions.viewers.mailbox import MAX_PROBLEMS, Mailbox, MailboxClosed, Signal


def test_only_the_newest_frame_waits() -> None:
    async def scene() -> list[object]:
        box = Mailbox()
        for number in range(1000):
            box.put_frame(str(number).encode())
            box.put_status()
        return [await box.take(), await box.take()]

    assert asyncio.run(scene()) == [Signal.STATUS, b"999"]


def test_problems_come_first_and_all_but_not_without_end() -> None:
    async def scene() -> list[object]:
        box = Mailbox()
        box.put_frame(b"frame")
        for number in range(MAX_PROBLEMS + 5):
            box.put_problem(ValueError(number))
        return [await box.take() for _ in range(MAX_PROBLEMS + 1)]

    *problems, last = asyncio.run(scene())
    assert [str(problem) for problem in problems] == [str(number) for number in range(5, MAX_PROBLEMS + 5)]
    assert last == b"frame"


def test_taking_waits_for_the_next_message() -> None:
    async def scene() -> object:
        box = Mailbox()
        taking = asyncio.create_task(box.take())
        await asyncio.sleep(0)
        assert not taking.done()
        box.put_frame(b"later")
        return await taking

    assert asyncio.run(scene()) == b"later"


def test_closing_ends_the_stream_once_with_its_code() -> None:
    async def scene() -> MailboxClosed:
        box = Mailbox()
        box.put_frame(b"frame")
        box.close(4404, "deleted")
        box.close(1001, "too late")
        with pytest.raises(MailboxClosed, match="deleted"):
            await box.take()
        return await box.closed()

    assert asyncio.run(scene()).code == 4404
