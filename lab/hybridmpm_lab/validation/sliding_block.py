"""A stiff elastic block is let go on a plane, for every kind of contact.

With Coulomb's coefficient mu, a rigid block has moved by x = g t² / 2 (sin(theta) - mu cos(theta)) where
tan(theta) > mu, else not at all. The plane is once a wall with tilted gravity, once a half-space.
"""

from typing import NamedTuple

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Elastic, HalfSpaceObstacle, Polygon, Scene, Walls
from hybridmpm.scene.obstacles import Contact
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, times

_MAX_ERROR = {"wall": 1e-3, "obstacle": 1e-2}  # largest relative error of the path, by kind of plane [-]
_G = 9.81
_SIDE = 0.125
_ROOM = 0.65  # length of path [m] at which a run ends, by the closed form
_LONGEST = 1.0  # time at which a run ends at the latest [s]
_STIFF = Elastic(youngs_modulus=1e8)
"""Material of the block. A block sticks at first, until elastic waves have reached its bottom; in a stiff
block this takes less time."""


class _Setting(NamedTuple):
    """Kind of contact, with the angles of plane and friction [degrees]."""

    label: str
    contact: Contact
    angle: float
    friction_angle: float = 0.0

    @property
    def acceleration(self) -> float:
        """Acceleration of a rigid block down the plane [m/s^2]."""
        if self.contact == "sticky":
            return 0.0
        mu, theta = np.tan(np.radians(self.friction_angle)), np.radians(self.angle)
        return float(max(0.0, _G * (np.sin(theta) - mu * np.cos(theta))))

    @property
    def friction(self) -> float | None:
        """Coulomb's coefficient mu of separating contact [-]."""
        return float(np.tan(np.radians(self.friction_angle))) if self.contact == "separating" else None


_SETTINGS = (
    _Setting("separating, sliding", "separating", 24.0, 15.0),
    _Setting("separating, held", "separating", 10.0, 15.0),
    _Setting("separating, no friction", "separating", 24.0),
    _Setting("slip", "slip", 24.0),
    _Setting("sticky", "sticky", 24.0),
)


def run(resolutions: tuple[int, ...] = (32, 64)) -> Result:
    """Let go a block in every setting and on both kinds of plane, at each resolution [cells/m]."""
    checks, accelerations = [], []
    curves: dict[str, list[Curve]] = {plane: [] for plane in _MAX_ERROR}
    for resolution in resolutions:
        for k, setting in enumerate(_SETTINGS):
            theta = np.radians(setting.angle)
            down = np.array([np.cos(theta), -np.sin(theta)])
            scenes = {
                "wall": (_on_wall(setting, resolution), np.array([1.0, 0.0])),
                "obstacle": (_on_obstacle(setting, down, resolution), down),
            }
            for plane, (scene, along) in scenes.items():
                time, path = _slide(scene, along, setting.acceleration)
                exact = setting.acceleration * time**2 / 2
                scale = setting.acceleration or _G * np.sin(theta)
                error = float((path[-1] - exact[-1]) / (scale * time[-1] ** 2 / 2))
                name = f"{plane}, {setting.label}, {resolution}^2"
                checks.append(Check.at_most(name, error, _MAX_ERROR[plane]))
                if k == 0:
                    late = time >= time[-1] / 2
                    fitted = float(2 * np.polyfit(time[late], path[late], 2)[0])
                    name = f"{plane}, acceleration in the second half, {resolution}^2"
                    accelerations.append(Check.reported(name, fitted / setting.acceleration - 1))
                if resolution == resolutions[0]:
                    points = {"markevery": (4 * k, 24)}
                    curves[plane].append(Curve(time, exact, options={"linewidth": 0.8}))
                    curves[plane].append(Curve(time, path, setting.label, k, "o", points))
    panels = [Panel(f"Plane: {plane}", "time [s]", "path [m]", drawn) for plane, drawn in curves.items()]
    return Result(checks + accelerations, panels)


def _slide(scene: Scene, down: Floats, acceleration: float) -> tuple[Floats, Floats]:
    """Return times [s] and paths of the centroid down the plane [m], both (F,)."""
    longest = np.sqrt(2 * _ROOM / acceleration) if acceleration else np.inf
    frames = int(min(longest, _LONGEST) / scene.frame_dt)
    centroid = MpmSolver(scene).rollout(frames).mean(axis=1, dtype=np.float64)
    return times(scene, frames + 1), (centroid - centroid[0]) @ down


def _on_wall(setting: _Setting, resolution: int) -> Scene:
    low, high, theta = 0.03125, 0.96875, np.radians(setting.angle)
    walls = Walls(lower=(low, low), upper=(high, high), contact=setting.contact, friction=setting.friction)
    # The block stands away from the left wall, since with slip or sticky contact this would hold it, too.
    block = Box(material=_STIFF, lower=(0.125, low), upper=(0.125 + _SIDE, low + _SIDE))
    gravity = (float(_G * np.sin(theta)), float(-_G * np.cos(theta)))
    return Scene(dim=2, resolution=resolution, gravity=gravity, walls=walls, bodies=(block,))


def _on_obstacle(setting: _Setting, down: Floats, resolution: int) -> Scene:
    up, foot = np.array([-down[1], down[0]]), np.array([0.1, 0.75])
    corners = [foot, foot + _SIDE * down, foot + _SIDE * (down + up), foot + _SIDE * up]
    plane = HalfSpaceObstacle(
        point=(float(foot[0]), float(foot[1])),
        normal=(float(up[0]), float(up[1])),
        contact=setting.contact,
        friction=setting.friction,
    )
    block = Polygon(material=_STIFF, vertices=tuple((float(x), float(y)) for x, y in corners))
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))
    return Scene(dim=2, resolution=resolution, walls=walls, bodies=(block,), obstacles=(plane,))
