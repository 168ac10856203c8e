"""Each exception class can be raised by a user, and carries what its reader needs."""

import pickle
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hybridmpm import (
    Ball,
    Box,
    CancelFlag,
    MpmBatch,
    MpmSolver,
    Scene,
    data,
    errors,
    export,
    metrics,
    radius_graph,
    scenarios,
)
from hybridmpm.control import parse_png

DROP = Scene(dim=2, resolution=64, bodies=(Ball(material="water", center=(0.5, 0.6), radius=0.06),))

COLLISION = Scene(
    dim=2,
    resolution=64,
    bodies=(
        Box(material="water", lower=(0.3, 0.3), upper=(0.5, 0.5), velocity=(45.0, 0.0)),
        Box(material="water", lower=(0.52, 0.3), upper=(0.7, 0.5), velocity=(-45.0, 0.0)),
    ),
)


def push(acceleration: float) -> None:
    """Throw the particles of DROP aside in one substep of a whole frame."""
    solver = MpmSolver(DROP, substeps=1, allow_unstable=True)
    solver.advance(1, np.tile([acceleration, 0.0], (solver.particle_count, 1)))


def tear_apart() -> None:
    """Push each quarter of a drop outwards, as hard as float32 can say, in one step of 0.1 s."""
    scene = DROP.model_copy(update={"frame_dt": 0.1})
    solver = MpmSolver(scene, substeps=1, allow_unstable=True)
    solver.advance(1, np.where(solver.positions > (0.5, 0.6), 3e38, -3e38))


def invert() -> None:
    """Give an elastic body velocities that press it to a line within a frame."""
    body = Box(material="elastic", lower=(0.3, 0.3), upper=(0.5, 0.5))
    solver = MpmSolver(Scene(dim=2, resolution=32, bodies=(body,)))
    x = solver.positions
    solver.prescribe(x, (0.4 - x) * np.array([3000, 0], dtype=np.float32), 1, deform=True)
    solver.advance(3)


def collide_in_a_batch() -> None:
    """Drive two blocks into each other, in the second of two scenes, with steps that are far too long."""
    MpmBatch([DROP, COLLISION], substeps=1, allow_unstable=True).advance(3)


def advance_after_a_cancel() -> None:
    """Ask for a frame whose flag is set."""
    solver, flag = MpmSolver(DROP), CancelFlag()
    flag.set()
    with flag:
        solver.advance()


PROVOKED: dict[str, tuple[Callable[[], object], str]] = {
    "BatchError": (collide_in_a_batch, r"^scene 1: particle \d+ left the domain"),
    "ConfigError": (lambda: metrics.grid_rmse([1.0], [1.0, 2.0]), "same shape"),
    "DataError": (lambda: data.detect(Path("nowhere")), "nowhere is no folder"),
    "DomainError": (lambda: push(1e5), r"particle \d+ left the domain in frame 0"),
    "ExportError": (lambda: export.check_target(Path("fluid.stl")), r"\.vtp; got 'fluid\.stl'"),
    "ForceError": (lambda: MpmSolver(DROP).advance(1, [1.0]), r"have shape \(2,\), .*got shape \(1,\)"),
    "FrameCancelledError": (advance_after_a_cancel, "frame 0 was cancelled"),
    "GraphSizeError": (
        lambda: radius_graph(np.zeros((9, 2), np.float32), 1.0, max_edges=7),
        "raise max_edges",
    ),
    "InvertedError": (invert, r"particle \d+ reached volume ratio J = .* in frame [12]"),
    "NonFiniteError": (tear_apart, r"particle \d+ .*frame 0"),
    "SceneError": (lambda: Scene.parse({}), "dim: is required; bodies: is required"),
    "SimulationError": (lambda: MpmSolver(DROP, substeps=1).advance(), "stability limit"),
    "SketchError": (lambda: parse_png(b"GIF89a"), "PNG"),
    "SnapshotError": (lambda: MpmSolver(DROP).restore(b""), "snapshot"),
    "StepSizeError": (lambda: MpmSolver(DROP, substeps=1).advance(), r"at least \d+ substeps"),
    "UnknownScenarioError": (lambda: scenarios.get("lava_2d"), "water_2d, .*got 'lava_2d'"),
}


def test_each_class_is_provoked() -> None:
    assert sorted(PROVOKED) == errors.__all__


@pytest.mark.parametrize("name", PROVOKED)
def test_provoked(name: str) -> None:
    provoke, message = PROVOKED[name]
    kind = getattr(errors, name)
    with pytest.raises(kind, match=message) as caught:
        provoke()
    assert isinstance(caught.value, errors.SimulationError)
    # Every class has a case of its own; the parent is provoked through one of its children.
    assert type(caught.value) is kind or name == "SimulationError"


def test_the_substeps_that_the_error_asks_for_are_the_fewest_that_are_taken() -> None:
    with pytest.raises(errors.StepSizeError) as caught:
        MpmSolver(DROP, substeps=1).advance()
    asked = re.search(r"at least (\d+) substeps", str(caught.value))
    fewest = int(asked.group(1))
    MpmSolver(DROP, substeps=fewest).advance()
    with pytest.raises(errors.StepSizeError):
        MpmSolver(DROP, substeps=fewest - 1).advance()


def test_bad_input_is_a_value_error() -> None:
    for name in (
        "ConfigError",
        "DataError",
        "ForceError",
        "SceneError",
        "SketchError",
        "SnapshotError",
        "UnknownScenarioError",
    ):
        assert issubclass(getattr(errors, name), ValueError)


def test_scene_errors_survive_pickling() -> None:
    error = errors.SceneError.of([("dim", "is required"), ("", "odd")])
    again = pickle.loads(pickle.dumps(error))  # noqa: S301 - bytes of our own
    assert str(again) == "dim: is required; odd"
    assert again.problems == [("dim", "is required"), ("", "odd")]
