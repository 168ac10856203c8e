"""`prepare` and `Guidance`: the interpretation of a sketch and its plan, before anything moves."""

import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm._support.packing import as_snapshot_error, from_bytes, to_bytes
from hybridmpm.control.checks import positive
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.goal import Goal, Needs, Obstruction, ease, goal_of
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.goal.region import Figure, Fill, Oval, Region, Silhouette
from hybridmpm.control.goal.room import Room
from hybridmpm.control.goal.who import Who
from hybridmpm.control.laws import Floats32, Law, OfIds, Tracked, law_from_dict, law_to_dict
from hybridmpm.control.methods.choice import METHODS, chosen
from hybridmpm.control.methods.method import FallBack, Method, Task
from hybridmpm.control.sketch.sketch import Arrow, Ellipse, Shape, Sketch, check_in_world
from hybridmpm.control.sketch.solid import Solid
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator, checked_simulator

MAX_FRAMES = 10_000
MAX_CAP = 1000.0
"""Largest cap [g]."""
DEFAULT_CAP = 15.0
"""Cap if none is given [g]."""
DEFAULT_RESOLUTION = 32
"""Cells along the longest side of the world of the grid on which forces are smoothed. Finer grids only cost
force: what is below their cells is swallowed by the solver's own grid."""
_STRAIN = 1.5
"""Need over the cap up to which the whole cap is tried: the least force is largest at its ends, and less does
the same where it acts all the time."""
_MAGIC, _VERSION = b"HMPMGUID", 5


@dataclass(frozen=True, eq=False)
class Guidance:
    """A sketch, understood and planned for the state that it was drawn on.

    It is a force, too: `simulator.advance(frames, guidance)` follows the sketch from that state on.
    """

    goal: Goal
    """Places and paths of the particles."""
    law: Law
    """Law of the force in a frame."""
    method: str
    """Name of the method that made the law."""
    reason: str
    """Reason for this method, or for falling back to analytic control."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    hold: int
    """Number of frames for which the goal is kept after that."""
    planning_ms: float
    """Time that goal and law took [ms]."""
    _needs: Needs

    def __repr__(self) -> str:
        return f"Guidance({self.sketch.kind}, {self.method}: {self._needs})"

    @property
    def sketch(self) -> Sketch:
        """The sketch."""
        return self.goal.sketch

    @property
    def first_frame(self) -> int:
        """Frame of the simulator at the start."""
        return self.goal.cloud.frame

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) of the particles that are led."""
        return self.goal.cloud.ids

    @property
    def weight(self) -> Floats:
        """Mass of each of them over that of all (N,) [-]."""
        return self.goal.cloud.weight

    @property
    def total_frames(self) -> int:
        """`frames` and `hold` together."""
        return self.frames + self.hold

    def needs(self) -> Needs:
        """Return the acceleration and the frames that the goal needs, and any obstruction."""
        return self._needs

    def present_needs(self) -> Needs:
        """Return what `needs` does; of several goals in turn it is that of the present one."""
        return self._needs

    def __call__(self, simulator: Simulator) -> Floats32 | OfIds | None:
        """Return the force of the next frame; None before the start and once all frames are over."""
        index = simulator.frame - self.first_frame
        return self.law.force(simulator, index) if 0 <= index < self.total_frames else None

    def copied(self) -> "Guidance":
        """Return the guidance for a copy of the simulator, which may go another way."""
        law = self.law
        return dataclasses.replace(self, law=law.own()) if isinstance(law, Tracked) else self

    def snapshot(self) -> bytes:
        """Return the guidance as bytes, versioned and checksummed; `restored` reads them.

        Together with a snapshot of the simulator, taken after any frame, they go on to the same bits.

        Raises
        ------
        SnapshotError
            The law is of a method of one's own.
        """
        goal = self.goal
        tree = {
            "sketch": sketch_to_dict(goal.sketch),
            "cloud": vars(goal.cloud),
            "ways": vars(goal.paths),
            "path": goal.path,
            "bent": goal.bent,
            "drawn": None if goal.drawn is None else _figure_to_dict(goal.drawn),
            "region": None
            if goal.region is None
            else {
                "figure": _figure_to_dict(goal.region.figure),
                "scale": goal.region.scale,
                "cells": goal.region.cells,
                "volume": goal.region.volume,
            },
            "law": law_to_dict(self.law),
            "needs": dataclasses.asdict(self._needs),
            "settings": {
                name: getattr(self, name) for name in ("method", "reason", "frames", "hold", "planning_ms")
            },
        }
        return to_bytes(_MAGIC, _VERSION, tree)

    @classmethod
    def restored(cls, data: bytes, scene: Scene) -> "Guidance":
        """Return the guidance of a snapshot.

        Parameters
        ----------
        data : bytes
            From `snapshot`.
        scene : Scene
            The scene of the simulator that was steered.

        Raises
        ------
        SnapshotError
            The bytes are damaged, of another version or no snapshot of a guidance.
        """
        with as_snapshot_error("snapshot of a guidance"):
            tree = from_bytes(_MAGIC, _VERSION, data)
            return cls(
                goal=_goal_from_dict(tree, scene),
                law=law_from_dict(tree["law"]),
                _needs=needs_from_dict(tree["needs"]),
                **tree["settings"],
            )


def sketch_to_dict(sketch: Sketch) -> dict[str, Any]:
    """Return a sketch as plain data and arrays."""
    names = [field.name for field in dataclasses.fields(sketch)]
    found = {name: value for name in names if (value := getattr(sketch, name)) is not None}
    plain = {
        name: np.array(value) if isinstance(value, np.ndarray) else value for name, value in found.items()
    }
    return {"kind": sketch.kind, **plain}


def sketch_from_dict(tree: Mapping[str, Any]) -> Sketch:
    """Return the sketch of its kind and its fields; those that are None are left out."""
    kinds: dict[str, Callable[..., Sketch]] = {
        "arrow": Arrow,
        "ellipse": Ellipse,
        "shape": Shape,
        "solid": Solid,
    }
    fields = {name: value for name, value in tree.items() if name != "kind" and value is not None}
    return kinds[tree["kind"]](**fields)


def needs_from_dict(tree: Mapping[str, Any]) -> Needs:
    """Return the needs of `dataclasses.asdict`."""
    needs = dict(tree)
    needs["obstructions"] = tuple(Obstruction(**one) for one in needs["obstructions"])
    needs["notes"] = tuple(needs["notes"])
    return Needs(**needs)


def _goal_from_dict(tree: dict[str, Any], scene: Scene) -> Goal:
    cloud = Cloud(**tree["cloud"])
    room = Room(scene, cloud.frame * cloud.frame_dt)
    region = tree["region"]
    sketch = sketch_from_dict(tree["sketch"])
    return Goal(
        sketch=sketch,
        cloud=cloud,
        room=room,
        paths=Paths(**tree["ways"]),
        path=tree["path"],
        bent=tuple(tree["bent"]),
        drawn=None if tree["drawn"] is None else _figure_from_dict(tree["drawn"], sketch),
        region=None
        if region is None
        else Region(
            _figure_from_dict(region["figure"], sketch),
            room,
            region["scale"],
            region["cells"],
            region["volume"],
        ),
    )


def _figure_to_dict(figure: Figure) -> dict[str, Any]:
    # A silhouette is always that of the sketch, and a solid is the sketch.
    if isinstance(figure, Solid):
        return {}
    return {"depth": figure.depth} if isinstance(figure, Silhouette) else vars(figure)


def _figure_from_dict(tree: dict[str, Any], sketch: Sketch) -> Figure:
    if isinstance(sketch, Solid):
        return sketch
    return Silhouette(sketch, **tree) if isinstance(sketch, Shape) else Oval(**tree)


class SketchOptions(TypedDict, total=False):
    """Options of a sketch, keyword arguments of `prepare` and `follow`; `prepare` documents them."""

    frames: int | None
    cap: float
    strength: float
    hold: int
    fill: Fill
    who: Who | None
    gentle: bool
    resolution: int
    seed: int


def prepare(
    simulator: Simulator,
    sketch: Sketch,
    method: str | Method = "auto",
    *,
    frames: int | None = None,
    cap: float = DEFAULT_CAP,
    strength: float = 1.0,
    hold: int = 0,
    fill: Fill = "even",
    who: Who | None = None,
    gentle: bool = True,
    resolution: int = DEFAULT_RESOLUTION,
    seed: int = 0,
    most: int = 2 * MAX_FRAMES,
    on_frame: Callable[[], object] | None = None,
) -> Guidance:
    """Interpret a sketch and plan the motion from the current state; the simulator does not advance.

    The fluid is to fill the part of an oval or a shape that no wall or obstacle takes, evenly. Where that
    part is smaller than the fluid at rest, the goal is enlarged, with its holes, until it is as large. Along
    an arrow the centre of mass is to go, from where it is, with the least acceleration; the fluid keeps its
    shape, or, where there is no room for it at the tip, becomes a disc around the tip. In 3D stroke widths
    give the depth; the third semi-axis of an oval is the geometric mean of the other two, and a shape is as
    deep as the fluid's volume needs at the drawn size.

    Parameters
    ----------
    simulator : Simulator
        In the state that the sketch was drawn on; it does not change. The particles that are there now are
        led, those that emitters add later are not. Moving obstacles are assumed to stay where they are.
    sketch : Arrow, Ellipse, Shape or Solid
    method : str or Method
        "auto", which is "learned" where that won in 3D, else "analytic"; or one of: "analytic", guidance by
        optimal transport and least force; "constant", the paper's baseline, one acceleration for all;
        "learned", towards where a network says that the fluid may have come from; "controlnet", forces that
        the paper's diffusion generates; "none", no force. Or an object
        with their surface.
    frames : int in [1, 10000], optional
        Number of frames in which the goal is to be reached. Chosen from what the goal needs if not given.
    cap : float in (0, 1000]
        Largest acceleration of a particle [g = 9.81 m/s^2].
    strength : float in (0, 1]
        Factor on `cap`.
    hold : int in [0, 10000]
        Number of frames for which the goal is kept after it was reached.
    fill : "even" or "shrink"
        Filling of an oval larger than the fluid: evenly, which may tear water into filaments, or shrunk to
        the fluid's volume.
    who : optional
        Who is led, all particles by default; on the others no force acts. The index of a body in
        `scene.bodies`; a material, "water", "sand", "elastic" or "liquid"; an `Ellipse`, for the particles in
        it, or an `Arrow`, for those within 2 % of the world's longest side of its line, in the front view; a
        stroke as `parse_strokes` takes it; or {"particle": number}, the body of a particle, by its number in
        `Simulator.ids`.
    gentle : bool
        Whether a goal out of reach is approached at ease, as near as that leads: with at most 5 g, or the
        middle of the cap and 1 g. False allows for the whole cap, which methods that are objects always have.
    resolution : int in [0, 256]
        Cells along the longest side of the world of the grid on which the force is smoothed; 0 leaves it as
        it is.
    seed : int in [0, 2**32)
        Seed of what a method draws at random.
    most : int in [hold + 1, 20000]
        Largest number of frames, those of `hold` among them, that is chosen where `frames` is not given.
    on_frame : callable, optional
        Called before each frame of a trial. An exception that it raises ends the planning, except that a
        SimulationError only ends the trial.

    Raises
    ------
    ConfigError
        An argument is out of range, `simulator` is none, or there are no particles, or none that `who` means.
    SketchError
        The sketch does not lie in the world, or walls and obstacles leave nothing of the goal.
    SimulationError
        The method found no law.
    """
    start = time.perf_counter()
    checked_simulator(simulator)
    settings = Settings.checked(
        cap=cap, strength=strength, fill=fill, gentle=gentle, resolution=resolution, seed=seed
    )
    hold = whole("hold", hold, 0, MAX_FRAMES)
    if frames is not None:
        frames = whole("frames", frames, 1, MAX_FRAMES)
    longest = whole("most", most, hold + 1, 2 * MAX_FRAMES) - hold
    check_sketch(sketch, simulator.scene)
    goal = goal_of(sketch, Cloud.of(simulator, who), simulator.scene, fill=fill)
    needs = goal.needs(frames, settings.cap)
    if frames is None and needs.frames > longest:
        needs = goal.needs(longest, settings.cap)
    found = planned(simulator, goal, needs, method, settings, hold=hold, on_frame=on_frame)
    return dataclasses.replace(found, planning_ms=1000 * (time.perf_counter() - start))


@dataclass(frozen=True)
class Settings:
    """Options that hold for a motion to one goal or to several; `prepare` documents them."""

    cap: float
    """Largest acceleration [g], `cap` times `strength`."""
    fill: Fill
    gentle: bool
    resolution: int
    seed: int

    @classmethod
    def checked(
        cls, *, cap: float, strength: float, fill: Fill, gentle: bool, resolution: int, seed: int
    ) -> "Settings":
        """Return the options, or raise `ConfigError` where one is out of range."""
        if fill not in ("even", "shrink"):
            raise ConfigError(f'fill must be "even" or "shrink", got {fill!r}')
        return cls(
            cap=positive("cap", cap, MAX_CAP) * positive("strength", strength, 1.0),
            fill=fill,
            gentle=gentle,
            resolution=whole("resolution", resolution, 0, 256),
            seed=whole("seed", seed, 0, 2**32 - 1),
        )


def check_sketch(sketch: Sketch, scene: Scene) -> None:
    """Raise `ConfigError` unless something is a sketch, and `SketchError` unless it lies in the world."""
    if not isinstance(sketch, Arrow | Ellipse | Shape | Solid):
        raise ConfigError(
            f"sketch must be an Arrow, an Ellipse, a Shape or a Solid, got {type(sketch).__name__}"
        )
    check_in_world(sketch, scene.size)


def planned(
    simulator: Simulator,
    goal: Goal,
    needs: Needs,
    method: str | Method,
    settings: Settings,
    *,
    hold: int,
    on_frame: Callable[[], object] | None = None,
) -> Guidance:
    """Return the guidance to a goal whose needs are known; arguments are otherwise those of `prepare`."""
    start = time.perf_counter()
    frames, largest = needs.frames, settings.cap
    planner, reason = chosen(method, simulator.scene, goal)
    blocked = any(one.reason in ("wall", "obstacle", "shape") for one in needs.obstructions)
    hurried = needs.acceleration > _STRAIN * largest
    if settings.gentle and isinstance(method, str) and (blocked or hurried):
        largest = min(largest, ease(largest))
        if hurried:
            goal = goal.within(frames, largest)
        reason += f"; the goal is out of reach and approached with at most {largest:.3g} g"
    task = Task(
        goal=goal,
        frames=frames,
        hold=hold,
        fill=settings.fill,
        cap=largest,
        resolution=settings.resolution,
        seed=settings.seed,
        on_frame=on_frame or (lambda: None),
    )
    try:
        law = planner.plan(simulator, task)
    except FallBack as why:
        reason = f"{planner.name} falls back to analytic: {why}"
        planner = METHODS["analytic"]
        law = planner.plan(simulator, task)
    return Guidance(
        goal=goal,
        law=law,
        method=planner.name,
        reason=reason,
        frames=frames,
        hold=hold,
        planning_ms=1000 * (time.perf_counter() - start),
        _needs=needs,
    )
