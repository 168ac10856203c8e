"""Rigid bodies: how deep they float, and how they right themselves, slide, roll, tip, stand and bounce."""

import math
from collections.abc import Sequence

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.probes import Submerged
from hybridmpm.scene import (
    Box,
    HalfSpaceObstacle,
    RigidBall,
    RigidBody,
    RigidBox,
    RigidCylinder,
    RigidHull,
    Scene,
    Walls,
)
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result

DENSITIES = (300.0, 500.0, 800.0)
"""Densities of the boxes that float in 2D [kg/m^3]."""
PLACES = (("block", 0.1), ("block", 0.4), ("block", 0.65), ("ball", 0.4), ("lying cylinder", 0.65))
"""Bodies that float in 3D, and the shifts of all of their scene [cells]."""
_G, _RESOLUTION, _WATER = 9.81, 64, 1000.0
_LAW = 0.02  # accepted relative error of each law [-]
_TILT, _UPRIGHT = (
    0.9,
    3.0,
)  # of the box that rights itself at the start [rad], and accepted at the end [degrees]
_MOVED = 2e-4  # accepted motion of a body of a stack [m]
_GAIN = 1e-3  # accepted gain of energy, of that at the start [-]
_SLOPE = math.radians(20)


def run(
    densities: Sequence[float] = DENSITIES,
    seconds: tuple[float, float, float] = (6.0, 2.5, 10.0),
    places: Sequence[tuple[str, float]] = PLACES,
) -> Result:
    """Run all; `seconds` are the lengths of the runs that float in 2D, in 3D, and of the stacks."""
    shares, panel = _floating(densities, seconds[0])
    checks = [*shares, *(_floating_in_space(seconds[1], *place) for place in places)]
    if seconds[0] >= 6.0:
        righted, angles = _righting(seconds[0])
        checks.append(righted)
    for dim in (2, 3):
        checks += [_sliding(dim), *_rolling(dim), *_tipping(dim), _standing(dim, seconds[2]), _heap(dim)]
    return Result(checks, [panel, angles] if seconds[0] >= 6.0 else [panel])


def _floating(densities: Sequence[float], seconds: float) -> tuple[list[Check], Panel]:
    """Let boxes float, each a little above its place at first."""
    checks, found = [], []
    for density in densities:
        lower = 0.5 - density / _WATER * 0.2
        box = RigidBox(lower=(0.35, lower), upper=(0.65, lower + 0.2), density=density)
        found.append(_share(_pool(box), seconds))
        error = found[-1] / (density / _WATER) - 1
        checks.append(Check.at_most(f"2D, {density:g} kg/m³: submerged share, relative error", error, _LAW))
    ratios = np.array(densities) / _WATER
    curves = [Curve((0, 1), (0, 1), "Archimedes"), Curve(ratios, found, f"{_RESOLUTION} cells/m", 0, "o")]
    return checks, Panel("Floating", "ratio of the densities", "submerged share", curves)


def _floating_in_space(seconds: float, name: str, place: float) -> Check:
    """Let a body float in a pool in 3D, all of it moved by a part of a cell."""
    shift = place / _RESOLUTION
    middle = 0.21 + shift
    bodies: dict[str, RigidBody] = {
        "block": RigidBox(lower=(0.1 + shift, 0.095, 0.1 + shift), upper=(0.32 + shift, 0.295, 0.32 + shift)),
        "ball": RigidBall(center=(middle, 0.195, middle), radius=0.09),
        "lying cylinder": RigidCylinder(
            start=(middle, 0.195, 0.12 + shift), end=(middle, 0.195, 0.3 + shift), radius=0.08
        ),
    }
    walls = Walls(lower=(shift, 0.0, shift), upper=(0.42 + shift, 0.5, 0.42 + shift))
    water = Box(material="water", lower=walls.lower, upper=(walls.upper[0], 0.1875, walls.upper[2]))
    scene = Scene(dim=3, resolution=_RESOLUTION, walls=walls, bodies=[water], rigid=[bodies[name]])
    error = _share(scene, seconds) / 0.5 - 1
    title = f"3D, {name} of 500 kg/m³, {place:g} cells off the nodes: submerged share, relative error"
    return Check.at_most(title, error, _LAW)


def _pool(*rigid: RigidBody) -> Scene:
    water = Box(material="water", lower=(0.1, 0.1), upper=(0.9, 0.5))
    return Scene(dim=2, resolution=_RESOLUTION, bodies=[water], rigid=rigid)


def _share(scene: Scene, seconds: float) -> float:
    """Return the mean submerged share in the second half of a run."""
    solver, probe = MpmSolver(scene), Submerged(0)
    steps = round(seconds / scene.frame_dt / 20)
    read = []
    for step in range(steps):
        solver.advance(20)
        if step >= steps // 2:
            read.append(float(probe.read(solver)))
    return float(np.mean(read))


def _righting(seconds: float) -> tuple[Check, Panel]:
    """Let a flat box fall on its edge; it floats flat in the end."""
    box = RigidBox(lower=(0.35, 0.5), upper=(0.65, 0.62), density=400.0, rotation=_TILT)
    solver = MpmSolver(_pool(box))
    angles = [math.degrees(_TILT)]
    for _ in range(round(seconds / solver.scene.frame_dt / 20)):
        solver.advance(20)
        angles.append(math.degrees(solver.rigid_bodies.rotation[0]))
    time = np.linspace(0, seconds, len(angles))
    check = Check.at_most(f"box of 0.3 x 0.12 m: angle after {seconds:g} s [degrees]", angles[-1], _UPRIGHT)
    curves = [Curve(time, angles, f"{_RESOLUTION} cells/m", 0)]
    return check, Panel("Righting", "time [s]", "angle [degrees]", curves)


def _dry(dim: int, *rigid: RigidBody, slope: float = 0.0) -> Scene:
    """Return rigid bodies on a plane through the middle that falls along x, with a little sand far off."""
    normal = (math.sin(slope), math.cos(slope), 0.0)[:dim]
    corner = (0.95,) * dim
    drop = Box(material="sand", lower=corner, upper=(1.0,) * dim)
    plane = HalfSpaceObstacle(point=(0.5,) * dim, normal=normal)
    walls = Walls(lower=(0.0,) * dim, upper=(1.0,) * dim)
    return Scene(dim=dim, resolution=20, walls=walls, bodies=[drop], obstacles=[plane], rigid=rigid)


def _above(dim: int, x: float, height: float, slope: float) -> Floats:
    """Return the point at a height over the plane, whose foot has this x."""
    normal = np.array([math.sin(slope), math.cos(slope), 0.0])[:dim]
    foot = np.array([x, 0.5 - (x - 0.5) * math.tan(slope), 0.5])[:dim]
    return foot + height * normal


def _turned(dim: int, angle: float) -> float | tuple[float, float, float]:
    return -angle if dim == 2 else (0.0, 0.0, -angle)


def _block(dim: int, x: float, half: Sequence[float], slope: float, friction: float) -> RigidBox:
    place, sides = _above(dim, x, half[1], slope), np.array(half[:dim])
    lower, upper = tuple((place - sides).tolist()), tuple((place + sides).tolist())
    return RigidBox(lower=lower, upper=upper, rotation=_turned(dim, slope), friction=friction)


def _path(scene: Scene, seconds: float) -> float:
    """Return the way of the first body [m]."""
    solver = MpmSolver(scene)
    start = solver.rigid_bodies.center[0]
    solver.advance(round(seconds / scene.frame_dt))
    return float(np.linalg.norm(solver.rigid_bodies.center[0] - start))


def _sliding(dim: int) -> Check:
    friction, seconds = 0.2, 0.4
    path = _path(_dry(dim, _block(dim, 0.25, (0.05,) * 3, _SLOPE, friction), slope=_SLOPE), seconds)
    exact = 0.5 * _G * (math.sin(_SLOPE) - friction * math.cos(_SLOPE)) * seconds**2
    return Check.at_most(f"{dim}D, a box slides down 20°: way, relative error", path / exact - 1, _LAW)


def _rolling(dim: int) -> list[Check]:
    seconds, radius = 0.4, 0.05
    place = _above(dim, 0.25, radius, _SLOPE)
    ball = RigidBall(center=tuple(place.tolist()), radius=radius, friction=0.5)
    bodies: list[tuple[str, RigidBody, float]] = [
        ("disc" if dim == 2 else "ball", ball, 0.5 if dim == 2 else 0.4)
    ]
    if dim == 3:
        ends = [(*place[:2].tolist(), 0.5 + side) for side in (-0.1, 0.1)]
        bodies.append(
            ("cylinder", RigidCylinder(start=ends[0], end=ends[1], radius=radius, friction=0.5), 0.5)
        )
    checks = []
    for name, body, inertia in bodies:
        exact = 0.5 * _G * math.sin(_SLOPE) / (1 + inertia) * seconds**2
        error = _path(_dry(dim, body, slope=_SLOPE), seconds) / exact - 1
        checks.append(Check.at_most(f"{dim}D, a {name} rolls down 20°: way, relative error", error, _LAW))
    return checks


def _tipping(dim: int) -> list[Check]:
    """Put a box on slopes around that of its diagonal, on which it begins to tip."""
    half = (0.03, 0.06, 0.03)
    critical = math.atan(half[0] / half[1])
    turned = []
    for factor in (1 - _LAW, 1 + _LAW):
        slope = critical * factor
        solver = MpmSolver(_dry(dim, _block(dim, 0.4, half, slope, 1.0), slope=slope))
        start = solver.rigid_numbers()[0, 3:7]
        solver.advance(800)
        turned.append(2 * math.acos(min(1.0, abs(float(start @ solver.rigid_numbers()[0, 3:7])))))
    name = f"{dim}D, a box on {{}} of the slope of its diagonal for 2 s: turn [rad]"
    return [
        Check.at_most(name.format(1 - _LAW), turned[0], 0.01),
        Check.between(name.format(1 + _LAW), turned[1], (0.5, math.pi)),
    ]


def _standing(dim: int, seconds: float) -> Check:
    """Let five boxes stand on each other, each beside the one below by 2 mm."""
    half = 0.04
    boxes = []
    for level in range(5):
        middle = np.array([0.5 + 0.002 * (level % 2), 0.5 + half * (2 * level + 1), 0.5])[:dim]
        lower, upper = tuple((middle - half).tolist()), tuple((middle + half).tolist())
        boxes.append(RigidBox(lower=lower, upper=upper))
    solver = MpmSolver(_dry(dim, *boxes))
    start = solver.rigid_bodies.center
    solver.advance(round(seconds / solver.scene.frame_dt))
    moved = float(np.linalg.norm(solver.rigid_bodies.center - start, axis=1).max())
    return Check.at_most(f"{dim}D, five boxes stand for {seconds:g} s: largest motion [m]", moved, _MOVED)


def _heap(dim: int) -> Check:
    """Let bodies of all shapes fall on a heap and bounce; the energy never is above its lowest so far."""
    rng = np.random.default_rng(5)
    bodies: list[RigidBody] = []
    for number in range(9):
        place = np.array([0.3 + 0.2 * (number % 3), 0.6 + 0.14 * (number // 3), 0.5])[:dim]
        turn = rng.uniform(-1, 1, 3).tolist()
        look = {"rotation": turn[0] if dim == 2 else tuple(turn), "restitution": 0.5, "friction": 0.3}
        if number % 3 == 0:
            half = np.array([0.05, 0.03, 0.04])[:dim]
            corners = {"lower": tuple((place - half).tolist()), "upper": tuple((place + half).tolist())}
            bodies.append(RigidBox(**corners, **look))
        elif number % 3 == 1:
            bodies.append(RigidBall(center=tuple(place.tolist()), radius=0.045, **look))
        else:
            points = place + rng.uniform(-0.05, 0.05, (8, dim))
            bodies.append(RigidHull(points=tuple(map(tuple, points.tolist())), **look))
    solver = MpmSolver(_dry(dim, *bodies))
    lowest = start = sum(solver.rigid_energy)
    gain = 0.0
    for _ in range(600):
        solver.advance(1)
        energy = sum(solver.rigid_energy)
        gain, lowest = max(gain, energy - lowest), min(lowest, energy)
    return Check.at_most(
        f"{dim}D, nine bodies fall: largest gain of energy, of that at the start", gain / start, _GAIN
    )
