"""Elastic bodies part from what they touch, at all settings of the library."""

import numpy as np
import pytest

from hybridmpm import Ball, Box, Elastic, MpmSolver, Scene, SceneError
from hybridmpm.scene import RectangularEmitter, Wall, WallFaces, Walls

WALLS = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))


def billiard(**settings: object) -> Scene:
    """Return a disc that flies at a resting one of the same material."""
    bodies = (
        Ball(material="elastic", center=(0.3, 0.5), radius=0.08, velocity=(1.0, 0.0)),
        Ball(material="elastic", center=(0.5, 0.5), radius=0.08),
    )
    return Scene.parse(
        {"dim": 2, "resolution": 64, "gravity": (0, 0), "walls": WALLS, "bodies": bodies} | settings
    )


def speeds(solver: MpmSolver, body: np.ndarray) -> list[float]:
    return [float(solver.velocities[body == one, 0].mean()) for one in (0, 1)]


def test_a_disc_hands_its_speed_to_one_at_rest() -> None:
    solver = MpmSolver(billiard())
    solver.advance(120)
    behind, ahead = speeds(solver, solver.scene.sample().body)
    assert ahead - behind > 0.8


def test_merged_particles_keep_their_bodies() -> None:
    """A quarter of the particles on half of the grid: the discs still part."""
    solver = MpmSolver(billiard(resolution=128), r_p=0.25)
    solver.advance(120)
    x, v = solver.positions[:, 0], solver.velocities[:, 0]
    middle = np.median(x)
    assert v[x > middle].mean() - v[x < middle].mean() > 0.75


@pytest.mark.parametrize(("friction", "spins"), [(0.0, False), (0.5, True)])
def test_friction_between_bodies_is_that_of_the_scene(friction: float, *, spins: bool) -> None:
    """A glancing disc sets the one at rest spinning by friction alone."""
    bodies = (
        Ball(material="elastic", center=(0.3, 0.56), radius=0.08, velocity=(1.0, 0.0)),
        Ball(material="elastic", center=(0.5, 0.5), radius=0.08),
    )
    scene = billiard(bodies=bodies, contact_friction=friction)
    assert Scene.from_json(scene.to_json()) == scene
    body = scene.sample().body
    solver = MpmSolver(scene)
    solver.advance(120)
    x, v = solver.positions[body == 1].astype(float), solver.velocities[body == 1].astype(float)
    x, v = x - x.mean(axis=0), v - v.mean(axis=0)
    spin = (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]).sum() / (x**2).sum()
    assert abs(spin) > 1.5 if spins else abs(spin) < 0.5, spin


def test_a_body_parts_from_what_an_emitter_brings() -> None:
    """Jelly that is let out beside a body of the same jelly does not drag it along."""
    jelly = Elastic()
    emitter = RectangularEmitter(
        material=jelly, lower=(0.5, 0.6), upper=(0.7, 0.6), velocity=(0.0, -1.0), stop=0.1
    )
    body = Box(material=jelly, lower=(0.3, 0.4), upper=(0.495, 0.6))
    solver = MpmSolver(billiard(bodies=(body,), emitters=(emitter,)))
    count = solver.particle_count
    solver.advance(60)
    assert solver.particle_count > count
    v = solver.velocities[:, 1]
    assert abs(v[:count].mean()) < 0.15
    assert v[count:].mean() < -0.7


def test_a_friction_out_of_range_is_refused() -> None:
    with pytest.raises(SceneError, match="contact_friction"):
        billiard(contact_friction=-0.1)


@pytest.mark.parametrize("place", [0.0, 0.2, 0.35, 0.6])
def test_a_disc_rolls_wherever_its_floor_lies_between_nodes(place: float) -> None:
    """Its path down 10 degrees is at least .9 of g sin(theta) t^2 / 3."""
    height, radius, theta = (13 + place) / 128, 0.06, np.radians(10)
    walls = Walls(lower=(0, height), upper=(1, 1), friction=1.0)
    material = Elastic(youngs_modulus=2e6, poisson_ratio=0.3)
    disc = Ball(material=material, center=(0.12, height + radius), radius=radius)
    gravity = (9.81 * np.sin(theta), -9.81 * np.cos(theta))
    solver = MpmSolver(Scene(dim=2, resolution=128, gravity=gravity, walls=walls, bodies=[disc]))
    solver.advance(160)
    path = solver.positions[:, 0].mean() - 0.12
    assert path > 0.9 * gravity[0] * solver.time**2 / 3


@pytest.mark.parametrize("place", [0.0, 0.3, 0.6])
def test_a_block_slides_on_an_elastic_slab_as_on_a_plane(place: float) -> None:
    """Its path down 25 degrees is at least .88 of Coulomb's. It rides up on no particles."""
    material, low = Elastic(youngs_modulus=2e6, poisson_ratio=0.3), 8 / 64
    top, theta, mu = low + (6 + place) / 64, np.radians(25), 0.2
    walls = Walls(lower=(0, low), upper=(1, 1), faces=WallFaces(y_lower=Wall(contact="sticky")))
    slab = Box(material=material, lower=(0.05, low), upper=(0.95, top))
    block = Box(material=material, lower=(0.12, top), upper=(0.27, top + 0.1))
    gravity = (9.81 * np.sin(theta), -9.81 * np.cos(theta))
    scene = Scene(
        dim=2, resolution=64, gravity=gravity, walls=walls, bodies=(slab, block), contact_friction=mu
    )
    is_block, solver = scene.sample().body == 1, MpmSolver(scene)
    start = solver.positions[is_block, 0].mean()
    solver.advance(220)
    path = solver.positions[is_block, 0].mean() - start
    assert path > 0.88 * (gravity[0] + mu * gravity[1]) * solver.time**2 / 2
