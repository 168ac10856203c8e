"""A stiff block on an inclined plane, for every kind of contact.

On a plane inclined by theta, with Coulomb's coefficient mu, a block that starts at rest has moved by

    x = g t^2 / 2 (sin(theta) - mu cos(theta))    if tan(theta) > mu, else not at all.

Walls and obstacles are different code, so the plane is once a wall of the box, with tilted gravity, and once
a half-space obstacle across the grid, with upright gravity.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridmpm._support.charts import COLOURS, MARKERS, panels
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Elastic, HalfSpaceObstacle, Polygon, Scene, Walls
from hybridmpm.scene.obstacles import Contact
from hybridmpm_lab.validation.case import Case, Check, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_ERROR = {"wall": 1e-3, "obstacle": 1e-2}
"""Largest relative error of the path, by kind of plane [-].

Where the block has to stay, the error is divided by the path of a block without friction.
"""


@dataclass(frozen=True)
class ContactSetting:
    """One kind of contact, with the angles of plane and friction."""

    label: str
    contact: Contact
    angle: float
    """Angle theta of the plane [degrees]."""
    friction_angle: float = 0.0
    """Friction angle atan(mu) of separating contact [degrees]."""

    @property
    def acceleration(self) -> float:
        """Acceleration of a rigid block down the plane [m/s^2]."""
        if self.contact == "sticky":
            return 0.0
        mu, theta = np.tan(np.radians(self.friction_angle)), np.radians(self.angle)
        return float(max(0.0, _G * (np.sin(theta) - mu * np.cos(theta))))

    @property
    def free_acceleration(self) -> float:
        """Acceleration of a rigid block without friction down the plane [m/s^2]."""
        return float(_G * np.sin(np.radians(self.angle)))


SETTINGS = (
    ContactSetting("separating, sliding", "separating", 24.0, 15.0),
    ContactSetting("separating, held", "separating", 10.0, 15.0),
    ContactSetting("separating, no friction", "separating", 24.0),
    ContactSetting("slip", "slip", 24.0),
    ContactSetting("sticky", "sticky", 24.0),
)

_G = 9.81
_SIDE = 0.125
_ROOM = 0.7
"""Length of path [m] at which a run ends, by the closed form."""
_LONGEST = 1.0
"""Time at which a run ends at the latest [s]."""
_STIFF = Elastic(youngs_modulus=1e8)
"""Material of the block. A block sticks at first, until elastic waves have reached its bottom; in a stiff
block this takes less time."""


@dataclass(frozen=True, kw_only=True)
class Slide:
    """The path of one block; arrays (F,) have an entry for each frame."""

    plane: str
    """Kind of plane, a key of `MAX_ERROR`."""
    resolution: int
    setting: ContactSetting
    time: Floats
    """Time [s]."""
    path: Floats
    """Path of the centroid down the plane [m]."""

    @property
    def exact(self) -> Floats:
        """Path of a rigid block down the plane [m]."""
        return np.asarray(self.setting.acceleration * self.time**2 / 2)

    @property
    def acceleration(self) -> float:
        """Acceleration of the centroid [m/s^2], fitted by a parabola to the second half of the run."""
        late = self.time >= self.time[-1] / 2
        return float(2 * np.polyfit(self.time[late], self.path[late], 2)[0])

    @property
    def error(self) -> float:
        """Error of the path at the end, relative to the exact path or, if that is 0, to a free block's."""
        scale = self.setting.acceleration or self.setting.free_acceleration
        return float((self.path[-1] - self.exact[-1]) / (scale * self.time[-1] ** 2 / 2))


@dataclass(frozen=True, kw_only=True)
class SlidingBlockResult:
    """Paths in all settings on both kinds of plane."""

    slides: tuple[Slide, ...]

    @property
    def checks(self) -> tuple[Check, ...]:
        """Relative error of each path, and of the acceleration where a block slides with friction."""
        paths = (
            Check.at_most(
                f"{slide.plane}, {slide.setting.label}, {slide.resolution}^2",
                slide.error,
                MAX_ERROR[slide.plane],
            )
            for slide in self.slides
        )
        accelerations = (
            Check.reported(
                f"{slide.plane}, acceleration in the second half, {slide.resolution}^2",
                slide.acceleration / slide.setting.acceleration - 1,
                "0",
            )
            for slide in self.slides
            if slide.setting is SETTINGS[0]
        )
        return (*paths, *accelerations)


def run(resolutions: tuple[int, ...] = (32, 64)) -> SlidingBlockResult:
    """Let go a block in every setting and on both kinds of plane, at each resolution [cells/m]."""
    slides = []
    for resolution in resolutions:
        for setting in SETTINGS:
            slides.append(_slide("wall", setting, _on_wall(setting, resolution), np.array([1.0, 0.0])))
            theta = np.radians(setting.angle)
            down = np.array([np.cos(theta), -np.sin(theta)])
            slides.append(_slide("obstacle", setting, _on_obstacle(setting, down, resolution), down))
    return SlidingBlockResult(slides=tuple(slides))


def _slide(plane: str, setting: ContactSetting, scene: Scene, down: Floats) -> Slide:
    longest = np.sqrt(2 * _ROOM / setting.acceleration) if setting.acceleration else np.inf
    frames = int(min(longest, _LONGEST) / scene.frame_dt)
    centroid = MpmSolver(scene).rollout(frames).mean(axis=1, dtype=np.float64)
    return Slide(
        plane=plane,
        resolution=scene.resolution,
        setting=setting,
        time=np.arange(frames + 1, dtype=np.float64) * scene.frame_dt,
        path=(centroid - centroid[0]) @ down,
    )


def _on_wall(setting: ContactSetting, resolution: int) -> Scene:
    low, theta = 0.03125, np.radians(setting.angle)
    walls = Walls(
        lower=(low, low), upper=(1 - low, 1 - low), contact=setting.contact, friction=_friction(setting)
    )
    # The block stands away from the left wall, since with slip or sticky contact this would hold it, too.
    block = Box(material=_STIFF, lower=(0.125, low), upper=(0.125 + _SIDE, low + _SIDE))
    gravity = (float(_G * np.sin(theta)), float(-_G * np.cos(theta)))
    return Scene(dim=2, resolution=resolution, gravity=gravity, walls=walls, bodies=(block,))


def _on_obstacle(setting: ContactSetting, down: Floats, resolution: int) -> Scene:
    up = np.array([-down[1], down[0]])
    foot = np.array([0.1, 0.75])
    corners = [foot, foot + _SIDE * down, foot + _SIDE * (down + up), foot + _SIDE * up]
    plane = HalfSpaceObstacle(
        point=(float(foot[0]), float(foot[1])),
        normal=(float(up[0]), float(up[1])),
        contact=setting.contact,
        friction=_friction(setting),
    )
    block = Polygon(material=_STIFF, vertices=tuple((float(x), float(y)) for x, y in corners))
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))
    return Scene(dim=2, resolution=resolution, walls=walls, bodies=(block,), obstacles=(plane,))


def _friction(setting: ContactSetting) -> float | None:
    separating = setting.contact == "separating"
    return float(np.tan(np.radians(setting.friction_angle))) if separating else None


def draw(result: SlidingBlockResult) -> "Figure":
    """Draw paths as points on the lines of the closed form, in a panel for each kind of plane."""
    figure, (row,) = panels(2)
    for axes, plane in zip(row, MAX_ERROR, strict=True):
        coarse = result.slides[0].resolution
        shown = [slide for slide in result.slides if (slide.plane, slide.resolution) == (plane, coarse)]
        for k, slide in enumerate(shown):
            axes.plot(slide.time, slide.exact, color="black", linewidth=0.8)
            style = {"color": COLOURS[k], "marker": MARKERS[k], "linestyle": "none", "markersize": 4.5}
            every = (4 * k, 24)
            axes.plot(slide.time, slide.path, markevery=every, label=slide.setting.label, **style)
        axes.set(
            title=f"On a {plane}" if plane == "wall" else f"On an {plane}",
            xlabel="time [s]",
            ylabel="path [m]",
        )
    figure.legend(*row[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


CASE = Case(
    name="sliding_block",
    title="Sliding block",
    text=(
        "A stiff elastic block (E = 100 MPa, 0.125 m) is let go on a plane inclined by 24 degrees, or by "
        "10 where it has to be held; friction angle 15 degrees. A rigid block moves by g t² (sin θ - mu "
        "cos θ) / 2, without friction where contact is slip, not at all where it is sticky or θ is below "
        "the friction angle. The plane is once a wall with tilted gravity, once a half-space across the "
        "grid. Judged is the path at the end, relative to the closed form, or to a free block's path "
        "where the block has to stay. What remains arises as the block is let go: while waves run through "
        "it, it presses on the plane in jolts that find nothing moving to rub against, and keeps a little "
        "too much speed ever after (7 mm/s on the half-space at 64², where its ragged bottom meets the "
        "grid's staircase of nodes). The acceleration later on is that of the closed form. On the wall "
        "the error falls as 1 / sqrt(E)."
    ),
    run=run,
    draw=draw,
)
