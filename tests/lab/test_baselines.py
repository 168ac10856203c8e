"""Our solver against plain ones of others: the same start, substeps and constants give the same positions.

The scenes stay away from the walls, which the two treat differently by design: ours act at their true
position, theirs at the nodes at or beyond it.
"""

import importlib.util
from typing import Any

import numpy as np
import pytest

from hybridmpm import Ball, Box, BoxObstacle, ConfigError, MpmSolver, Scene, Walls
from hybridmpm.scene import Material, Sand, Water
from hybridmpm_lab.speed.baselines import baseline_process
from hybridmpm_lab.speed.baselines.constants import Constants

TOLERANCE = 1e-4
"""[m] over the first 200 substeps, the project's target; both solvers compute in float32."""
SUBSTEPS = {2: 20, 3: 10}
"""Of one frame."""
# The correction of volumes is ours alone.
WATER, SAND = Water(volume_correction=False), Sand(volume_correction=False)
NEARBY = {
    WATER: [Water(volume_correction=False, tension=0.3), Water(volume_correction=False, bulk_modulus=3e5)],
    SAND: [
        Sand(volume_correction=False, friction_angle=44.0),
        Sand(volume_correction=False, poisson_ratio=0.22),
    ],
}
"""Materials so close to these that a comparison worth its name has to tell them apart."""


def collision(dim: int, material: Material) -> Scene:
    """Return two blocks that hit each other off centre in mid-air at 6 m/s, and fly apart."""
    left = Box(
        material=material,
        lower=(0.35, 0.5, 0.45)[:dim],
        upper=(0.47, 0.6, 0.55)[:dim],
        velocity=(3.0, 0.5, 0.0)[:dim],
    )
    right = Box(
        material=material,
        lower=(0.48, 0.54, 0.47)[:dim],
        upper=(0.6, 0.64, 0.57)[:dim],
        velocity=(-3.0, -0.5, 0.3)[:dim],
        seed=1,
    )
    return Scene(name="collision", dim=dim, bodies=(left, right))


def paths(simulator: Any, frames: int) -> np.ndarray:
    """Positions (frames, N, D) after each frame [m]."""
    states = []
    for _ in range(frames):
        simulator.advance(1)
        states.append(simulator.positions)
    return np.array(states)


def paths_of_baseline(package: str, solver: MpmSolver, frames: int) -> dict[str, np.ndarray]:
    """Positions (frames, N, D) after each frame [m] by each way of a baseline, from the state of a solver."""
    paths = {}
    scene, state = solver.scene, (solver.positions, solver.velocities, solver.affine, solver.volume_ratio)
    with baseline_process(package) as baseline:
        _, ways = baseline.start(scene, SUBSTEPS[solver.dim], state)
        # In 3D Taichi compiles each way for many seconds, and all add to the grid alike.
        for way in list(ways)[: None if solver.dim == 2 else 1]:
            baseline.restore(way)
            states = []
            for _ in range(frames):
                baseline.advance(way, 1)
                states.append(baseline.positions(way))
            paths[way] = np.array(states)
    return paths


# Each dimension and each material once.
BY_DEFAULT = {("taichi", 2, WATER), ("warp", 3, SAND)}


@pytest.mark.parametrize(
    ("package", "dim", "material"),
    [
        pytest.param(
            package, dim, material, id=f"{package}-{material.kind}-{dim}D",
            marks=() if (package, dim, material) in BY_DEFAULT else pytest.mark.long,
        )
        for package in ("taichi", "quadrants", "warp") for dim in (2, 3) for material in (WATER, SAND)
    ],
)  # fmt: skip
def test_same_positions(package: str, dim: int, material: Material) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"needs {package}: pip install --editable lab")
    scene, frames = collision(dim, material), 200 // SUBSTEPS[dim]
    solver = MpmSolver(scene, substeps=SUBSTEPS[dim])
    x, v = solver.positions, solver.velocities
    theirs = paths_of_baseline(package, solver, frames)
    volume_ratios = []
    ours = []
    for _ in range(frames):
        solver.advance()
        ours.append(solver.positions)
        volume_ratios.append(solver.volume_ratio)
    time = solver.time
    thrown = x + v * time + 0.5 * np.array(scene.gravity) * time**2

    # The blocks do hit each other, and far from the walls.
    assert np.min(volume_ratios) < 0.9
    assert material == SAND or np.max(volume_ratios) > 1.05
    assert np.abs(ours[-1] - thrown).mean() > 100 * TOLERANCE
    assert np.min(ours) > 0.1 + 3 * scene.dx
    assert np.max(ours) < 0.9 - 3 * scene.dx

    for path in theirs.values():
        assert np.abs(path - ours).max() < TOLERANCE
        for other in NEARBY[material]:
            nearby = paths(MpmSolver(collision(dim, other), substeps=SUBSTEPS[dim]), frames)
            assert np.abs(path - nearby).max() > TOLERANCE


def test_scenes_that_plain_solvers_cannot_simulate_are_refused() -> None:
    water = Ball(material="water", center=(0.3, 0.5), radius=0.05)
    sand, elastic = (Ball(material=name, center=(0.6, 0.5), radius=0.05) for name in ("sand", "elastic"))
    for bodies, named in (((water, sand), "got water, sand and 0"), ((elastic,), "got elastic and 0")):
        with pytest.raises(ConfigError, match=named):
            Constants(Scene(dim=2, bodies=bodies), 1)
    ramp = BoxObstacle(lower=(0.5, 0.1), upper=(0.6, 0.2))
    with pytest.raises(ConfigError, match="got water and 1 obstacles"):
        Constants(Scene(dim=2, bodies=(water,), obstacles=(ramp,)), 1)
    outside = Walls(lower=(0.0, 0.1), upper=(0.9, 0.9))
    with pytest.raises(ConfigError, match="three cells or more inside"):
        Constants(Scene(dim=2, bodies=(water,), walls=outside), 1)
