"""A hand that pulls at rigid bodies."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    Box,
    ConfigError,
    MpmSolver,
    RigidBox,
    RigidCylinder,
    RigidHull,
    Scene,
    SnapshotError,
    Water,
)
from hybridmpm.control import pull


def _space(*rigid: Any) -> Scene:
    water = Box(lower=(0.1, 0.1, 0.1), upper=(0.9, 0.2, 0.9), material=Water())
    return Scene(dim=3, resolution=12, bodies=[water], rigid=rigid)


def test_a_hand_holds_a_point_of_a_body_in_space() -> None:
    crate = RigidBox(lower=(0.3, 0.3, 0.3), upper=(0.5, 0.4, 0.5), rotation=(0.5, 0.2, 0.1), density=600)
    solver = MpmSolver(_space(crate))
    point = np.array([0.35, 0.38, 0.42])
    grip = solver.rigid_bodies.grip(0, point)
    assert solver.rigid_bodies.grip(0, solver.rigid_bodies.center[0]) == pytest.approx(0, abs=1e-6)
    target, strength = (0.6, 0.7, 0.4), 200.0
    hand = pull(0, target, grip=grip, strength=strength)
    # Forces of particles go the same ways, also together with it.
    solver.rollout(80, hand)
    solver.advance(80, lambda simulator: hand(simulator) or (0.0, 0.0, 0.0))
    # The point that is held is the same as at the start.
    held = crate.moved(point[None], solver.rigid_numbers()[0])[0]
    sag = 0.08 * crate.mass * 9.81 / strength
    assert held == pytest.approx(np.subtract(target, (0, sag, 0)), abs=0.03)
    assert solver.rigid_bodies.grip(0, held) == pytest.approx(grip, abs=1e-6)
    with pytest.raises(ConfigError, match=r"body must be in \[0, 0\], got 1"):
        solver.rigid_bodies.grip(1, held)
    with pytest.raises(ConfigError, match=r"point must have 3 numbers, got shape \(2,\)"):
        solver.rigid_bodies.grip(0, held[:2])
    with pytest.raises(SnapshotError, match="must be bytes, got str"):
        solver.restore("state")  # type: ignore[arg-type]


def test_a_pull_acts_in_one_frame_and_leaves_no_trace_in_snapshots() -> None:
    solver = MpmSolver(_space(RigidBox(lower=(0.3, 0.5, 0.3), upper=(0.4, 0.6, 0.4))))
    other = solver.copy()
    solver.pull(0, (0, 0, 0), (0.9, 0.5, 0.3), reach=0.1, strength=50.0)
    solver.restore(solver.snapshot())
    for one in (solver, other):
        one.advance(2)
    assert solver.digest() == other.digest()
    other.restore(other.snapshot())
    digest = other.digest()
    other.advance(1, pull(0, (0.9, 0.5, 0.3), strength=50.0))
    solver.advance(1)
    assert other.digest() not in (digest, solver.digest())
    assert other.rigid_bodies.velocity[0, 0] > solver.rigid_bodies.velocity[0, 0] + 0.01


def test_faults_of_a_pull_are_named() -> None:
    solver = MpmSolver(_space(RigidBox(lower=(0.3, 0.5, 0.3), upper=(0.4, 0.6, 0.4))))
    for force, text in (
        (
            pull(1, (0.5, 0.5, 0.5), strength=1.0),
            "body must be the number of a rigid body of the scene, got 1",
        ),
        (pull(0, (0.5, 0.5), strength=1.0), "grip must be 3 finite numbers"),
    ):
        with pytest.raises(ConfigError, match=text):
            force(solver)
    with pytest.raises(ConfigError, match="strength must be a number above 0"):
        pull(0, (0.5, 0.5), strength=0)
    with pytest.raises(ConfigError, match=r"body must be in \[0, 199\]"):
        pull(-1, (0.5, 0.5), strength=1.0)


def test_shapes_are_given_in_the_frame_of_the_body() -> None:
    points = ((0.3, 0.3, 0.3), (0.5, 0.3, 0.3), (0.3, 0.5, 0.3), (0.3, 0.3, 0.5), (0.35, 0.35, 0.35))
    wedge = RigidHull(points=points)
    solid = wedge.solid()
    corners = np.array(solid["corners"])
    a, b, c = np.moveaxis(corners[solid["triangles"]], 1, 0)
    volume = np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6
    assert volume == pytest.approx(wedge.mass / wedge.density)
    assert corners + wedge.mass_center == pytest.approx(np.array(points[:4]), abs=1e-6)
    flat = RigidHull(points=((0.5, 0.3), (0.3, 0.3), (0.35, 0.35), (0.3, 0.5)))
    assert np.array(flat.solid()["corners"]) + flat.mass_center == pytest.approx(
        np.array([(0.3, 0.3), (0.5, 0.3), (0.3, 0.5)]), abs=1e-6
    )
    pin = RigidCylinder(start=(0.3, 0.3, 0.3), end=(0.3, 0.3, 0.7), radius=0.1)
    assert pin.solid() == {"shape": "cylinder", "radius": 0.1, "half": pytest.approx(0.2)}


def test_a_frame_of_coarse_mode_that_is_done_again_has_its_pull() -> None:
    solver = MpmSolver(_space(RigidBox(lower=(0.3, 0.5, 0.3), upper=(0.4, 0.6, 0.4))))
    other = solver.copy()
    stepper = solver._stepper
    hand = pull(0, (0.9, 0.5, 0.3), strength=50.0)
    hand(solver)
    # As after a frame that has failed, for which the core has forgotten the pull.
    stepper.solver.restore(stepper.solver.snapshot())
    stepper._redo(other._solver.copy, None)
    other.advance(1, hand)
    assert solver.frame == 1
    assert solver.digest() == other.digest()
