"""The measurements of the service, one after the other, and their sizes."""

import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from hybridmpm.errors import ConfigError
from hybridmpm_lab.harness.rows import Progress, Row

PARTS = ("slow-client", "intervals", "real-time", "sketch", "push", "hostile", "restart")
"""The parts of the benchmark, in their order."""
_CLIENTS = ("httpx", "websockets")
"""Packages of the clients."""


@dataclass(frozen=True, kw_only=True)
class ServiceSettings:
    """Size and length of the measurements."""

    parts: tuple[str, ...] = PARTS
    """Names in `PARTS` of what is measured."""
    sessions: tuple[int, ...] = (1, 4, 16)
    """Numbers of sessions with one viewer each, at most 16."""
    viewers: tuple[int, ...] = (1, 20, 100)
    """Numbers of viewers of one session."""
    kept: int = 8
    """Number of sessions that have to come back after a restart, at most 16."""
    seconds: float = 20.0
    """Length of each measurement of frames [s]."""
    repeats: int = 20
    """Number of sketches and of pushes."""

    @property
    def crowds(self) -> list[tuple[int, int]]:
        """Numbers of sessions and of viewers of each, without repetition."""
        pairs = [(count, 1) for count in self.sessions] + [(1, count) for count in self.viewers]
        return list(dict.fromkeys(pairs))

    @property
    def count(self) -> int:
        """Number of measurements."""
        parts = set(self.parts)
        return len(parts - {"intervals"}) + ("intervals" in parts) * len(self.crowds)


def measure(settings: ServiceSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure a service on this machine, and yield the rows; `on_progress` counts measurements.

    A row has `measure`, `sessions`, `viewers` (of each session), `value`, `unit`, and `aim`: the largest
    value, or for a time scale the least, that the service should reach; None where there is no aim.

    Raises
    ------
    ConfigError
        The service, or a package of its clients, is not installed.
    SimulationError
        The service ends, refuses what it should do, does what it should refuse, or does not answer for a
        minute.
    """
    for name in _CLIENTS:
        if importlib.util.find_spec(name) is None:
            raise ConfigError(f"this benchmark needs {name}: pip install 'hybridmpm[bench]'")
    # An extra has their packages, and the command line imports this module without it.
    from hybridmpm_lab.service import load, reactions  # noqa: PLC0415
    from hybridmpm_lab.service.restart import restart  # noqa: PLC0415
    from hybridmpm_lab.service.server import Server  # noqa: PLC0415

    seconds, repeats = settings.seconds, settings.repeats
    live: list[tuple[str, Callable[[Server], list[Row]]]] = [
        # First, since memory that others have used and left would hide what the slow client holds.
        ("slow-client", lambda server: load.slow_client(server, seconds)),
        *(
            ("intervals", partial(load.frame_intervals, crowd=crowd, seconds=seconds))
            for crowd in settings.crowds
        ),
        ("real-time", lambda server: load.real_time(server, seconds)),
        ("sketch", lambda server: reactions.sketch(server, repeats)),
        ("push", lambda server: reactions.push(server, repeats)),
        ("hostile", reactions.hostile_uploads),
    ]
    chosen = [part for name, part in live if name in settings.parts]
    if chosen:
        with Server() as server:
            for part in chosen:
                yield from part(server)
                on_progress(1)
    if "restart" in settings.parts:
        yield from restart(settings.kept, seconds)
        on_progress(1)
