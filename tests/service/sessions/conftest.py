"""Managers of sessions without a server, on a clock that tests turn."""

import threading
from collections.abc import AsyncIterator, Callable, Iterator

import pytest

from hybridmpm_service import Settings
from hybridmpm_service.sessions.manager import SessionManager

Manage = Callable[..., SessionManager]


class Clock:
    """A clock that stands still until a test sets it."""

    now = 0.0

    def __call__(self) -> float:
        """Return the time [s]."""
        return self.now


@pytest.fixture
def clock() -> Clock:
    """Return the clock of the managers of a test."""
    return Clock()


@pytest.fixture
def _threads_end() -> Iterator[None]:
    before = threading.active_count()
    yield
    assert threading.active_count() <= before


@pytest.fixture
async def manage(_threads_end: None, clock: Clock) -> AsyncIterator[Manage]:
    """Return a function that makes a manager with some settings; it is closed whatever happens."""
    made: list[SessionManager] = []

    def make(**settings: object) -> SessionManager:
        made.append(SessionManager(Settings(**settings), clock))
        return made[-1]

    yield make
    for manager in made:
        await manager.close()


@pytest.fixture
async def manager(manage: Manage) -> SessionManager:
    """Return a manager with the default settings."""
    return manage()
