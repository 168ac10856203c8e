"""Pictures show the particles where they are, in their colours, and nothing through obstacles."""

import numpy as np
import pytest

from hybridmpm import Ball, BallObstacle, Box, BoxObstacle, ConfigError, MpmSolver, Scene, Walls
from hybridmpm.render import view_of
from hybridmpm.render.palette import by_speed


def disc(material: str, center: tuple[float, ...]) -> Scene:
    return Scene(dim=len(center), bodies=(Ball(material=material, center=center, radius=0.12),))


def picture(scene: Scene, width: int = 200) -> np.ndarray:
    particles = scene.sample()
    return view_of(scene, particles.types, width).draw(particles.x, particles.v).astype(int)


def empty(scene: Scene, width: int = 200) -> np.ndarray:
    """Return the picture without particles."""
    none = np.empty((0, scene.dim), dtype=np.float32)
    return view_of(scene, np.empty(0, dtype=np.uint8), width).draw(none, none).astype(int)


@pytest.mark.parametrize("width", [64, 101, 300])
@pytest.mark.parametrize("center", [(0.5, 0.5), (0.5, 0.5, 0.5)])
def test_sizes_are_even(width: int, center: tuple[float, ...]) -> None:
    image = picture(disc("water", center), width)
    assert image.shape[1] == width + width % 2
    assert image.shape[0] % 2 == 0
    assert image.shape[2] == 3


def test_shape_follows_the_walls() -> None:
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 0.25))
    scene = Scene(dim=2, walls=walls, bodies=(Box(material="water", lower=(0, 0), upper=(0.1, 0.1)),))
    height, width, _ = picture(scene, 400).shape
    assert height / width == pytest.approx(0.31 / 1.06, abs=0.01)


@pytest.mark.parametrize("center", [(0.35, 0.65), (0.7, 0.3)])
def test_flat_pictures_cover_the_disc_and_only_it(center: tuple[float, float]) -> None:
    scene = disc("water", center)
    covered = np.abs(picture(scene) - empty(scene)).sum(axis=-1) > 60
    rows, columns = np.nonzero(covered)
    scale = 200 / 0.848  # walls of 0.8 m and a margin of 3 % on each side
    x, y = 0.1 - 0.024 + (columns + 0.5) / scale, 0.9 + 0.024 - (rows + 0.5) / scale
    assert (x.mean(), y.mean()) == pytest.approx(center, abs=2e-3)
    assert covered.sum() / scale**2 == pytest.approx(np.pi * 0.12**2, rel=0.1)


@pytest.mark.parametrize("dim", [2, 3])
def test_materials_are_told_apart(dim: int) -> None:
    hues = {}
    for material in ("water", "sand", "elastic"):
        scene = disc(material, (0.5,) * dim)
        image, background = picture(scene), empty(scene)
        changed = np.abs(image - background).sum(axis=-1) > 90
        hues[material] = int(np.median(image[changed].argmax(axis=-1)))
    assert hues == {"water": 2, "sand": 0, "elastic": 1}


@pytest.mark.parametrize("kind", [5, 6, 7])
def test_fast_is_brighter_than_slow(kind: int) -> None:
    ramp = by_speed(kind, np.linspace(0.0, 5.0, 20)).sum(axis=-1)
    assert (np.diff(ramp) >= 0).all()
    assert ramp[-1] > 1.3 * ramp[0]


def test_obstacles_hide_what_is_behind_them_in_2d() -> None:
    obstacle = BoxObstacle(lower=(0.4, 0.4), upper=(0.6, 0.6))
    plain = Scene(dim=2, bodies=(Ball(material="water", center=(0.2, 0.2), radius=0.02),))
    scene = plain.model_copy(update={"obstacles": (obstacle,)})
    image, without = empty(scene), empty(plain)
    assert (image[100, 100] != without[100, 100]).any()
    covered = np.abs(image - without).sum(axis=-1) > 60
    assert covered.sum() / (200 / 0.848) ** 2 == pytest.approx(0.04, rel=0.1)
    on_it = np.full((1, 2), 0.5, dtype=np.float32)
    drawn = view_of(scene, np.array([5], dtype=np.uint8), 200).draw(on_it, on_it)
    np.testing.assert_array_equal(drawn, image)


def test_near_hides_far_in_3d() -> None:
    """The eye is in front (large z), above, to the right: of two balls in line the near one is seen."""
    obstacle = BallObstacle(center=(0.5, 0.5, 0.5), radius=0.1)
    scene = disc("sand", (0.3, 0.3, 0.3)).model_copy(update={"obstacles": (obstacle,)})
    background = empty(scene)
    toward = np.array([0.498, 0.342, 0.797])  # of the camera's angles, 32 and 20 degrees
    for sign, seen in ((1, True), (-1, False)):
        x = (np.full(3, 0.5) + sign * 0.25 * toward)[None].astype(np.float32)
        drawn = view_of(scene, np.array([6], dtype=np.uint8), 200).draw(x, 0 * x)
        middle = np.s_[40:110, 60:140]
        changed = np.abs(drawn.astype(int) - background)[middle].sum(axis=-1).max()
        assert (changed > 30) == seen


def test_shadow_lies_under_the_fluid_in_3d() -> None:
    scene = disc("water", (0.5, 0.5, 0.5))
    darker = (picture(scene).sum(axis=-1) - empty(scene).sum(axis=-1)) < -20
    rows, _ = np.nonzero(darker)
    assert darker.sum() > 100
    assert rows.mean() > 100


def test_out_of_sight_is_no_error() -> None:
    for dim in (2, 3):
        scene = disc("water", (0.5,) * dim)
        x = np.full((1, dim), -3.0, dtype=np.float32)
        drawn = view_of(scene, np.array([5], dtype=np.uint8), 100).draw(x, 0 * x)
        assert drawn.shape[1] == 100


@pytest.mark.parametrize("width", [63, 4097, -1])
def test_bad_width(width: int) -> None:
    with pytest.raises(ConfigError, match=rf"width must be in \[64, 4096\] pixels, got {width}"):
        view_of(disc("water", (0.5, 0.5)), np.empty(0, dtype=np.uint8), width)


def test_merged_particles_are_drawn_as_large_as_they_are() -> None:
    block = Box(lower=(0.3, 0.3), upper=(0.6, 0.6), material="water")
    scene = Scene(dim=2, resolution=64, bodies=[block])
    covered = []
    for r_p in (1.0, 1 / 8):
        solver = MpmSolver(scene, r_p=r_p)
        view = view_of(scene, solver.materials, 120, solver.particle_spacing)
        drawn = view.draw(solver.positions, solver.velocities).astype(int)
        covered.append(float((np.abs(drawn - empty(scene, 120)).max(axis=2) > 40).mean()))
    assert covered[0] == pytest.approx(0.3**2 / 0.848**2, rel=0.1)
    assert covered[1] == pytest.approx(covered[0], rel=0.1)
