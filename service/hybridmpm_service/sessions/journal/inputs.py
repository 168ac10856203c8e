"""Inputs: everything that acts on a session from outside, each with the frame that it acts from.

Scene, simulator and inputs determine the state of a session at each frame, to the bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from hybridmpm.control import Arrow, Ellipse, Push, Sketch


@dataclass(frozen=True, kw_only=True)
class SketchInput:
    """A sketch that steers, in the place of one that still does."""

    kind: ClassVar = "sketch"
    frame: int
    """Frame from whose state on it steers."""
    number: int
    """Number of the sketch in its session, counted from 1."""
    drawn_frame: int
    """Frame in whose state it was planned."""
    planned_by: str
    """Name of the method that planned."""
    sketch: Sketch
    settings: Mapping[str, Any]
    """Settings of `hybridmpm.control.prepare`."""

    def record(self) -> dict[str, Any]:
        """Return the input as plain data; `input_of` makes an equal one of it."""
        sketch = {name: _plain(value) for name, value in vars(self.sketch).items() if value is not None}
        return {
            "kind": self.kind,
            "frame": self.frame,
            "number": self.number,
            "drawn_frame": self.drawn_frame,
            "planned_by": self.planned_by,
            "sketch": {"kind": self.sketch.kind} | sketch,
            "settings": dict(self.settings),
        }


@dataclass(frozen=True, kw_only=True)
class ReleaseInput:
    """No sketch steers any more."""

    kind: ClassVar = "release"
    frame: int
    """Frame from whose state on none steers."""

    def record(self) -> dict[str, Any]:
        """Return the input as plain data."""
        return {"kind": self.kind, "frame": self.frame}


@dataclass(frozen=True, kw_only=True)
class PushInput:
    """A hand that pushes the fluid, in the place of one that did, or lets go of it."""

    kind: ClassVar = "push"
    frame: int
    """Frame from whose state on it pushes."""
    push: Push | None
    """None lets go."""

    def record(self) -> dict[str, Any]:
        """Return the input as plain data."""
        return {"kind": self.kind, "frame": self.frame, "push": push_record(self.push)}


Input: TypeAlias = SketchInput | ReleaseInput | PushInput


def input_of(record: Mapping[str, Any]) -> Input:
    """Return the input of a record.

    Raises
    ------
    SketchError
        The sketch is out of range.
    KeyError, TypeError, ValueError
        It is no record.
    """
    kind, frame = record["kind"], record["frame"]
    if kind == ReleaseInput.kind:
        return ReleaseInput(frame=frame)
    if kind == PushInput.kind:
        return PushInput(frame=frame, push=push_of(record["push"]))
    if kind != SketchInput.kind:
        raise ValueError(f"there is no input {kind!r}")
    return SketchInput(
        frame=frame,
        number=record["number"],
        drawn_frame=record["drawn_frame"],
        planned_by=record["planned_by"],
        sketch=_sketch_of(record["sketch"]),
        settings=record["settings"],
    )


def push_record(push: Push | None) -> dict[str, Any] | None:
    """Return a push as plain data; None where there is none."""
    return None if push is None else {name: _plain(value) for name, value in vars(push).items()}


def push_of(record: Mapping[str, Any] | None) -> Push | None:
    """Return the push of a record of `push_record`."""
    if record is None:
        return None
    vectors = {name: np.array(record[name], dtype=np.float64) for name in ("point", "velocity")}
    return Push(**vectors, radius=record["radius"], cap=record["cap"])


def _sketch_of(record: Mapping[str, Any]) -> Sketch:
    fields = {name: value for name, value in record.items() if name != "kind"}
    return Arrow(**fields) if record["kind"] == Arrow.kind else Ellipse(**fields)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value
