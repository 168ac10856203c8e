"""Origin and inputs of a session: together they determine its state at each frame, to the bit."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np
from pydantic import BaseModel, Field

from hybridmpm import SOLVER_VERSION, Scene, __version__
from hybridmpm.control import Arrow, Ellipse, Push, Sketch
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverChoice


@dataclass(frozen=True, kw_only=True)
class SketchInput:
    """A sketch that begins to steer; it replaces an older one."""

    kind: ClassVar = "sketch"
    frame: int
    """First frame whose state it acts on."""
    number: int
    """Number of the sketch in its session, counted from 1."""
    drawn_frame: int
    """Frame of the state that it was planned for."""
    planned_by: str
    """Name of the method that planned."""
    sketch: Sketch
    settings: Mapping[str, Any]
    """Settings of `hybridmpm.control.prepare`."""

    def record(self) -> dict[str, Any]:
        """Return the input as plain data; `input_of` makes an equal one of it."""
        return {
            "kind": self.kind,
            "frame": self.frame,
            "number": self.number,
            "drawn_frame": self.drawn_frame,
            "planned_by": self.planned_by,
            "sketch": sketch_record(self.sketch),
            "settings": dict(self.settings),
        }


@dataclass(frozen=True, kw_only=True)
class ReleaseInput:
    """End of the sketch that steers."""

    kind: ClassVar = "release"
    frame: int
    """First frame whose state no sketch acts on."""

    def record(self) -> dict[str, Any]:
        """Return the input as plain data."""
        return {"kind": self.kind, "frame": self.frame}


@dataclass(frozen=True, kw_only=True)
class PushInput:
    """Start, change or end of a hand's push."""

    kind: ClassVar = "push"
    frame: int
    """First frame whose state it acts on."""
    push: Push | None
    """None ends it."""

    def record(self) -> dict[str, Any]:
        """Return the input as plain data."""
        return {"kind": self.kind, "frame": self.frame, "push": push_record(self.push)}


Input: TypeAlias = SketchInput | ReleaseInput | PushInput


def input_of(record: Mapping[str, Any]) -> Input:
    """Return the input of a record.

    Raises
    ------
    SketchError
        The sketch is out of range.
    KeyError, TypeError, ValueError
        The record is malformed.
    """
    kind, frame = record["kind"], record["frame"]
    if kind == ReleaseInput.kind:
        return ReleaseInput(frame=frame)
    if kind == PushInput.kind:
        return PushInput(frame=frame, push=push_of(record["push"]))
    if kind != SketchInput.kind:
        raise ValueError(f"there is no input {kind!r}")
    return SketchInput(
        frame=frame,
        number=record["number"],
        drawn_frame=record["drawn_frame"],
        planned_by=record["planned_by"],
        sketch=_sketch_of(record["sketch"]),
        settings=record["settings"],
    )


def sketch_record(sketch: Sketch) -> dict[str, Any]:
    """Return a sketch as plain data."""
    fields = {name: _plain(value) for name, value in vars(sketch).items() if value is not None}
    return {"kind": sketch.kind} | fields


def push_record(push: Push | None) -> dict[str, Any] | None:
    """Return a push as plain data; None where there is none."""
    return None if push is None else {name: _plain(value) for name, value in vars(push).items()}


def push_of(record: Mapping[str, Any] | None) -> Push | None:
    """Return the push of a record of `push_record`."""
    if record is None:
        return None
    vectors = {name: np.array(record[name], dtype=np.float64) for name in ("point", "velocity")}
    return Push(**vectors, radius=record["radius"], cap=record["cap"])


def _sketch_of(record: Mapping[str, Any]) -> Sketch:
    fields = {name: value for name, value in record.items() if name != "kind"}
    return Arrow(**fields) if record["kind"] == Arrow.kind else Ellipse(**fields)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


class Versions(BaseModel, frozen=True, extra="forbid", strict=True, use_attribute_docstrings=True):
    """Versions that computed a session; others need not give the same bits."""

    hybridmpm: str = Field(max_length=100)
    """Version of the library."""
    solver: int
    """Version of the solver."""
    model: str | None = Field(max_length=64)
    """SHA-256 of the network's file; null without a network."""


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Scene and simulator of a session."""

    scene: Scene
    scenario: str | None
    """Scenario of the scene; None where a scene was given."""
    seed: int | None
    """Seed of the scenario; None where a scene was given."""
    choice: SolverChoice
    """The simulator; its network has a name."""
    versions: Versions

    @classmethod
    def of(cls, scene: Scene, chosen: ChosenSolver, scenario: str | None, seed: int | None) -> Self:
        """Return the origin of a session that begins now."""
        choice = SolverChoice(
            solver=chosen.simulator.kind,
            coarse=chosen.coarse,
            model=chosen.model,
            r_c=chosen.r_c,
        )
        versions = Versions(hybridmpm=__version__, solver=SOLVER_VERSION, model=chosen.model_sha256)
        return cls(scene=scene, scenario=scenario, seed=seed, choice=choice, versions=versions)

    def record(self) -> dict[str, Any]:
        """Return the origin as plain data; `of_record` makes an equal one of it."""
        return {
            "versions": self.versions.model_dump(),
            "scenario": self.scenario,
            "seed": self.seed,
            "scene": self.scene.model_dump(mode="json", exclude_none=True),
            **vars(self.choice),
        }

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Self:
        """Return the origin of a record.

        Raises
        ------
        SceneError, FieldError
            The scene or the choice is refused.
        KeyError, TypeError
            The record is malformed.
        """
        return cls(
            scene=Scene.parse(record["scene"]),
            scenario=record["scenario"],
            seed=record["seed"],
            choice=SolverChoice(**{name: record[name] for name in ("solver", "coarse", "model", "r_c")}),
            versions=Versions(**record["versions"]),
        )
