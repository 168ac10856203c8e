"""Player of a session: it computes the frames that are due at a chosen speed."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TypeAlias

from hybridmpm import SimulationError
from hybridmpm_service.errors import SessionBusyError
from hybridmpm_service.sessions.admission import Machine

Clock = Callable[[], float]
"""Returns the seconds since an arbitrary start; they never go back."""

MAX_LAG_SECONDS = 0.1
"""Longest time that a player makes up for. It forgets the rest, since catching up later looks like a jump."""


@dataclass
class Pace:
    """Turns seconds on a clock into frames, `speed / frame_dt` of them per second.

    Parameters
    ----------
    frame_dt : float > 0
        Simulated seconds of a frame.
    speed : float > 0
        Simulated seconds per second.
    """

    frame_dt: float
    speed: float
    _origin: float = 0.0
    _done: int = 0

    def start(self, now: float) -> None:
        """Owe frames from now on, and none from before."""
        self._origin, self._done = now, 0

    def set_speed(self, speed: float, now: float) -> None:
        """Go on at another speed, without a jump."""
        self.speed = speed
        self.start(now)

    def due(self, now: float) -> int:
        """Return how many frames are owed now."""
        owed = self._owed(now)
        most = max(1.0, MAX_LAG_SECONDS * self._rate)
        if owed > most:
            self.start(now)
            self._origin -= most / self._rate
            owed = most
        return int(owed)

    def count(self, frames: int) -> None:
        """Note that so many frames have been computed."""
        self._done += frames

    def wait(self, now: float) -> float:
        """Return the seconds until the next frame is due."""
        return max(0.0, (1.0 - self._owed(now)) / self._rate)

    @property
    def _rate(self) -> float:
        return self.speed / self.frame_dt

    def _owed(self, now: float) -> float:
        # The small excess keeps a frame that is due exactly now from slipping to the next look.
        return (now - self._origin) * self._rate - self._done + 1e-9


DEFAULT_SPEED = 0.25
"""Simulated seconds per second: the eye can follow a splash at a quarter of real time."""
MIN_SPEED = 0.01
MAX_SPEED = 1.0
_TICK_SECONDS = 1 / 60
"""Shortest time between two looks at what is due: no screen shows more frames."""
_MAX_TURN_SECONDS = 0.025
"""Longest time for which the player keeps the thread."""

Compute: TypeAlias = Callable[[int, Callable[[], bool]], Awaitable[int]]
"""Computes frames on the session's thread, as long as the function is true; answers how many it computed."""


class Player:
    """Computes frames by itself between `start` and `stop`. Belongs to the event loop.

    Parameters
    ----------
    frame_dt : float > 0
        Simulated seconds of a frame.
    clock : Clock
        Clock on the wall.
    machine : Machine
        Says whether there is time to play, and counts the load of the player.
    frame_seconds : callable
        Returns about how long a frame takes [s].
    compute : Compute
        Before it raises a SimulationError, it has to stop the player.
    hurried : callable
        Whether commands wait for the thread; the player then gives way after the frame being computed.
    on_fault : callable
        Called while an exception that nobody expected is handled; it has to stop the player.
    """

    def __init__(
        self,
        frame_dt: float,
        clock: Clock,
        *,
        machine: Machine,
        frame_seconds: Callable[[], float],
        compute: Compute,
        hurried: Callable[[], bool],
        on_fault: Callable[[], None],
    ) -> None:
        self._pace = Pace(frame_dt, DEFAULT_SPEED)
        self._clock = clock
        self._machine = machine
        self._frame_seconds = frame_seconds
        self._compute = compute
        self._hurried = hurried
        self._on_fault = on_fault
        self._playing = asyncio.Event()
        machine.join(self)

    @property
    def playing(self) -> bool:
        """Whether frames are computed without being asked for."""
        return self._playing.is_set()

    @property
    def speed(self) -> float:
        """Simulated seconds per second that the player aims at."""
        return self._pace.speed

    @property
    def load(self) -> float:
        """Load on the machine [cores]; 0 while nothing is played."""
        return self.load_at(self.speed) if self.playing else 0.0

    def load_at(self, speed: float) -> float:
        """Return the load on the machine at a speed [cores]."""
        return self._machine.load_of(self._frame_seconds(), self._pace.frame_dt, speed)

    def set_speed(self, speed: float) -> None:
        """Choose simulated seconds per second, in [0.01, 1].

        Raises
        ------
        MachineFullError
            Others leave too little time to play faster; the speed is as before.
        """
        if self.playing and speed > self.speed:
            self._machine.check(self.load_at(speed), "this session at that speed", self)
        self._pace.set_speed(speed, self._clock())

    def start(self) -> None:
        """Play from now on, and owe no frame from before.

        Raises
        ------
        MachineFullError
            Others leave too little time.
        """
        self._machine.check(self.load_at(self.speed), "this session", self)
        self._pace.start(self._clock())
        self._playing.set()

    def stop(self) -> None:
        """Play no more after the frame that is being computed."""
        self._playing.clear()

    def end(self) -> None:
        """Stop, and put no load on the machine any more."""
        self.stop()
        self._machine.leave(self)

    async def run(self) -> None:
        """Play whenever `start` has been called, until this task is cancelled."""
        while True:
            await self._playing.wait()
            next_tick = self._clock() + _TICK_SECONDS
            try:
                self._pace.count(await self.take_turn(self._pace.due(self._clock())))
            except (SimulationError, SessionBusyError):
                # After the first the player has been stopped; after the second it tries again.
                pass
            except Exception:  # noqa: BLE001 - told to the viewers; the player must live on
                self._on_fault()
            now = self._clock()
            await asyncio.sleep(max(0.0, next_tick - now, self._pace.wait(now)))

    async def take_turn(self, frames: int) -> int:
        """Compute some frames, but give way after a while, or to commands; return how many were computed."""
        if frames == 0:
            return 0
        deadline: float | None = None

        def go_on() -> bool:
            nonlocal deadline
            if deadline is None:
                # Counted from when the thread is free: else a player that had to queue would get no frame.
                deadline = self._clock() + _MAX_TURN_SECONDS
                return self.playing
            return self.playing and self._clock() < deadline and not self._hurried()

        return await self._compute(frames, go_on)
