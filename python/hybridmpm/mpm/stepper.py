"""`MpmStepper`: frames of the compiled solver and of the particles shown with it."""

import math
import struct
from collections.abc import Callable
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.coarse import Upsampler
from hybridmpm.coarse.upsampler import refuse_other_upsampler
from hybridmpm.errors import FrameCancelledError, SimulationError, SnapshotError

_PREFIX = struct.Struct("<8sQ")
"""Magic, length of the solver's state."""
_MAGIC = b"HMPMBOTH"

_Floats = npt.NDArray[np.float32]


class MpmStepper:
    """Advances the compiled solver by frames, and the particles shown with it.

    Parameters
    ----------
    solver : _core.Solver
    upsampler : Upsampler or None
        Upsampler to the particles shown, if any.
    safe : callable, optional
        Makes a solver of the same scene at frame 0 that takes shorter substeps. A frame that fails is then
        done again by that one, from the same state.
    speed_warning : float
        Root mean square of the particles' speeds [m/s] above which `too_fast` is set.
    """

    def __init__(
        self,
        solver: _core.Solver,
        upsampler: Upsampler | None,
        safe: Callable[[], _core.Solver] | None = None,
        speed_warning: float = math.inf,
    ) -> None:
        self.solver, self.upsampler = solver, upsampler
        self._make_safe = safe
        self._safe: _core.Solver | None = None
        self._redone: dict[int, _core.FrameReport | None] = {}
        self._last: tuple[int, _core.FrameReport | None] | None = None
        """Number of a frame and its report, which the solver does not have after a restore."""
        self._pulls: list[tuple[int, dict[str, Any]]] = []
        """Latest pulls at rigid bodies, each with the frame before the one in which it acts."""
        self.keeps_forces = False
        """Whether the forces on walls and obstacles are summed."""
        self._speed_warning = speed_warning
        self.too_fast: float | None = None
        """Root mean square of the speeds [m/s] when it first exceeded `speed_warning`; None until then."""

    @property
    def redone(self) -> tuple[int, ...]:
        """Numbers of the frames, ascending, that were done again with shorter substeps."""
        return tuple(sorted(self._redone))

    @property
    def last(self) -> _core.FrameReport | None:
        """Substeps of the latest frame; None before the first."""
        frame, report = self.solver.frame, self.solver.last_frame
        if report is None and self._last is not None and self._last[0] == frame:
            report = self._last[1]
        return self._redone.get(frame, report)

    def keep_forces(self) -> None:
        """Sum the forces on walls and obstacles in all later frames."""
        self.keeps_forces = True
        for solver in (self.solver, self._safe):
            if solver is not None:
                solver.keep_forces()

    def pull(self, **pull: Any) -> None:
        """Pull at a rigid body in the next frame; the arguments are those of `_core.Solver.pull`."""
        self.solver.pull(**pull)
        self._pulls = [one for one in self._pulls if one[0] == self.solver.frame] + [
            (self.solver.frame, pull)
        ]

    def advance(self, frames: int, force: _Floats | None) -> None:
        """Advance by frames under one acceleration, (D,) or of those simulated (n, D) [m/s^2], or without."""
        if self.upsampler is None:
            self._advance_solver(frames, force)
            return
        last = self.solver.frame + frames
        while self.solver.frame < last:
            self._advance_solver(min(self.upsampler.frames_to_update(), last - self.solver.frame), force)
            self.upsampler.update()

    def _advance_solver(self, frames: int, force: _Floats | None) -> None:
        last = self.solver.frame + frames
        while self.solver.frame < last:
            try:
                self.solver.advance(last - self.solver.frame, force)
                self._watch_speed()
            except FrameCancelledError:
                raise
            except SimulationError:
                if self._make_safe is None:
                    raise
                self._redo(self._make_safe, force)

    def _watch_speed(self) -> None:
        report = self.solver.last_frame
        if self.too_fast is None and report is not None and report.max_speed > self._speed_warning:
            totals = self.solver.diagnostics()
            speed = math.sqrt(2 * totals.kinetic_energy / totals.mass) if totals.mass else 0.0
            self.too_fast = speed if speed > self._speed_warning else None

    def _redo(self, make: Callable[[], _core.Solver], force: _Floats | None) -> None:
        """Repeat the frame that has just failed; where it fails again, nothing has changed."""
        if self._safe is None:
            self._safe = make()
            if self.keeps_forces:
                self._safe.keep_forces()
        self._safe.restore(self.solver.snapshot())
        for frame, pull in self._pulls:
            if frame == self.solver.frame:
                self._safe.pull(**pull)
        self._safe.advance(1, force)
        self.solver.restore(self._safe.snapshot())
        self._redone[self.solver.frame] = self._safe.last_frame

    def snapshot(self) -> bytes:
        """Return the solver's state, joined by the upsampler's if there is one; each has its own checksum."""
        state = self.solver.snapshot()
        if self.upsampler is None:
            return state
        return _PREFIX.pack(_MAGIC, len(state)) + state + self.upsampler.snapshot()

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene, or change nothing and raise `SnapshotError`."""
        state, shown = _parted(data)
        refuse_other_upsampler(saved=shown is not None, here=self.upsampler is not None)
        before = self.solver.snapshot()
        self.solver.restore(state)
        if self.upsampler is not None and shown is not None:
            try:
                self.upsampler.restore(shown)
            except SnapshotError:
                self.solver.restore(before)
                raise
        self._redone = {frame: report for frame, report in self._redone.items() if frame <= self.solver.frame}

    def start(self) -> bytes:
        """Return settings and state for a page that plays."""
        upsampler = None if self.upsampler is None else self.upsampler.native
        return self.solver.start(upsampler, redoes=self._make_safe is not None)

    def notes(self) -> dict[str, Any]:
        """Return what a snapshot leaves out, which `take_notes` takes."""
        return {
            "redone": self._redone,
            "last": (self.solver.frame, self.last),
            "too_fast": self.too_fast,
            "keeps_forces": self.keeps_forces,
        }

    def take_notes(self, notes: dict[str, Any]) -> None:
        """Take what `notes` has returned in the same state."""
        self._redone, self._last, self.too_fast = notes["redone"], notes["last"], notes["too_fast"]
        if notes["keeps_forces"]:
            self.keep_forces()

    def copy(self) -> Self:
        """Return an independent stepper in the same state."""
        solver = self.solver.copy()
        upsampler = None if self.upsampler is None else self.upsampler.copy(solver)
        twin = type(self)(solver, upsampler, self._make_safe, self._speed_warning)
        twin._redone = dict(self._redone)  # noqa: SLF001 - of this very class
        twin.too_fast, twin._last = self.too_fast, self._last  # noqa: SLF001 - of this very class
        twin.keeps_forces = self.keeps_forces  # which the compiled copy does as well
        return twin


def _parted(data: bytes) -> tuple[bytes, bytes | None]:
    """Return the state of the solver, and that of the upsampler if there is one."""
    if not isinstance(data, bytes | bytearray | memoryview):
        raise SnapshotError(f"snapshot refused: it must be bytes, got {type(data).__name__}")
    data = bytes(data)
    if not data.startswith(_MAGIC):
        return data, None
    if len(data) < _PREFIX.size:
        raise SnapshotError("snapshot refused: it is cut off after a few bytes")
    _, length = _PREFIX.unpack_from(data)
    end = _PREFIX.size + length
    if end > len(data):
        raise SnapshotError("snapshot refused: it is cut off within the state of the solver")
    return data[_PREFIX.size : end], data[end:]
