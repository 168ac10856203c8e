"""Our solver against MLS-MPM in plain Taichi: the same start, substeps and constants give the same positions.

The scenes stay away from the walls, which the two treat differently by design: ours act at their true
position, Taichi's at the nodes at or beyond it.
"""

from typing import Any

import numpy as np
import pytest

from hybridmpm import Ball, Box, BoxObstacle, ConfigError, MpmSolver, Scene, Walls
from hybridmpm.scene import Material, Sand, Water

taichi_mpm = pytest.importorskip(
    "hybridmpm.bench.peers.taichi_mpm", reason="needs Taichi: pip install 'hybridmpm[bench]'"
)

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


# Taichi compiles each pair for seconds: by default each dimension and each material is met once.
@pytest.mark.parametrize(
    ("dim", "settings", "material"),
    [
        pytest.param(2, tuple(taichi_mpm.SETTINGS), WATER, id="water-2D"),
        pytest.param(3, ("serial",), SAND, id="sand-3D"),
        pytest.param(2, tuple(taichi_mpm.SETTINGS), SAND, id="sand-2D", marks=pytest.mark.long),
        pytest.param(3, ("serial",), WATER, id="water-3D", marks=pytest.mark.long),
    ],
)
def test_same_positions(dim: int, settings: tuple[str, ...], material: Material) -> None:
    scene, frames = collision(dim, material), 200 // SUBSTEPS[dim]
    solver = MpmSolver(scene, substeps=SUBSTEPS[dim])
    x, v = solver.positions, solver.velocities
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

    taichi_mpm.start()
    for setting in settings:
        theirs = paths(taichi_mpm.TaichiMpm(scene, substeps=SUBSTEPS[dim], setting=setting), frames)
        assert np.abs(theirs - ours).max() < TOLERANCE
    for other in NEARBY[material]:
        nearby = paths(MpmSolver(collision(dim, other), substeps=SUBSTEPS[dim]), frames)
        assert np.abs(theirs - nearby).max() > TOLERANCE


def test_scenes_that_the_peer_lacks_are_refused() -> None:
    water = Ball(material="water", center=(0.3, 0.5), radius=0.05)
    sand, elastic = (Ball(material=name, center=(0.6, 0.5), radius=0.05) for name in ("sand", "elastic"))
    for bodies, named in (((water, sand), "got water, sand and 0"), ((elastic,), "got elastic and 0")):
        with pytest.raises(ConfigError, match=named):
            taichi_mpm.TaichiMpm(Scene(dim=2, bodies=bodies), substeps=20, setting="serial")
    ramp = BoxObstacle(lower=(0.5, 0.1), upper=(0.6, 0.2))
    with pytest.raises(ConfigError, match="got water and 1 obstacles"):
        taichi_mpm.TaichiMpm(Scene(dim=2, bodies=(water,), obstacles=(ramp,)), substeps=20, setting="serial")
    outside = Walls(lower=(0.0, 0.1), upper=(0.9, 0.9))
    with pytest.raises(ConfigError, match="three cells or more inside"):
        taichi_mpm.TaichiMpm(Scene(dim=2, bodies=(water,), walls=outside), substeps=20, setting="serial")
