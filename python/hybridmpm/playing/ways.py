"""`ways_file`: the ways of a followed sketch as bytes that the WebAssembly module reads."""

import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.paths import SHORTEST_FRAMES
from hybridmpm.control.goal.region import Oval
from hybridmpm.control.guidance import Guidance
from hybridmpm.control.laws import Settled, Tracked
from hybridmpm.errors import ConfigError

_MAGIC, _VERSION = b"HMWY", 2
_OUTLINE = 64
"""Number of points on the outline of an oval."""


def ways_file(guidance: Guidance) -> bytes:
    """Return ways, particles and settings of the force, little-endian; arrays begin with their length.

    Raises
    ------
    ConfigError
        The force of the guidance is not that of particles on ways.
    """
    law = guidance.law
    if isinstance(law, Settled):
        law = law.moving  # Places stay those of the plan there.
    if not isinstance(law, Tracked):
        raise ConfigError(
            f"a page follows sketches by the method analytic or learned, got {guidance.method!r}: plan with "
            'method="analytic"'
        )
    settings = (len(law.gravity), guidance.first_frame, guidance.total_frames, law.cells)
    unit = law.unit
    size = np.ones(len(law.gravity))  # of the part of the world on which the grid of the force lies [units]
    parts = [
        struct.pack("<4sIIIII", _MAGIC, _VERSION, *settings),
        struct.pack("<df", law.frame_dt, unit),
        np.concatenate([law.gravity / unit, size]).astype("<f4").tobytes(),
        struct.pack("<fff", SHORTEST_FRAMES * law.frame_dt, law.ahead * law.frame_dt, law.cap / unit),
        _array(law.starts, "<u4"),
        _array(law.times, "<f4"),
        _array(law.x / unit, "<f4"),
        _array(law.v / unit, "<f4"),
        _array(law.path, "<u4"),
        _array(law.offset / unit, "<f4"),
        _array(law.weight, "<f4"),
        _array(law.ids, "<u4"),
    ]
    if law.room is None:
        parts.append(_array(np.empty(0), "<u4"))
    else:
        distance = law.room["distance"] / unit
        parts += [
            _array(np.array(distance.shape), "<u4"),
            (np.append(law.room["lower"], law.room["spacing"]) / unit).astype("<f8").tobytes(),
            distance.astype("<f8").tobytes(),
        ]
    return b"".join(parts)


def _array(values: npt.NDArray[Any], kind: str) -> bytes:
    return struct.pack("<I", len(values)) + values.astype(kind).tobytes()


def drawn(guidance: Guidance) -> list[list[list[float]]]:
    """Return the lines of the sketch, each (K, D) [m]: an arrow's path, or outlines of an oval or a shape."""
    goal, figure = guidance.goal, guidance.goal.drawn
    lines = [goal.path]
    if isinstance(figure, Oval):
        turn = np.linspace(0, 2 * np.pi, _OUTLINE)
        around = np.stack([np.cos(turn), np.sin(turn)], axis=1) * figure.axes[:2]
        lines = [figure.center + around @ figure.directions[:2]]
    elif figure is not None:
        depth = np.asarray(figure.depth[:1])
        lines = [
            np.hstack([closed, np.tile(depth, (len(closed), 1))])
            for line in figure.shape.outlines
            for closed in [np.vstack([line, line[:1]])]
        ]
    return [[[float(value) for value in point] for point in line] for line in lines]
