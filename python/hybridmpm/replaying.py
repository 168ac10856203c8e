"""Runs of the service computed again from their logs: scene, simulator and all inputs, with the same bits."""

import base64
import binascii
import gzip
import json
import warnings
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm import simulators
from hybridmpm._core import SOLVER_VERSION
from hybridmpm.control import Keyframe, Led, Pull, Push, Sketch, plan_motion
from hybridmpm.control.guidance import sketch_from_dict
from hybridmpm.errors import DataError, ReplayWarning
from hybridmpm.force import total_force
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator

_LINK = "#replay="
_FIELDS = ("format", "scene", "solver", "frame", "inputs", "digest")


def replay(log: str | Path | Mapping[str, Any], frame: int | None = None, *, threads: int = 1) -> Simulator:
    """Compute a run again from its log, with what acted on it: sketches and pushes, each in its frame.

    Parameters
    ----------
    log : str, Path or mapping
        The file of a run, as the page saves it; a link of the page with `#replay=`; or the log itself, as
        `GET /v1/sessions/{id}/log` answers it.
    frame : int, optional
        Frame to stop at, at most the log's last one, which is the default.
    threads : int in [1, 1024]
        The result does not depend on it.

    Returns
    -------
    Simulator
        At that frame. What steers there acts no longer in frames that are advanced afterwards.

    Warns
    -----
    ReplayWarning
        The state at the log's end is not the one that the log ends with.

    Raises
    ------
    DataError
        The log cannot be read, or `frame` is beyond its end.
    SceneError, ConfigError, SketchError, SimulationError
        The scene, the simulator or a sketch is refused, or a frame fails.
    """
    run = Run(log, threads=threads)
    last = run.last if frame is None else frame
    if not 0 <= last <= run.last:
        raise DataError(f"frame must be in [0, {run.last}], where the log ends; got {last}")
    run.advance(last)
    return run.simulator


@dataclass
class Leading:
    """Sketches of a run that were followed."""

    first: int
    """Frame from whose state on they led."""
    last: int
    """Frame with whose state they had ended."""
    sketches: list[Sketch]


class Run:
    """A simulator with the inputs of a log, which act in their frames.

    Parameters, warnings and errors are those of `replay`.
    """

    def __init__(self, log: str | Path | Mapping[str, Any], *, threads: int = 1) -> None:
        given = _read(log)
        self._given, self._inputs = given, given["inputs"]
        self.last: int = given["frame"]
        """Frame at which the log ends."""
        self.simulator: Simulator = simulators.make(
            given["solver"],
            Scene.parse(given["scene"]),
            threads=threads,
            **{name: given.get(name) for name in ("coarse", "model", "r_c")},
        )
        """The simulator, which only `advance` may advance."""
        self._plans: dict[int, Led] = {}
        self._guidance: Led | None = None
        self._done = self._place = 0
        self._hand: Push | Pull | None = None
        self.led: list[Leading] = []
        """What led up to the present frame, in its order."""

    def advance(self, last: int) -> None:
        """Advance to a frame; what acts from it on is left out."""
        try:
            for now in range(self.simulator.frame, last):
                self._frame(now)
        except (KeyError, TypeError, IndexError) as err:
            raise DataError(f"an input of the log is malformed ({type(err).__name__}: {err})") from err
        if last == self.last and self.simulator.digest() != self._given["digest"]:
            made_by = self._given.get("versions", {}).get("solver")
            reason = (
                f"version {made_by} of the solver made it, this is version {SOLVER_VERSION}"
                if made_by != SOLVER_VERSION
                else "it was changed, or made where arithmetic differs"
            )
            warnings.warn(
                f"the state is not the one that the log ends with: {reason}", ReplayWarning, stacklevel=3
            )

    def _frame(self, now: int) -> None:
        for number, sketch in self._drawn_at(now):
            settings = sketch["settings"]
            self._plans[number] = plan_motion(self.simulator.copy(), _goals(sketch), **settings)
        while self._place < len(self._inputs) and self._inputs[self._place]["frame"] == now:
            self._act(self._place)
            self._place += 1
        self.simulator.advance(1, self._force())
        if self._guidance is not None:
            self._done += 1
            if self._done >= self._guidance.total_frames:
                self._guidance = None

    def _drawn_at(self, frame: int) -> Iterator[tuple[int, dict[str, Any]]]:
        """Return the sketches that were planned for the state of a frame, with their places."""
        for number, one in enumerate(self._inputs):
            if one["kind"] == "sketch" and one["drawn_frame"] == frame:
                yield number, one

    def _act(self, place: int) -> None:
        one = self._inputs[place]
        if one["kind"] == "push":
            hand = one["push"]
            self._hand = hand and Push(
                np.array(hand["point"]), np.array(hand["velocity"]), hand["radius"], hand["cap"]
            )
        elif one["kind"] == "pull":
            hand = one["pull"]
            grip, target = np.array(hand["grip"]), np.array(hand["target"])
            self._hand = Pull(hand["body"], grip, target, hand["reach"], hand["strength"])
        else:
            self._guidance = self._plans[place] if one["kind"] == "sketch" else None
            self._done = 0
            if self.led:
                self.led[-1].last = min(self.led[-1].last, one["frame"])
            if self._guidance is not None:
                goals = _goals(one)
                sketches = [goal.goal for goal in goals] if isinstance(goals, list) else [goals]
                self.led.append(Leading(one["frame"], one["frame"] + self._guidance.total_frames, sketches))

    def _force(self) -> Any:
        """Return the force of sketch and hand in the next frame."""
        acting = [] if self._guidance is None else [self._guidance.law.force(self.simulator, self._done)]
        if self._hand is not None:
            acting.append(self._hand(self.simulator))
        acting = [force for force in acting if force is not None]
        if len(acting) < 2:
            return acting[0] if acting else None
        return total_force(acting, self.simulator.ids, self.simulator.dim)


def _goals(record: Mapping[str, Any]) -> Sketch | list[Keyframe]:
    """Return the sketch of an input, or its keyframes."""
    keyframes = record.get("keyframes")
    if keyframes is None:
        return sketch_from_dict(record["sketch"])
    return [
        Keyframe(sketch_from_dict(one["sketch"]), one["frames"], one["hold"], one["who"]) for one in keyframes
    ]


def _read(log: str | Path | Mapping[str, Any]) -> dict[str, Any]:
    """Return a log, with all fields that are needed."""
    if isinstance(log, Mapping):
        value: Any = dict(log)
    elif isinstance(log, str) and _LINK in log:
        value = _unpacked(log.partition(_LINK)[2])
    else:
        try:
            value = json.loads(Path(log).read_text(encoding="utf-8"))
        except OSError as err:
            raise DataError(f"{log} cannot be read: {err.strerror}") from None
        except ValueError as err:
            raise DataError(f"{log} is no log: {err}") from None
    missing = [name for name in _FIELDS if name not in value] if isinstance(value, dict) else _FIELDS
    if missing:
        raise DataError(f"this is no log of a run: {', '.join(missing)} is missing")
    if value["format"] != 1:
        raise DataError(f"the log has the format {value['format']}, this version reads 1")
    return dict(value)


def _unpacked(text: str) -> Any:
    try:
        packed = base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
        return json.loads(gzip.decompress(packed))
    except (binascii.Error, OSError, EOFError, zlib.error, ValueError) as err:
        raise DataError(f"the link is damaged, a part of it is missing or changed: {err}") from None
