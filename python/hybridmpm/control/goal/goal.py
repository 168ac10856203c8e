"""`Goal`: the places and paths that a sketch gives to the particles, and the force that they need."""

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.control.goal.bends import STEP, Bends, resampled
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.paths import Paths, arrow_path, cornered
from hybridmpm.control.goal.region import (
    FULL,
    NEAR,
    Figure,
    Fill,
    Oval,
    Region,
    Silhouette,
    gathered,
    region_of,
)
from hybridmpm.control.goal.room import Room
from hybridmpm.control.goal.threads import threaded
from hybridmpm.control.sketch.sketch import Arrow, Shape, Sketch
from hybridmpm.control.sketch.solid import Solid
from hybridmpm.scene import Scene
from hybridmpm.scene.gaps import Gap, narrow_gaps
from hybridmpm.scene.particle_types import SAND

Reason = Literal["wall", "obstacle", "shape", "time", "cap"]


@dataclass(frozen=True)
class Obstruction:
    """Reason for which a goal is out of reach."""

    reason: Reason
    """wall: no room between the walls. obstacle: no path leads there, or only a gap that takes more frames.
    shape: elastic bodies keep theirs. time: the frames are too few for the cap. cap: no number of frames is
    enough."""
    message: str
    """Cause and remedy."""


@dataclass(frozen=True)
class Needs:
    """Force and frames that a sketch needs. Accelerations are in g = 9.81 m/s^2, besides gravity."""

    acceleration: float
    """Largest acceleration on 95 % of the mass, under the least force on its paths."""
    peak: float
    """Largest acceleration that any group of particles needs."""
    rms: float
    """Root mean square of the least force over mass and time; a lower bound of all forces."""
    cap: float
    """Largest acceleration that is allowed."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    suggested_frames: int
    """Smallest number of frames, in steps of 5 from 40 to 400, with an acceleration well below the cap."""
    scale: float
    """Size of the goal over that of the drawn oval or shape: above 1 if it was grown to the fluid's volume,
    below 1 if it was shrunk to it, 1 for an arrow."""
    taken: float
    """Share of the drawn oval or shape that walls and obstacles take; 0 for an arrow."""
    obstructions: tuple[Obstruction, ...]
    """Reasons for which the goal is out of reach; empty where it is within reach."""
    notes: tuple[str, ...]
    """Remarks, e.g. that the way was bent round an obstacle; none of them keeps the goal out of reach."""

    @property
    def reachable(self) -> bool:
        """Whether no obstruction was found."""
        return not self.obstructions

    def __str__(self) -> str:
        need = f"{self.acceleration:.1f} g in {self.frames} frames, of {self.cap:g} g allowed"
        lines = [need, f"at ease in {self.suggested_frames} frames"]
        if self.scale != 1:
            lines.append(
                f"the goal is {'grown' if self.scale > 1 else 'shrunk'} to {self.scale:.2f} times its size"
            )
        if self.taken > 0:
            lines.append(f"walls and obstacles take {100 * self.taken:.0f} % of the goal")
        return "; ".join([*lines, *self.notes, *(obstruction.message for obstruction in self.obstructions)])


_MISFIT = 0.02
"""Share of the particles that may lie in walls or obstacles at the tip before the shape is changed."""
_EASE = 5.0
"""Largest acceleration of suggested frames, whatever the cap [g]."""
_FRAMES = np.arange(40, 401, 5)
"""Numbers of frames that may be suggested."""
_CROWD = 1.6
"""Factor on the frames where groups queue up before a gap. In 16 scenes with gaps of 4 to 11 cm 9 bodies pass
whole with it, 6 without."""
_TOUCHING = 0.002
"""Share of an elastic body that may lie in obstacles at the tip, which turn it."""
_THROUGH = 1.15
"""Largest mean speed of a fluid in a gap, over the width that the grid leaves free [m/s].

Along an arrow it is twice as much beside a wall."""
_PASSED = 0.05
"""Share of a fluid that has to pass a gap, above which the gap counts [-]."""
_SOLID = 0.5
"""Share of elastic mass from which on a body is led round obstacles as a whole only."""
_SETTLING = 90
"""Largest number of frames at the end in which particles are given places of a shape anew."""
_SLOWER = 4
"""Number of velocities, each half of the one before, with which a shape may pass."""
_SHARE = (2, 5)
"""Part of all frames that is for that at most."""
_LEAST_CELLS = 4
"""Cells that a part of a shape is wide at least, so that the fluid can keep to it."""
_TOO_THIN = 0.25
"""Share of a shape that may be thinner than that before it counts as out of reach [-]."""
_NARROW = 0.03
"""Area of narrow gaps of a shape, over that of the shape, from which on they are named [-]."""
_THIN = 2.0
"""Volume of an oval over that of the fluid from which on `fill="shrink"` is suggested."""
_HALVINGS = 7
"""Number of halvings in the search for the part of a way that can be gone."""
_PARTS = 6
"""Parts of the numbers of frames that are tried at once; most searches end in the first or second."""


def ease(cap: float) -> float:
    """Return the acceleration [g] of an easy motion: 5 g, or the middle of the cap and 1 g."""
    return min((1 + cap) / 2, _EASE)


@dataclass(frozen=True, eq=False)
class Goal:
    """Places for N particles and the paths there."""

    sketch: Sketch
    cloud: Cloud
    room: Room
    paths: Paths
    path: Floats
    """Path of the centre of mass (K, D) [m], from its present place."""
    drawn: Figure | None
    """The oval, the shape or the solid as it was drawn; None for an arrow."""
    region: Region | None
    """Region that is filled; None where the fluid keeps its shape."""
    bent: tuple[str, ...] = ()
    """Remarks on what the path was bent for."""

    @property
    def target_displacement(self) -> Floats:
        """Displacement of the centre of mass in the sketch (D,) [m]."""
        return np.asarray(self.path[-1] - self.path[0])

    @property
    def noun(self) -> str:
        """Name of what was drawn, in messages."""
        return "oval" if self.sketch.kind == "ellipse" else self.sketch.kind

    @property
    def is_shaped(self) -> bool:
        """Whether the goal is a shape or a solid."""
        return isinstance(self.drawn, Silhouette | Solid)

    @property
    def leads_around(self) -> bool:
        """Whether particles go around obstacles in groups, each on a way of its own."""
        return self.paths.leads_around

    @property
    def tip_is_free(self) -> bool:
        """Whether the centre of mass ends between the walls and in no obstacle."""
        return bool(self.room.is_free(self.path[-1:]).all())

    @property
    def settles(self) -> bool:
        """Whether particles are given places anew at the end: in shapes and solids, which tear a fluid."""
        return self.is_shaped and self.cloud.elastic <= _SOLID and not self.paths.cut_off.any()

    def moving(self, frames: int) -> int:
        """Return for how many of a number of frames the motion lasts; what is left is for settling."""
        most = _SHARE[0] * frames // _SHARE[1]
        return frames - min(_SETTLING, most) if self.settles else frames

    def moved(self, frames: int) -> Paths:
        """Return the paths of the motion in a number of frames; what settles goes on with its velocity."""
        if not self.settles or self.paths.end is None:
            return self.paths
        settling = (frames - self.moving(frames)) * self.cloud.frame_dt
        return self.paths.shifted(-settling * self.paths.end)

    def carrying(self, velocity: Floats) -> "Goal":
        """Return the goal that is passed with a velocity (D,) [m/s].

        It is less where the filled region would come from beyond the walls, and none among obstacles.
        """
        room, region = self.room, self.region
        for _ in range(0 if room.scene.obstacles else _SLOWER):
            way = _SETTLING * self.cloud.frame_dt * velocity if self.settles else np.zeros(len(velocity))
            if region is None or room.within_walls(region.cells - way).all():
                return dataclasses.replace(self, paths=dataclasses.replace(self.paths, end=velocity))
            velocity = velocity / 2
        return self

    def _in_all(self, moving: int) -> int:
        """Return the smallest number of frames, a multiple of 5 as `moving` is, that leave so many for it."""
        part, whole = _SHARE
        least = 5 * -(-moving * whole // (5 * (whole - part)))
        return min(moving + _SETTLING, least) if self.settles else moving

    @property
    def squeezes(self) -> bool:
        """Whether an arrow leads through gaps that are too narrow for the body as a whole."""
        return self.drawn is None and self.leads_around

    @cached_property
    def gap(self) -> tuple[Gap, float] | None:
        """The gap that takes longest to pass for those who go in groups, and the time it takes [s]."""
        cloud, slowest = self.cloud, None
        depth = cloud.volume ** (1 / 3) if cloud.dim == 3 else 1.0
        for gap in narrow_gaps(self.room.scene) if self.leads_around else ():
            volume = cloud.volume * self.paths.passing(np.array(gap.place), gap.width)
            speed = _THROUGH * (2 if gap.at_wall and self.drawn is None else 1)
            seconds = volume / max(speed * depth * gap.clear(self.room.scene.resolution), 1e-9)
            if volume > _PASSED * cloud.volume and not (slowest and slowest[1] >= seconds):
                slowest = gap, seconds
        return slowest

    def end(self) -> tuple[Floats, Floats | None]:
        """Return mean and spread of the end in the sketch.

        Returns
        -------
        mean : (D,)
            Centre of mass [m].
        root : (2, 2) or None
            Symmetric root of the covariance of the particles in the front view [m]: the semi-axes of an oval
            are two standard deviations. None for an arrow and a shape, which two moments do not describe.
        """
        if not isinstance(self.drawn, Oval) or self.region is None:
            return np.asarray(self.path[-1]), None
        deviations = self._growth(self.drawn, self.region) * self.drawn.axes[:2] / 2
        turn = self.drawn.directions[:2, :2]
        return self.drawn.center, turn.T @ np.diag(deviations) @ turn

    def _growth(self, drawn: Oval, region: Region) -> float:
        """Return the factor by which an oval grows to the fluid's volume; in 3D with the whole depth."""
        if self.cloud.dim == 2:
            return max(1.0, region.scale)
        depth = self.room.upper[2] - self.room.lower[2]
        return max(1.0, float(np.sqrt(self.cloud.volume / (np.pi * drawn.axes[0] * drawn.axes[1] * depth))))

    @property
    def is_torn(self) -> bool:
        """Whether the fluid, to fill the goal evenly, is thinned to less than half of its density."""
        return self.region is not None and self.region.volume > _THIN * self.cloud.volume

    def inside(self, x: Floats) -> npt.NDArray[np.bool_] | None:
        """Return which points (N, D) lie in the goal; (N,), None where the fluid keeps its shape.

        The goal is the free part of the drawn oval or shape, grown where it is smaller than the fluid.
        """
        if self.region is None:
            return None
        largest = self.region.scale if self.drawn is None else max(1.0, self.region.scale)
        return self.region.reaches(x, largest)

    def inside_drawn(self, x: Floats) -> npt.NDArray[np.bool_] | None:
        """Return which points (N, D) lie in what was drawn; (N,), None for an arrow.

        What is drawn is the front view, so in 3D the depth does not count, but for a solid.
        """
        return None if self.drawn is None else self.drawn.covers_drawn(x)

    def suggested_frames(self, cap: float) -> int:
        """Return the smallest number of frames that needs an acceleration well below the cap [g].

        The limit is 5 g, or the middle between 1 g, which balances gravity, and the cap.
        """
        frames = 100
        # Slowed paths need slightly more than paths that are timed anew.
        for _ in range(2):
            frames = self._fewest_frames(ease(cap), frames) or int(_FRAMES[-1])
        if self.squeezes:
            frames = min(5 * round(_CROWD * frames / 5), int(_FRAMES[-1]))
        if self.gap is not None:
            frames = max(frames, min(self._frames_through(self.gap[1]), int(_FRAMES[-1])))
        return self._in_all(frames)

    def _frames_through(self, seconds: float) -> int:
        return 5 * int(np.ceil(seconds / self.cloud.frame_dt / 5 - 1e-9))

    def _fewest_frames(self, acceleration: float, known: int) -> int | None:
        """Return the smallest number of frames that needs at most an acceleration [g]; None if there is none.

        It is exact near `known` frames, and everywhere if all paths are straight.
        """
        motion = self.paths.timed(known * self.cloud.frame_dt)
        for frames in np.array_split(_FRAMES, _PARTS):
            enough = motion.slowed(frames / known, self.cloud.gravity) <= acceleration
            if enough.any():
                return int(frames[np.argmax(enough)])
        return None

    def needs(self, frames: int | None, cap: float) -> Needs:
        """Return the needs of the goal in a number of frames, the suggested one if None, under a cap [g]."""
        suggested = self.suggested_frames(cap)
        frames = suggested if frames is None else frames
        seconds = self.moving(frames) * self.cloud.frame_dt
        effort = self.moved(frames).timed(seconds).effort(self.cloud.gravity)
        obstructions = [*self._closed_in(), *self._choked(frames)]
        if effort.acceleration > cap:
            obstructions.append(self._too_weak(frames, effort.acceleration, cap))
        return Needs(
            acceleration=effort.acceleration,
            peak=effort.peak,
            rms=effort.rms,
            cap=cap,
            frames=frames,
            suggested_frames=suggested,
            scale=self.region.scale if self.region is not None and self.drawn is not None else 1.0,
            taken=0.0 if self.drawn is None else 1 - float(self.room.is_free(self.drawn.sample()).mean()),
            obstructions=tuple(obstructions),
            notes=(*self.bent, *self._remarks()),
        )

    def _remarks(self) -> list[str]:
        found = []
        if isinstance(self.drawn, Silhouette) and self.drawn.shape.crosses_itself:
            found.append("lines of the shape cross: what they enclose an odd number of times is filled")
        if isinstance(self.drawn, Solid) and self.drawn.crosses_itself:
            found.append("triangles of the solid cross: what they enclose an odd number of times is filled")
        if isinstance(self.drawn, Silhouette | Solid) and self.region is not None:
            width = _LEAST_CELLS / self.room.scene.resolution
            if (share := self.drawn.narrow(width / self.region.scale)) > _NARROW:
                size = "shape's area" if isinstance(self.drawn, Silhouette) else "solid's volume"
                text = f"gaps of {100 * share:.0f} % of the {size} are narrower than {_LEAST_CELLS} grid"
                found.append(f"{text} cells, {100 * width:.1f} cm: some of the fluid stays in them")
        if self.drawn is not None and self.cloud.elastic > 0:
            found.append(f"elastic bodies keep their shape and will not fill the {self.noun}")
        if self.drawn is not None and self.region is not None:
            spread = self.region.volume / self.cloud.volume
            if self.is_torn:
                text = f"the {self.noun} has {spread:.1f} times the fluid's volume, which tears it"
                found.append(f'{text}: fill="shrink" keeps it whole')
        return found

    def within(self, frames: int, acceleration: float) -> "Goal":
        """Return the goal of a way that ends where an acceleration [g] leads in a number of frames."""
        seconds, gravity = self.moving(frames) * self.cloud.frame_dt, self.cloud.gravity
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            enough = self.paths.shortened(middle).timed(seconds).effort(gravity).acceleration <= acceleration
            low, high = (middle, high) if enough else (low, middle)
        return dataclasses.replace(self, paths=self.paths.shortened(low))

    def _closed_in(self) -> list[Obstruction]:
        found = []
        if self.region is not None and self.region.volume < 0.99 * self.cloud.volume:
            share = self.region.volume / self.cloud.volume
            found.append(
                Obstruction(
                    "wall", f"there is room for {100 * share:.0f} % of the fluid only: use less of it"
                )
            )
        cut_off = float(self.paths.weight @ self.paths.cut_off)
        if cut_off > 0:
            text = f"obstacles leave no way there for {100 * cut_off:.0f} % of the fluid"
            found.append(Obstruction("obstacle", f"{text}: draw the goal on its side of them"))
        sand = float(self.cloud.weight @ (self.cloud.types == SAND))
        # Some of the groups stay behind; water that need fill no region makes up for them.
        if self.squeezes and self.tip_is_free and (sand > _SOLID or self.region is not None):
            text = "the gap is too narrow for the fluid to pass whole"
            found.append(Obstruction("obstacle", f"{text}: draw the arrow through a wider one"))
        if self.drawn is not None:
            return [*found, *self._too_thin(), *self._shapeless()]
        if not self.room.within_walls(self.path[-1:]).all():
            text = "the arrow leads the centre of mass out of the room"
            found.append(Obstruction("wall", f"{text}: shorten it"))
        elif not self.tip_is_free:
            text = "the arrow leads the centre of mass into an obstacle"
            found.append(Obstruction("obstacle", f"{text}: end it beside that"))
        elif cut_off == 0:
            off = float(np.linalg.norm(self.cloud.weight @ self.paths.places - self.path[-1]))
            if self.region is not None and self.cloud.elastic > _SOLID:
                text = "walls and obstacles leave no room at the tip for the shape of the elastic body"
                found.append(Obstruction("wall", f"{text}: end the arrow farther from them"))
            elif off > NEAR * self.room.unit:
                text = f"walls and obstacles keep the centre of mass {100 * off:.0f} cm from the tip"
                found.append(Obstruction("wall", f"{text}: end the arrow farther from them"))
        return found

    def _too_thin(self) -> list[Obstruction]:
        """Return the obstruction that much of a shape or a solid is too thin for the grid."""
        if not isinstance(self.drawn, Silhouette | Solid) or self.region is None:
            return []
        width = _LEAST_CELLS / self.room.scene.resolution
        share = self.drawn.thin(width / self.region.scale)
        if isinstance(self.drawn, Silhouette) and self._depth(self.drawn, self.region) < width:
            deep = 100 * self._depth(self.drawn, self.region)
            text = f"the fluid fills the shape {deep:.1f} cm deep, and {_LEAST_CELLS} grid cells are"
            return [Obstruction("shape", f"{text} {100 * width:.1f} cm: draw it smaller")]
        if share <= _TOO_THIN:
            return []
        text = f"{100 * share:.0f} % of the {self.noun} is thinner than {_LEAST_CELLS} grid cells"
        remedy = "draw it wider" if isinstance(self.drawn, Silhouette) else "make it thicker"
        return [Obstruction("shape", f"{text}, {100 * width:.1f} cm: {remedy}")]

    @staticmethod
    def _depth(drawn: Silhouette, region: Region) -> float:
        """Return how deep a fluid fills a shape [m]; without end in 2D."""
        return 2 * region.scale * float(drawn.depth[1]) if len(drawn.depth) else float("inf")

    def _shapeless(self) -> list[Obstruction]:
        """Return the obstruction that elastic bodies, moved to an oval as they are, do not lie in it."""
        if self.cloud.elastic <= _SOLID:
            return []
        inside = self.inside(self.cloud.x + self.target_displacement)
        if inside is None or (share := float(self.cloud.weight @ inside)) >= FULL:
            return []
        text = f"of elastic bodies in the shape that they have, {100 * share:.0f} % would lie in it"
        return [Obstruction("shape", f"{text}: draw it round that shape, or draw an arrow")]

    def _choked(self, frames: int) -> list[Obstruction]:
        """Return the obstruction that a gap lets the fluid pass too slowly for a number of frames."""
        if self.gap is None or frames * self.cloud.frame_dt >= self.gap[1]:
            return []
        enough = self._frames_through(self.gap[1])
        text = f"the fluid takes {enough} frames to pass the gap of {100 * self.gap[0].width:.2g} cm"
        return [Obstruction("obstacle", f"{text}: take as many, or draw the goal where the way is wider")]

    def _too_weak(self, frames: int, acceleration: float, cap: float) -> Obstruction:
        text = f"{frames} frames take {acceleration:.1f} g, and {cap:g} g are allowed"
        longer = self._fewest_frames(cap, self.moving(frames))
        if longer is not None and self._in_all(longer) > frames:
            return Obstruction("time", f"{text}: {self._in_all(longer)} frames would do")
        return Obstruction("cap", f"{text}: raise the cap, more frames do not help")


def goal_of(sketch: Sketch, cloud: Cloud, scene: Scene, *, fill: Fill = "even") -> Goal:
    """Return the goal that a sketch sets for a cloud of particles.

    The particles fill the region of an oval or a shape evenly; see `region_of`. Along an arrow they keep
    their shape. Where walls or obstacles leave no room for it at the tip, they fill a disc, or a ball, of
    their volume around the tip instead.

    Raises
    ------
    SketchError
        Walls and obstacles leave nothing of the goal.
    """
    room = Room(scene, cloud.frame * cloud.frame_dt)
    if isinstance(sketch, Arrow):
        return _carried(sketch, cloud, room, scene)
    drawn: Figure
    if isinstance(sketch, Solid):
        drawn, name = sketch, "the solid"
    elif isinstance(sketch, Shape):
        drawn, name = Silhouette.drawn(sketch, cloud, scene.walls), "the shape"
    else:
        drawn, name = Oval.drawn(sketch, cloud, scene.walls), "the oval"
    region = region_of(drawn, room, volume=cloud.volume, particles=len(cloud.x), fill=fill, name=name)
    paths = Paths.matched(cloud, region.cells, room.grid(), None if isinstance(drawn, Oval) else region.side)
    path = np.stack([cloud.centroid, cloud.weight @ paths.places])
    return Goal(sketch, cloud, room, paths.held_back(cloud.x, room), path, drawn, region)


def _carried(sketch: Arrow, cloud: Cloud, room: Room, scene: Scene) -> Goal:
    path = cloud.centroid + arrow_path(sketch, cloud.dim, scene.walls, room.unit)
    kept = cloud.x + (path[-1] - path[0])
    keeps = bool(room.is_free(kept).mean() >= 1 - _MISFIT)
    if cloud.elastic > _SOLID:
        keeps &= bool((room.distance(kept) >= 0).mean() >= 1 - _TOUCHING)
    # Particles slightly beyond the walls are moved back.
    kept = np.clip(kept, room.lower, room.upper)
    disc = None if keeps else _Disc.of(path, cloud, room)
    body = Bends.of(room, cloud.x, kept if disc is None else disc.places, path)
    way, bent = resampled(path, STEP * room.unit), []
    if (inward := body.within(way)) is not None:
        way, path = inward, cornered(inward, room.unit)
        bent.append("the way left the room and was bent back into it")
    grid = room.grid()
    if grid is None or not body.hits(way).any():
        paths = _together(path, cloud, kept) if disc is None else disc.paths(path, cloud, room)
        return Goal(sketch, cloud, room, paths, path, None, disc.region if disc else None, tuple(bent))
    bent.append("the way was bent round obstacles")
    if keeps and (around := body.around(way, grid)) is not None:
        path = cornered(around, room.unit)
        return Goal(sketch, cloud, room, _together(path, cloud, kept), path, None, None, tuple(bent))
    if keeps and cloud.elastic > _SOLID:
        paths = _together(path[[0, -1]], cloud, kept, cut_off=True).held_back(cloud.x, room)
        return Goal(sketch, cloud, room, paths, path, None, None)
    disc = disc or _Disc.of(path, cloud, room)
    body = Bends.of(room, disc.places - path[-1] + path[0], disc.places, path)
    inward = body.within(way)
    around = body.around(way if inward is None else inward, grid)
    if around is not None:
        path = cornered(around, room.unit)
        paths = disc.paths(path, cloud, room, early=True)
        return Goal(sketch, cloud, room, paths, path, None, disc.region, tuple(bent))
    if (thread := threaded(way, cloud, disc.region, body, grid)) is not None:
        paths, line = thread
        return Goal(sketch, cloud, room, paths, cornered(line, room.unit), None, disc.region, tuple(bent))
    region = None if keeps else disc.region
    paths = Paths.matched(cloud, _quartered(kept, cloud) if region is None else region.cells, grid)
    if paths.cut_off.all():
        bent.pop()
    middle = body.centre().around(way, grid)
    path = path if middle is None else cornered(middle, room.unit)
    return Goal(sketch, cloud, room, paths.held_back(cloud.x, room), path, None, region, tuple(bent))


def _together(path: Floats, cloud: Cloud, places: Floats, *, cut_off: bool = False) -> Paths:
    """Return paths of all particles along one path (K, D), in the shape that they have."""
    group, starts = np.zeros(len(places), dtype=np.uint32), np.array([0, len(path)], dtype=np.uint32)
    return Paths.of_groups(
        cloud, places, group, starts, path, cut_off=np.array([cut_off]), together=not cut_off
    )


@dataclass(frozen=True, eq=False)
class _Disc:
    """A disc, or ball, around the tip of an arrow, with a place for each particle."""

    region: Region
    places: Floats
    """(N, D) [m]."""
    group: npt.NDArray[np.uint32]
    """Group of each particle (N,)."""

    @classmethod
    def of(cls, path: Floats, cloud: Cloud, room: Room) -> "_Disc":
        region = gathered(path[-1], room, volume=cloud.volume, particles=len(cloud.x))
        moved = np.ascontiguousarray(cloud.x + (path[-1] - path[0]))
        found = _core.match_to_region(moved, region.cells)
        return cls(region, found.places, found.group)

    def paths(self, path: Floats, cloud: Cloud, room: Room, *, early: bool = False) -> Paths:
        """Return paths of groups along a path (K, D); `early`, they take their shape at the start of it."""
        return Paths.along(
            path, cloud, self.places, self.group, lower=room.lower, upper=room.upper, early=early
        )


def _quartered(places: Floats, cloud: Cloud) -> Floats:
    """Return cells (M, D) [m] of the shape that places (N, D) have: two along each axis for a particle."""
    side = (cloud.volume / len(places)) ** (1 / cloud.dim)
    corners = np.stack(np.meshgrid(*[[-side / 4, side / 4]] * cloud.dim), axis=-1).reshape(-1, cloud.dim)
    return np.asarray((places[:, None] + corners).reshape(-1, cloud.dim))
