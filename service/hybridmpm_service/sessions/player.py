"""Player of a session, which computes the frames that are due at a chosen speed, and the load of all players.

Sessions that play are limited by the measured time of their frames. A paused session takes memory alone.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TypeAlias

from hybridmpm import SimulationError
from hybridmpm_service.errors import MachineFullError, QuotaError, SessionBusyError

Clock = Callable[[], float]
"""Returns the seconds since an arbitrary start; they never go back."""

MAX_LAG_SECONDS = 0.1
"""Longest lag that a player makes up for. It skips the rest, since catching up later looks like a jump."""


@dataclass
class Pace:
    """Conversion of seconds on a clock into due frames, `speed / frame_dt` per second.

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
        """Count due frames from now on, and none from before."""
        self._origin, self._done = now, 0

    def set_speed(self, speed: float, now: float) -> None:
        """Change the speed, without a jump."""
        self.speed = speed
        self.start(now)

    def due(self, now: float) -> int:
        """Return the number of due frames."""
        owed = self._owed(now)
        most = max(1.0, MAX_LAG_SECONDS * self._rate)
        if owed > most:
            self.start(now)
            self._origin -= most / self._rate
            owed = most
        return int(owed)

    def count(self, frames: int) -> None:
        """Note computed frames."""
        self._done += frames

    def wait(self, now: float) -> float:
        """Return the seconds until the next frame is due."""
        return max(0.0, (1.0 - self._owed(now)) / self._rate)

    @property
    def _rate(self) -> float:
        return self.speed / self.frame_dt

    def _owed(self, now: float) -> float:
        # The small excess keeps a frame that is due exactly now from slipping to the next tick.
        return (now - self._origin) * self._rate - self._done + 1e-9


DEFAULT_SPEED = 0.25
"""Simulated seconds per second; the eye can follow a splash at a quarter of real time."""
MIN_SPEED = 0.01
MAX_SPEED = 1.0
_TICK_SECONDS = 1 / 60
"""Shortest time between two ticks: no screen shows more frames."""
_MAX_TURN_SECONDS = 0.025
"""Longest time of a turn of the player on the session's thread."""


class Machine:
    """The cores of the machine, shared by the sessions that play.

    The load of a session is the time of its frames in a second at its speed, at most all of its threads.
    Calls that compute frames without the player are not counted: they end by themselves.

    Parameters
    ----------
    cores : float > 0
        Largest sum of the loads [cores].
    threads : int >= 1
        Threads of each session.

    Attributes
    ----------
    cores : float
    on_turn : callable
        Called after each turn of a player with the number of its frames, and with the time by which it began
        too late [s].
    most : callable
        Returns the largest load of the sessions of a key [cores]; None without a limit.
    """

    def __init__(self, cores: float, threads: int) -> None:
        self.cores, self._threads = cores, threads
        self.on_turn: Callable[[int, float], object] = lambda _frames, _late: None
        self.most: Callable[[str], float | None] = lambda _owner: None
        self._players: set[Player] = set()

    @property
    def load(self) -> float:
        """Load of all sessions that play [cores]."""
        # Copied at once, since sessions may join and leave meanwhile in other threads.
        return sum(player.load for player in list(self._players))

    def join(self, player: "Player") -> None:
        """Count the load of a session from now on."""
        self._players.add(player)

    def leave(self, player: "Player") -> None:
        """Count the load of a session no more."""
        self._players.discard(player)

    def load_of(self, frame_seconds: float, frame_dt: float, speed: float) -> float:
        """Return the load of a session that plays [cores].

        Parameters
        ----------
        frame_seconds : float
            Time of a frame [s].
        frame_dt : float
            Simulated time of a frame [s].
        speed : float
            Simulated seconds per second.
        """
        return self._threads * min(1.0, frame_seconds * speed / frame_dt)

    def full(self) -> MachineFullError | None:
        """Return the refusal of any further load; None if a small one has room."""
        load = self.load
        if load < self.cores:
            return None
        return MachineFullError(
            f"sessions that play take {load:.2f} of {self.cores:g} cores: pause or delete a session, lower "
            "a speed, or try again later"
        )

    def check(self, more: float, who: str, player: "Player | None" = None) -> None:
        """Check that a load fits beside those of the other sessions. A single session always fits.

        Parameters
        ----------
        more : float
            The load [cores].
        who : str
            Source of the load, for the message.
        player : Load, optional
            Player whose present load does not count.

        Raises
        ------
        MachineFullError, QuotaError
            The load does not fit, on the machine or for the key of the player; the message has the load, the
            limit and a remedy.
        """
        if player is not None:
            self._check_quota(more, who, player)
        others = sum(other.load for other in list(self._players) if other is not player)
        if others > 0.0 and others + more > self.cores:
            raise MachineFullError(
                f"sessions that play take {others:.2f} of {self.cores:g} cores, and {who} would take about "
                f"{more:.2f}: pause or delete a session, lower a speed, choose a smaller scene, or try again "
                "later"
            )

    def _check_quota(self, more: float, who: str, player: "Player") -> None:
        most = self.most(player.owner)
        if most is None:
            return
        own = sum(one.load for one in list(self._players) if one.owner == player.owner and one is not player)
        if own + more > most:
            raise QuotaError(
                f"the sessions of the key {player.owner!r} that play take {own:.2f} cores, and {who} would "
                f"take about {more:.2f}, where it may have {most:g}: pause one, or lower a speed"
            )


Compute: TypeAlias = Callable[[int, Callable[[], bool]], Awaitable[int]]
"""Computes frames on the session's thread, as long as the function is true; returns their number."""


class Player:
    """Player of a session, which computes frames between `start` and `stop`. Belongs to the event loop.

    Parameters
    ----------
    frame_dt : float > 0
        Simulated seconds of a frame.
    clock : Clock
        Clock on the wall.
    machine : Machine
        Limits and counts the load of the player.
    frame_seconds : callable
        Returns the time of a frame [s].
    compute : Compute
        It has to stop the player before it raises a SimulationError.
    hurried : callable
        Whether commands wait for the thread; the player then ends its turn after the current frame.
    on_fault : callable
        Called while an unexpected exception is handled; it has to stop the player.
    behind : callable
        Returns the number of frames that a tab is ahead, which are due at once; None where none leads. Called
        in the thread that computes, too.
    owner : str
        Key that the session belongs to.
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
        behind: Callable[[], int | None] = lambda: None,
        owner: str = "",
    ) -> None:
        self.owner = owner
        self._pace = Pace(frame_dt, DEFAULT_SPEED)
        self._clock = clock
        self._machine = machine
        self._frame_seconds = frame_seconds
        self._compute = compute
        self._behind = behind
        self._hurried = hurried
        self._on_fault = on_fault
        self._playing = asyncio.Event()
        machine.join(self)

    @property
    def playing(self) -> bool:
        """Whether the player computes frames."""
        return self._playing.is_set()

    @property
    def speed(self) -> float:
        """Target speed: simulated seconds per second."""
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
            The load at that speed does not fit; the speed is as before.
        """
        if self.playing and speed > self.speed:
            self._machine.check(self.load_at(speed), "this session at that speed", self)
        self._pace.set_speed(speed, self._clock())

    def start(self) -> None:
        """Play from now on.

        Raises
        ------
        MachineFullError
            The load does not fit.
        """
        self._machine.check(self.load_at(self.speed), "this session", self)
        self._pace.start(self._clock())
        self._playing.set()

    def stop(self) -> None:
        """Stop playing after the current frame."""
        self._playing.clear()

    def end(self) -> None:
        """Stop, and leave the machine."""
        self.stop()
        self._machine.leave(self)

    async def run(self) -> None:
        """Play between `start` and `stop`, until this task is cancelled."""
        due_at = 0.0
        while True:
            if not self.playing:
                await self._playing.wait()
                due_at = self._clock()
            began = self._clock()
            next_tick = began + _TICK_SECONDS
            try:
                behind = self._behind()
                computed = await self.take_turn(self._pace.due(began) if behind is None else behind)
                if behind is None:
                    self._pace.count(computed)
                else:
                    # The tab keeps the pace; what it has computed is no debt of the player later.
                    self._pace.start(self._clock())
                if computed:
                    self._machine.on_turn(computed, max(0.0, began - due_at))
            except (SimulationError, SessionBusyError):
                # After the first the player has been stopped; after the second it tries again.
                pass
            except Exception:  # noqa: BLE001 - sent to the viewers; the player must live on
                self._on_fault()
            now = self._clock()
            wait = self._pace.wait(now)
            # Where frames are due already, they were to begin at the tick.
            due_at = max(next_tick, now + wait) if wait else next_tick
            await asyncio.sleep(max(0.0, due_at - now))

    def _is_due(self) -> bool:
        """Return whether another frame is due. A call may have computed meanwhile what a tab was ahead."""
        return self.playing and self._behind() != 0

    async def take_turn(self, frames: int) -> int:
        """Compute frames until a turn's time is over or a command waits; return their number."""
        if frames == 0:
            return 0
        deadline: float | None = None

        def go_on() -> bool:
            nonlocal deadline
            if deadline is None:
                # Counted from the start on the thread, since a player may have to wait for it.
                deadline = self._clock() + _MAX_TURN_SECONDS
                return self._is_due()
            return self._is_due() and self._clock() < deadline and not self._hurried()

        return await self._compute(frames, go_on)
