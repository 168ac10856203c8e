"""Sand in a drum that turns slowly: its surface flows at the angle at which sand slides steadily."""

import math

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Motion, Sand, Scene, SegmentObstacle, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result

ANGLES = (25.0, 35.0)
"""Friction angles [degrees]."""
_TOLERANCE = 0.15  # accepted relative error of the slope [-]
_RADIUS, _THICKNESS, _SIDES = 0.3, 0.05, 32  # inner radius and thickness of the drum [m], its staves
_TURNING = 0.5  # [rad/s]; w^2 R / g is 0.008, so the surface is straight
_START, _FRAMES = 240, 240  # frames before the mean slope is taken, and those of the mean
_BINS = np.linspace(-0.5, 0.5, 13) * _RADIUS  # columns whose highest particles are the surface [m]


def run(resolutions: tuple[int, ...] = (64, 96, 128)) -> Result:
    """Turn the drum at each resolution [cells/m] with sand of each friction angle."""
    checks, curves = [], []
    for k, angle in enumerate(ANGLES):
        exact = math.degrees(math.atan(math.sin(math.radians(angle))))
        for resolution in resolutions:
            slope, surface = _surface(angle, resolution)
            name = f"friction angle {angle:g}, {resolution}^2: slope over arctan(sin phi), less 1"
            checks.append(Check.at_most(name, slope / exact - 1, _TOLERANCE))
            checks.append(Check.reported(f"friction angle {angle:g}, {resolution}^2: slope [degrees]", slope, f"{exact:.1f}"))
        middle = (_BINS[1:] + _BINS[:-1]) / 2
        curves.append(Curve(middle, surface, f"phi = {angle:g} degrees, {resolution}^2", k, "o"))
        height = float(surface.mean())
        curves.append(Curve(middle, height + middle * math.tan(math.radians(exact)), colour=k))
    label = "height over the axis [m]"
    return Result(checks, [Panel("Drum", "place beside the axis [m]", label, curves, {"aspect": "equal"})])


def _surface(angle: float, resolution: int) -> tuple[float, Floats]:
    """Return the mean slope [degrees] and the mean heights of the surface over the axis, (12,) [m]."""
    center = (0.5, 0.5)
    outside = _RADIUS + _THICKNESS / 2
    corners = [
        (0.5 + outside * math.cos(turn), 0.5 + outside * math.sin(turn))
        for turn in (2 * math.pi * k / _SIDES for k in range(_SIDES + 1))
    ]
    motion = Motion(angular_velocity=_TURNING, center=center)
    staves = tuple(
        SegmentObstacle(start=start, end=end, thickness=_THICKNESS, contact="sticky", motion=motion)
        for start, end in zip(corners[:-1], corners[1:], strict=True)
    )
    sand = Ball(material=Sand(friction_angle=angle), center=(0.5, 0.5), radius=_RADIUS * 0.65)
    walls = Walls(lower=(0.05, 0.05), upper=(0.95, 0.95))
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(sand,), obstacles=staves))
    solver.advance(_START)
    heights = np.zeros(len(_BINS) - 1)
    for _ in range(_FRAMES):
        solver.advance(1)
        x, y = solver.positions.T.astype(np.float64) - 0.5
        of_bin = np.digitize(x, _BINS) - 1
        inside = (of_bin >= 0) & (of_bin < len(heights))
        tops = np.full(len(heights), -np.inf)
        np.maximum.at(tops, of_bin[inside], y[inside])
        heights += tops / _FRAMES
    slope = np.polyfit((_BINS[1:] + _BINS[:-1]) / 2, heights, 1)[0]
    return math.degrees(math.atan(abs(float(slope)))), heights
