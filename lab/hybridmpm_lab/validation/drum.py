"""Sand in a drum that turns slowly: the torque of its weight tells the angle at which its surface flows."""

import itertools
import math

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Motion, Sand, Scene, SegmentObstacle, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, recorded
from hybridmpm_lab.validation.column_collapse import angle_for_sand, plane_strain_angle

REPOSE = (16.0, 24.0, 32.0)
"""Angles at which sand slides steadily [degrees]."""
_TOLERANCE = 0.15  # accepted relative error of the angle [-]
_RADIUS, _THICKNESS, _STAVES = 0.3, 0.05, 32  # inner radius and thickness of the drum [m]
_FILL = 0.49  # part of the drum [-]
_TURNING = 0.25  # [rad/s]; w^2 R / g is 0.002
_START, _FRAMES, _EVERY = 2000, 1600, 20  # frames before the mean, those of the mean, and between its parts
# Level sand turns with the drum until it yields, after at most .67 rad: the mean is of 1 rad, from 1.25 on.


def run(repose: tuple[float, ...] = REPOSE, *, resolution: int = 96) -> Result:
    """Turn the drum with sand of each kind at a resolution [cells/m]."""
    checks: list[Check] = []
    curves: list[Curve] = []
    for k, angle in enumerate(repose):
        time, found = _angles(angle, resolution)
        band = (1 - _TOLERANCE) * angle, (1 + _TOLERANCE) * angle
        name = f"sand that slides at {angle:g} degrees, {resolution}^2"
        checks += (
            Check.between(f"{name}: angle [degrees]", float(np.mean(found)), band),
            Check.reported(f"{name}: its standard deviation [degrees]", float(np.std(found))),
        )
        curves += (
            Curve(time, found, f"slides at {angle:g} degrees", k),
            Curve((0, time[-1]), (angle, angle), colour=k, style="--"),
        )
    label = "angle of the centre of mass [degrees]"
    return Result(checks, [Panel("Drum", "time [s]", label, curves, {"ylim": (0, None)})])


def _angles(repose: float, resolution: int) -> tuple[Floats, Floats]:
    """Return times [s] and angles of the line from the axis to the centre of mass [degrees], both (M,).

    They are against the vertical. The line is normal to a straight surface.
    """
    outside, center = _RADIUS + _THICKNESS / 2, (0.5, 0.5)
    turns = [2 * math.pi * k / _STAVES for k in range(_STAVES + 1)]
    corners = [(0.5 + outside * math.cos(turn), 0.5 + outside * math.sin(turn)) for turn in turns]
    motion = Motion(angular_velocity=_TURNING, center=center)
    staves = tuple(
        SegmentObstacle(start=start, end=end, thickness=_THICKNESS, contact="sticky", motion=motion)
        for start, end in itertools.pairwise(corners)
    )
    stuff = Sand(friction_angle=angle_for_sand(plane_strain_angle(repose)))
    sand = Ball(material=stuff, center=center, radius=_RADIUS * math.sqrt(_FILL))
    walls = Walls(lower=(0.05, 0.05), upper=(0.95, 0.95))
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(sand,), obstacles=staves))
    solver.advance(_START)
    time, (x, y) = recorded(solver, _FRAMES // _EVERY, _center, every=_EVERY)
    return time, np.degrees(np.arctan2(np.abs(x), -y))


def _center(solver: MpmSolver) -> tuple[float, ...]:
    """Return the centre of mass from the axis on [m]."""
    return tuple(float(x) for x in solver.positions.mean(axis=0, dtype=np.float64) - 0.5)
