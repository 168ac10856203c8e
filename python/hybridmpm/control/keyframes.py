"""`Keyframe` and `Sequence`: several goals in turn, planned as one motion."""

import contextlib
import copy
import dataclasses
import time
from collections.abc import Callable, Iterator
from collections.abc import Sequence as Several
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm._support.packing import as_snapshot_error, from_bytes, to_bytes
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.goal import Goal, Needs, goal_of
from hybridmpm.control.goal.paths import spline_velocities
from hybridmpm.control.goal.region import Fill
from hybridmpm.control.goal.who import Who, chosen
from hybridmpm.control.guidance import (
    DEFAULT_CAP,
    DEFAULT_RESOLUTION,
    MAX_FRAMES,
    Guidance,
    Settings,
    check_sketch,
    needs_from_dict,
    planned,
    prepare,
    sketch_from_dict,
    sketch_to_dict,
)
from hybridmpm.control.laws import Floats32, OfIds
from hybridmpm.control.methods.method import Method
from hybridmpm.control.sketch.sketch import Sketch
from hybridmpm.errors import ConfigError, SketchError
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator, checked_simulator

MAX_KEYFRAMES = 32
"""Largest number of goals in turn."""
_MAGIC, _VERSION = b"HMPMKEYF", 1
_RESTS = 1e-9
"""Speed below which a goal is passed at rest [m/s]."""


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A goal among several.

    Parameters
    ----------
    goal : Arrow, Ellipse, Shape or Solid
    frames : int in [1, 10000], optional
        Number of frames from the keyframe before, or from the start, to this goal. Chosen from what the goal
        needs if not given.
    hold : int in [0, 10000]
        Number of frames for which the goal is kept.
    who : optional
        Who is led, as of `prepare`, chosen in the state at the start of the sequence; all by default.
    """

    goal: Sketch
    frames: int | None = None
    hold: int = 0
    who: Who | None = None

    def __post_init__(self) -> None:
        if self.frames is not None:
            object.__setattr__(self, "frames", whole("frames", self.frames, 1, MAX_FRAMES))
        object.__setattr__(self, "hold", whole("hold", self.hold, 0, MAX_FRAMES))


Given: TypeAlias = Keyframe | tuple[Sketch, int | None]
"""A keyframe, or a goal and its frames."""


@dataclass(frozen=True, eq=False)
class Leg:
    """The way to a goal of a sequence."""

    keyframe: Keyframe
    """With its number of frames."""
    needs: Needs
    """Needs of the goal from where the keyframe before leads."""
    start: int
    """Frames since the start of the sequence at which it begins."""
    velocity: Floats | None
    """Velocity (D,) [m/s] with which the goal is passed; None for rest."""
    led: npt.NDArray[np.uint64] | None
    """Numbers of the particles that are led; None for all."""

    @property
    def arrival(self) -> int:
        """Frames since the start of the sequence at which the goal is to be reached."""
        return self.start + (self.keyframe.frames or 0)

    @property
    def end(self) -> int:
        """Frames since the start of the sequence at which the next keyframe begins."""
        return self.arrival + self.keyframe.hold


class Sequence:
    """Several goals in turn, planned from the state in which they were given; `prepare_keyframes` makes it.

    The centre of mass goes along a cubic spline through the goals, which takes the least force for their
    times. So it passes a goal with the velocity of the spline, unless the goal is held, others are led next,
    or the scene has obstacles. Each goal is planned anew from the actual state in its first frame, with that
    velocity at its end.

    Like a `Guidance` it is a force: `simulator.advance(frames, sequence)` follows all goals.
    """

    def __init__(
        self,
        legs: Several[Leg],
        first: Guidance,
        *,
        settings: Settings,
        method: str | Method,
        ids: npt.NDArray[np.uint64],
        weight: Floats,
        planning_ms: float,
    ) -> None:
        self.legs = tuple(legs)
        """The goals, with what each needs."""
        self.ids = ids
        """Numbers (N,) of all particles at the start."""
        self.weight = weight
        """Mass of each over that of all (N,) [-]."""
        self.first_frame = first.first_frame
        """Frame of the simulator at the start."""
        self.planning_ms = planning_ms
        """Time that the plan took [ms]."""
        self._settings, self._method = settings, method
        # Number of the leg, frames since the start at which it was planned, and its guidance.
        self._current: tuple[int, int, Guidance] = (0, 0, first)

    def __repr__(self) -> str:
        times = ", ".join(f"{leg.keyframe.goal.kind} at {leg.arrival}" for leg in self.legs)
        return f"Sequence({times})"

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes, with their numbers of frames."""
        return tuple(leg.keyframe for leg in self.legs)

    @property
    def number(self) -> int:
        """Number of the keyframe to which the simulator was led last, from 0 on."""
        return self._current[0]

    @property
    def guidance(self) -> Guidance:
        """Guidance to that keyframe."""
        return self._current[2]

    @property
    def planned_at(self) -> int:
        """Number of frames since the start after which that guidance was planned."""
        return self._current[1]

    @property
    def law(self) -> "Sequence":
        """The sequence, which is the law of its force."""
        return self

    @property
    def goal(self) -> Goal:
        """Goal of that keyframe."""
        return self.guidance.goal

    @property
    def sketch(self) -> Sketch:
        """Sketch of that keyframe."""
        return self.guidance.sketch

    @property
    def method(self) -> str:
        """Name of the method that leads to that keyframe."""
        return self.guidance.method

    @property
    def reason(self) -> str:
        """Reason for that method."""
        return self.guidance.reason

    @property
    def frames(self) -> int:
        """Frames in which the last goal is to be reached."""
        return self.legs[-1].arrival

    @property
    def hold(self) -> int:
        """Frames for which the last goal is kept."""
        return self.legs[-1].keyframe.hold

    @property
    def total_frames(self) -> int:
        """`frames` and `hold` together."""
        return self.legs[-1].end

    def needs(self, number: int = -1) -> Needs:
        """Return the needs of a keyframe, of the last one by default; those of all: `[leg.needs ...]`."""
        return self.legs[number].needs

    def present_needs(self) -> Needs:
        """Return the needs of the present keyframe."""
        return self.legs[self.number].needs

    def number_at(self, index: int) -> int:
        """Return the number of the keyframe that leads some frames after the start."""
        return next((k for k, leg in enumerate(self.legs) if index < leg.end), len(self.legs) - 1)

    def __call__(self, simulator: Simulator) -> Floats32 | OfIds | None:
        """Return the force of the next frame; None before the start and once all frames are over."""
        index = simulator.frame - self.first_frame
        return self.force(simulator, index) if 0 <= index < self.total_frames else None

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds | None:
        """Return the force some frames after the start, as a law does."""
        first, guidance = self.leading(simulator, index)
        return guidance.law.force(simulator, index - first)

    def leading(self, simulator: Simulator, index: int) -> tuple[int, Guidance]:
        """Return the guidance that leads some frames after the start, and the frames after which it began.

        In the first frame of a keyframe it is planned, from the present state.
        """
        number = self.number_at(index)
        leg = self.legs[number]
        known, first, guidance = self._current
        # In the first frame of a leg nothing known counts: the simulator may be on another way than before.
        if known != number or first > index or (index == leg.start and number > 0):
            first, guidance = index, self._planned(simulator, leg, index)
            self._current = number, first, guidance
        return first, guidance

    def _planned(self, simulator: Simulator, leg: Leg, index: int) -> Guidance:
        """Return the guidance to a goal from the present state."""
        # What emitters have added since the start is not led.
        led = self.ids if leg.led is None and simulator.scene.is_open else leg.led
        try:
            goal = goal_of(
                leg.keyframe.goal, Cloud.of(simulator, led), simulator.scene, fill=self._settings.fill
            )
        except (ConfigError, SketchError):
            # Those who were led have left, or what moves has taken the place. The goal before is kept.
            return self.guidance
        if leg.velocity is not None:
            goal = goal.carrying(leg.velocity)
        needs = goal.needs(max(1, leg.arrival - index), self._settings.cap)
        method = _passing(self._method, leg.velocity)
        return planned(simulator, goal, needs, method, self._settings, hold=leg.keyframe.hold)

    def edited(
        self, simulator: Simulator, keyframes: Several[Given], *, on_frame: Callable[[], object] | None = None
    ) -> "Sequence":
        """Return the sequence of other keyframes with the same options, planned from the present state.

        The present velocities are those at its start, so the motion goes on without a jump.
        """
        return _sequence(
            simulator, keyframes, self._method, self._settings, most=2 * MAX_FRAMES, on_frame=on_frame
        )

    def left(self, index: int) -> list[Keyframe]:
        """Return the keyframes that are left some frames after the start, the present one with its rest."""
        number = self.number_at(index)
        leg = self.legs[number]
        present = dataclasses.replace(
            leg.keyframe,
            frames=max(1, leg.arrival - index),
            hold=min(leg.keyframe.hold, max(0, leg.end - index - 1)),
        )
        return [present, *self.keyframes[number + 1 :]]

    def copied(self) -> "Sequence":
        """Return the sequence for a copy of the simulator, which may go another way."""
        number, first, guidance = self._current
        twin = copy.copy(self)
        twin._current = number, first, guidance.copied()  # noqa: SLF001 - of this very class
        return twin

    def snapshot(self) -> bytes:
        """Return the sequence as bytes, as `Guidance.snapshot` does.

        Raises
        ------
        SnapshotError
            The law is of a method of one's own.
        """
        number, first, guidance = self._current
        tree = {
            "legs": [
                {
                    "sketch": sketch_to_dict(leg.keyframe.goal),
                    "times": [leg.keyframe.frames, leg.keyframe.hold, leg.start],
                    "needs": dataclasses.asdict(leg.needs),
                    "velocity": leg.velocity,
                    "led": leg.led,
                }
                for leg in self.legs
            ],
            "current": [number, first, guidance.snapshot()],
            "settings": dataclasses.asdict(self._settings),
            "method": self._method if isinstance(self._method, str) else guidance.method,
            "ids": self.ids,
            "weight": self.weight,
            "first_frame": self.first_frame,
            "planning_ms": self.planning_ms,
        }
        return to_bytes(_MAGIC, _VERSION, tree)

    @classmethod
    def restored(cls, data: bytes, scene: Scene) -> "Sequence":
        """Return the sequence of a snapshot, as `Guidance.restored` does."""
        with as_snapshot_error("snapshot of a sequence"):
            tree = from_bytes(_MAGIC, _VERSION, data)
            number, first, guidance = tree["current"]
            sequence = cls(
                [_leg(one) for one in tree["legs"]],
                Guidance.restored(guidance, scene),
                settings=Settings(**tree["settings"]),
                method=tree["method"],
                ids=tree["ids"],
                weight=tree["weight"],
                planning_ms=tree["planning_ms"],
            )
            sequence.first_frame = tree["first_frame"]
            sequence._current = number, first, sequence.guidance
            return sequence


Led: TypeAlias = Guidance | Sequence
"""A plan for one goal, or for several."""


def plan_motion(
    simulator: Simulator,
    goals: Sketch | Several[Given],
    method: str | Method = "auto",
    *,
    frames: int | None = None,
    hold: int = 0,
    who: Who | None = None,
    **options: Any,
) -> Led:
    """Plan one sketch, or several in turn: `prepare` or `prepare_keyframes`, whose options are taken.

    Raises
    ------
    ConfigError
        `frames`, `hold` or `who` is given for several goals, to each of which it belongs; or as of those two.
    """
    if not isinstance(goals, Several):
        return prepare(simulator, goals, method, frames=frames, hold=hold, who=who, **options)
    for name, given in (("frames", frames), ("hold", hold or None), ("who", who)):
        if given is not None:
            raise ConfigError(f"{name} belongs to each keyframe: Keyframe(goal, frames, hold, who)")
    return prepare_keyframes(simulator, goals, method, **options)


def restored(data: bytes, scene: Scene) -> Led:
    """Return the guidance or the sequence of a snapshot; see `Guidance.restored`."""
    return (Sequence if data.startswith(_MAGIC) else Guidance).restored(data, scene)


def prepare_keyframes(
    simulator: Simulator,
    keyframes: Several[Given],
    method: str | Method = "auto",
    *,
    cap: float = DEFAULT_CAP,
    strength: float = 1.0,
    fill: Fill = "even",
    gentle: bool = True,
    resolution: int = DEFAULT_RESOLUTION,
    seed: int = 0,
    most: int = 2 * MAX_FRAMES,
    on_frame: Callable[[], object] | None = None,
) -> Sequence:
    """Plan a motion through several goals from the current state; the simulator does not advance.

    Parameters
    ----------
    simulator : Simulator
        As of `prepare`.
    keyframes : sequence of Keyframe or (goal, frames), 1 to 32
        The goals in turn.
    method : str or Method
        As of `prepare`; "auto" is "analytic" where a goal is passed with a velocity, because learned plans
        end at rest.
    most : int in [1, 20000]
        Largest number of frames of all together.

    Others are those of `prepare`, for all keyframes.

    Raises
    ------
    ConfigError
        An argument is out of range, or the frames are more than `most`.
    SketchError
        A goal does not lie in the world, or walls and obstacles leave nothing of it; the message names it.
    SimulationError
        The method found no law to the first goal.
    """
    checked_simulator(simulator)
    settings = Settings.checked(
        cap=cap, strength=strength, fill=fill, gentle=gentle, resolution=resolution, seed=seed
    )
    most = whole("most", most, 1, 2 * MAX_FRAMES)
    return _sequence(simulator, keyframes, method, settings, most=most, on_frame=on_frame)


def _sequence(
    simulator: Simulator,
    given: Several[Given],
    method: str | Method,
    settings: Settings,
    *,
    most: int,
    on_frame: Callable[[], object] | None,
) -> Sequence:
    begun = time.perf_counter()
    keyframes = _checked(given, simulator.scene)
    everything = Cloud.of(simulator)
    led, goals = _goals(simulator, keyframes, settings, everything)
    frames = [
        keyframe.frames or goal.suggested_frames(settings.cap)
        for keyframe, goal in zip(keyframes, goals, strict=True)
    ]
    total = sum(frames) + sum(keyframe.hold for keyframe in keyframes)
    if total > most:
        raise ConfigError(f"the keyframes take {total} frames, at most {most} are allowed: give them fewer")
    carried = _carried(keyframes, goals, led, frames)
    legs, start, before = [], 0, None
    for number, keyframe in enumerate(keyframes):
        goal = goals[number]
        if before is not None:
            velocity = np.tile(before, (len(goal.paths.weight), 1))
            goal = dataclasses.replace(goal, paths=dataclasses.replace(goal.paths, velocity=velocity))
        if (passing := carried[number]) is not None:
            goal = goal.carrying(passing)
        goals[number], before = goal, goal.paths.end
        timed = dataclasses.replace(keyframe, frames=frames[number])
        legs.append(Leg(timed, goal.needs(frames[number], settings.cap), start, before, led[number]))
        start = legs[-1].end
    first = legs[0]
    guidance = planned(
        simulator,
        goals[0],
        first.needs,
        _passing(method, first.velocity),
        settings,
        hold=first.keyframe.hold,
        on_frame=on_frame,
    )
    planning_ms = 1000 * (time.perf_counter() - begun)
    return Sequence(
        legs,
        guidance,
        settings=settings,
        method=method,
        ids=everything.ids,
        weight=everything.weight,
        planning_ms=planning_ms,
    )


def _passing(method: str | Method, velocity: Floats | None) -> str | Method:
    """Return the method for a goal that is passed with a velocity; learned plans end at rest."""
    return "analytic" if method == "auto" and velocity is not None else method


def _checked(given: Several[Given], scene: Scene) -> list[Keyframe]:
    """Return keyframes in the world of a scene."""
    if isinstance(given, str | bytes) or not isinstance(given, Several):
        raise ConfigError(f"keyframes must be a list of goals and frames, got {type(given).__name__}")
    if not 1 <= len(given) <= MAX_KEYFRAMES:
        raise ConfigError(f"there must be 1 to {MAX_KEYFRAMES} keyframes, got {len(given)}")
    keyframes = []
    for number, one in enumerate(given):
        if not isinstance(one, Keyframe):
            if not isinstance(one, tuple) or len(one) != 2:
                raise ConfigError(f"keyframes[{number}] must be a Keyframe or a goal and its frames: {one!r}")
            one = Keyframe(*one)  # noqa: PLW2901 - the same in its full form
        with _named(number):
            check_sketch(one.goal, scene)
        keyframes.append(one)
    return keyframes


@contextlib.contextmanager
def _named(number: int) -> Iterator[None]:
    """Put the number of a keyframe before messages about it."""
    try:
        yield
    except (SketchError, ConfigError) as error:
        raise type(error)(f"keyframes[{number}]: {error}") from error


def _goals(
    simulator: Simulator, keyframes: list[Keyframe], settings: Settings, everything: Cloud
) -> tuple[list[npt.NDArray[np.uint64] | None], list[Goal]]:
    """Return who is led to each goal, and the goals, each from the places in the one before."""
    x, v = everything.x.copy(), everything.v.copy()
    led: list[npt.NDArray[np.uint64] | None] = []
    goals: list[Goal] = []
    for number, keyframe in enumerate(keyframes):
        with _named(number):
            ids = None if keyframe.who is None else simulator.ids[chosen(simulator, keyframe.who)]
            cloud = everything if ids is None else Cloud.of(simulator, ids)
            rows = np.searchsorted(everything.ids, cloud.ids)
            cloud = dataclasses.replace(cloud, x=x[rows], v=v[rows])
            goal = goal_of(keyframe.goal, cloud, simulator.scene, fill=settings.fill)
        x[rows], v[rows] = goal.paths.places, 0.0
        led.append(ids)
        goals.append(goal)
    return led, goals


def _carried(
    keyframes: list[Keyframe],
    goals: list[Goal],
    led: list[npt.NDArray[np.uint64] | None],
    frames: list[int],
) -> list[Floats | None]:
    """Return the velocity (D,) [m/s] with which the centre of mass passes each goal; None for rest."""
    carried: list[Floats | None] = [None] * len(keyframes)
    first = 0
    for number, keyframe in enumerate(keyframes):
        last = number + 1 == len(keyframes)
        others = not last and not (
            led[number] is led[number + 1]
            or (led[number] is not None and np.array_equal(led[number], led[number + 1]))  # type: ignore[arg-type]
        )
        if not (last or keyframe.hold or others):
            continue
        cloud, dt = goals[first].cloud, goals[first].cloud.frame_dt
        points = [goals[first].path[0], *(goal.path[-1] for goal in goals[first : number + 1])]
        times = dt * np.cumsum([0, *frames[first : number + 1]])
        v = spline_velocities(times, np.array(points)[None], cloud.mean_velocity[None], np.zeros(cloud.dim))
        for passed in range(first, number):
            velocity = v[0, passed - first + 1]
            carried[passed] = velocity if np.linalg.norm(velocity) > _RESTS else None
        first = number + 1
    return carried


def _leg(tree: dict[str, Any]) -> Leg:
    frames, hold, start = tree["times"]
    keyframe = Keyframe(sketch_from_dict(tree["sketch"]), frames, hold)
    return Leg(keyframe, needs_from_dict(tree["needs"]), start, tree["velocity"], tree["led"])
