"""`ways_file`: what a page follows, as bytes that the WebAssembly module reads, and the lines it draws."""

import struct

import numpy as np

from hybridmpm.control import Shape, Solid
from hybridmpm.control.goal.region import Oval
from hybridmpm.control.guidance import Guidance
from hybridmpm.control.keyframes import Led, Sequence
from hybridmpm.control.laws import Tracked
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver

_OUTLINE = 64
"""Number of points on the outline of an oval."""
Legs = list[tuple[int, Guidance]]
"""Frames since the start at which each goal of a motion was planned, and the guidance to it."""


def legs_of(motion: Led, solver: MpmSolver) -> Legs:
    """Return the guidance to each goal of a motion that the solver is to follow from its present state.

    Several goals in turn are planned as on their way, which a copy of the solver goes first.
    """
    if not isinstance(motion, Sequence):
        return [(0, motion)]
    motion, twin = motion.copied(), solver.copy()
    legs = [(motion.planned_at, motion.guidance.copied())]
    while twin.frame <= motion.first_frame + motion.legs[-1].start:
        force = motion(twin)
        if motion.planned_at != legs[-1][0]:
            legs.append((motion.planned_at, motion.guidance.copied()))
        twin.advance(1, force)
    return legs


def ways_file(legs: Legs, first_frame: int, frames: int) -> bytes:
    """Return the laws of a motion, each after the frames at which it begins, little-endian.

    Parameters
    ----------
    legs : list of (int, Guidance)
        None of them where nothing is to be followed.
    first_frame : int
        Frame at the start of the motion.
    frames : int
        Number of its frames.

    Raises
    ------
    ConfigError
        The force of one of them is not that of particles on ways.
    """
    head = struct.pack("<III", first_frame, frames, len(legs))
    laws = [struct.pack("<I", start) + _bytes(guidance) for start, guidance in legs]
    return head + b"".join(laws)


def _bytes(guidance: Guidance) -> bytes:
    if not isinstance(guidance.law, Tracked):
        raise ConfigError(
            f"a page follows sketches by the method analytic or learned, got {guidance.method!r}: plan with "
            'method="analytic"'
        )
    return guidance.law.ways.to_bytes()


def drawn(guidance: Guidance) -> list[list[list[float]]]:
    """Return the lines of the sketch, each (K, D) [m]: the path of an arrow, or the outlines of others."""
    goal, figure = guidance.goal, guidance.goal.drawn
    lines = [goal.path]
    if isinstance(figure, Oval):
        turn = np.linspace(0, 2 * np.pi, _OUTLINE)
        around = np.stack([np.cos(turn), np.sin(turn)], axis=1) * figure.axes[:2]
        lines = [figure.center + around @ figure.directions[:2]]
    elif isinstance(goal.sketch, Shape | Solid) and figure is not None:
        lines = [
            np.hstack([closed, np.tile(figure.center[2:], (len(closed), 1))])
            for line in goal.sketch.outlines
            for closed in [np.vstack([line, line[:1]])]
        ]
    return [[[float(value) for value in point] for point in line] for line in lines]
