"""Particles fill their bodies evenly, stay inside, and never share a place."""

import math

import numpy as np
import pytest

from hybridmpm import (
    Ball,
    BallObstacle,
    Box,
    BoxObstacle,
    Cylinder,
    CylinderObstacle,
    HalfSpaceObstacle,
    Motion,
    MpmSolver,
    Polygon,
    Scene,
    SceneError,
    Walls,
    Water,
    metrics,
)
from hybridmpm.scene import Body

ELL = ((0.2, 0.2), (0.6, 0.2), (0.6, 0.3), (0.3, 0.3), (0.3, 0.6), (0.2, 0.6))


@pytest.mark.parametrize(
    ("body", "measure"),
    [
        (Box(material="water", lower=(0.1, 0.1), upper=(0.4, 0.9)), 0.24),
        (Ball(material="sand", center=(0.5, 0.5), radius=0.2), np.pi * 0.04),
        (Polygon(material="elastic", vertices=ELL), 0.07),
    ],
)
def test_mass_is_density_times_measure(body: Body, measure: float) -> None:
    particles = Scene(dim=2, bodies=(body,)).sample()
    assert body.measure == pytest.approx(measure)
    # To a layer of sites at the surface: the lattice does not end where the body does.
    assert particles.mass.sum() == pytest.approx(1000 * measure, rel=0.03)
    np.testing.assert_allclose(particles.volume, (1 / 256) ** 2, rtol=1e-6)


def test_ball_in_3d() -> None:
    ball = Ball(material=Water(density=500), center=(0.5, 0.5, 0.5), radius=0.2)
    assert ball.measure == pytest.approx(4 / 3 * np.pi * 0.008)
    particles = Scene(dim=3, bodies=(ball,)).sample()
    assert particles.mass.sum() == pytest.approx(500 * ball.measure, rel=0.01)


@pytest.mark.parametrize(
    "body",
    [
        Box(material="water", lower=(0.1, 0.1), upper=(0.1 + 1e-2, 0.9), seed=1),
        Ball(material="water", center=(0.5, 0.5), radius=0.4, seed=2),
        Polygon(material="water", vertices=ELL, seed=3),
    ],
)
def test_strictly_inside_body_and_walls(body: Body) -> None:
    scene = Scene(dim=2, bodies=(body,))
    x = scene.sample().x.astype(np.float64)
    assert body.contains(x).all()
    assert ((x > scene.walls.lower) & (x < scene.walls.upper)).all()


def test_polygon_by_the_even_odd_rule() -> None:
    """A five-pointed star drawn in one stroke is hollow in its middle."""
    angles = np.pi / 2 + np.arange(5) * 4 * np.pi / 5
    star = tuple((0.5 + 0.3 * float(np.cos(a)), 0.5 + 0.3 * float(np.sin(a))) for a in angles)
    star_body = Polygon(material="water", vertices=star)
    assert not star_body.contains(np.array([[0.5, 0.5]]))[0]
    assert star_body.contains(np.array([[0.5, 0.75]]))[0]


def test_a_polygon_is_where_a_count_of_crossings_says() -> None:
    """Against the rule written down plainly, with horizontal edges and points at the height of a corner."""
    rng = np.random.default_rng(5)
    corners = rng.integers(1, 9, (30, 2)) / 10
    corners[3, 1], corners[17, 1] = corners[2, 1], corners[16, 1]
    points = np.concatenate([rng.random((2000, 2)), corners[:, ::-1], np.add(corners, (0.0123, 0.0))])
    expected = []
    for x, y in points:
        crossings = 0
        for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if min(ay, by) <= y < max(ay, by):
                crossings += x < ax + (y - ay) * (bx - ax) / (by - ay)
        expected.append(crossings % 2 == 1)
    body = Polygon(material="water", vertices=tuple(map(tuple, corners.tolist())))
    np.testing.assert_array_equal(body.contains(points), expected)
    assert 0.1 < np.mean(expected) < 0.9


def test_neighbours_keep_half_a_spacing() -> None:
    scene = Scene(dim=2, bodies=(Box(material="water", lower=(0.2, 0.2), upper=(0.3, 0.3)),))
    x = scene.sample().x.astype(np.float64)
    distance = np.linalg.norm(x[:, None] - x[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    assert distance.min() > 0.49 * scene.spacing


def test_seed_moves_the_jitter_only() -> None:
    def positions(seed: int) -> np.ndarray:
        return (
            Scene(dim=2, bodies=(Box(material="water", lower=(0.2, 0.2), upper=(0.3, 0.3), seed=seed),))
            .sample()
            .x
        )

    np.testing.assert_array_equal(positions(5), positions(5))
    assert positions(5).shape == positions(6).shape
    assert (positions(5) != positions(6)).any()


def test_the_earlier_body_keeps_its_place() -> None:
    first = Box(material="sand", lower=(0.2, 0.2), upper=(0.4, 0.4))
    second = Ball(material="water", center=(0.4, 0.4), radius=0.1)
    alone = Scene(dim=2, bodies=(first,)).sample()
    both = Scene(dim=2, bodies=(first, second)).sample()
    np.testing.assert_array_equal(both.x[: len(alone.x)], alone.x)
    later = both.x[both.body == 1].astype(np.float64)
    # Half a spacing is the farthest that a site reaches over the edge of the body that owns its centre.
    shrunk = Box(material="sand", lower=(0.2, 0.2), upper=(0.4 - 0.002, 0.4 - 0.002))
    assert not shrunk.contains(later).any()
    assert both.types[: len(alone.x)].tolist() == [6] * len(alone.x)
    assert set(both.types[len(alone.x) :].tolist()) == {5}


@pytest.mark.parametrize(
    "obstacle",
    [
        BallObstacle(center=(0.4, 0.4), radius=0.1),
        BoxObstacle(lower=(0.35, 0.2), upper=(0.9, 0.9)),
        HalfSpaceObstacle(point=(0.4, 0.4), normal=(1.0, 2.0)),
    ],
)
def test_obstacles_stay_empty(obstacle: BallObstacle | BoxObstacle | HalfSpaceObstacle) -> None:
    box = Box(material="water", lower=(0.2, 0.2), upper=(0.5, 0.5))
    free = Scene(dim=2, bodies=(box,)).sample()
    cut = Scene(dim=2, bodies=(box,), obstacles=(obstacle,)).sample()
    assert (obstacle.to_native().signed_distance(cut.x) > 0).all()
    outside = (obstacle.to_native().signed_distance(free.x) > 0).sum()
    assert len(cut.x) == pytest.approx(outside, rel=0.03)


def test_no_room_and_too_many() -> None:
    speck = Box(material="water", lower=(0.2, 0.2), upper=(0.2001, 0.2001))
    with pytest.raises(SceneError, match=r"bodies\[0\]: has room for no particle"):
        Scene(dim=2, bodies=(speck,)).sample()
    twin = Box(material="water", lower=(0.2, 0.2), upper=(0.3, 0.3))
    with pytest.raises(SceneError, match=r"bodies\[1\]: has room for no particle"):
        Scene(dim=2, bodies=(twin, twin)).sample()
    # 5.2 spacings wide, so about 27 particles by its area, but it holds the centres of 6 x 6 sites.
    grazing = Box(material="water", lower=(64.4 / 256, 64.4 / 256), upper=(69.6 / 256, 69.6 / 256))
    scene = Scene(dim=2, bodies=(grazing,), max_particles=30)
    with pytest.raises(SceneError, match=r"bodies: need 36 or more particles, allowed are \[1, 30\]"):
        scene.sample()


def test_a_scene_far_above_its_limit_is_refused_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """The outline crosses itself, so its area is no warning; filling it would take 5 million particles."""
    bow = Polygon(material="water", vertices=((0.1, 0.1), (0.9, 0.9), (0.9, 0.1), (0.1, 0.9)))
    scene = Scene(dim=2, resolution=1024, particles_per_cell=16, bodies=(bow,))
    looked_at = 0
    contains = Polygon.contains

    def counted(body: Polygon, x: np.ndarray) -> np.ndarray:
        nonlocal looked_at
        looked_at += len(x)
        return contains(body, x)

    monkeypatch.setattr(Polygon, "contains", counted)
    with pytest.raises(SceneError, match=r"bodies: need \d+ or more particles, allowed are \[1, 200000\]"):
        scene.sample()
    assert looked_at < 1_000_000


def test_records_agree() -> None:
    scene = Scene(
        dim=2,
        walls=Walls(lower=(0, 0), upper=(1, 1)),
        bodies=(
            Box(material="water", lower=(0, 0), upper=(0.1, 0.1), velocity=(1, 2)),
            Ball(material={"kind": "elastic", "density": 400}, center=(0.9, 0.9), radius=0.1),
        ),
    )
    particles = scene.sample()
    count = len(particles.x)
    assert particles.x.shape == particles.v.shape == (count, 2)
    assert [
        array.shape for array in (particles.material, particles.types, particles.body, particles.mass)
    ] == [(count,)] * 4
    assert particles.x.dtype == particles.v.dtype == particles.mass.dtype == np.float32
    first = particles.body == 0
    assert (particles.v[first] == (1, 2)).all()
    assert (particles.v[~first] == 0).all()
    assert (particles.types[~first] == 7).all()
    assert (particles.material == particles.body).all()
    np.testing.assert_allclose(particles.mass[~first] / particles.volume[~first], 400, rtol=1e-6)


@pytest.mark.parametrize(
    ("start", "end"), [((0.5, 0.1, 0.5), (0.5, 0.4, 0.5)), ((0.3, 0.3, 0.4), (0.6, 0.5, 0.6))]
)
def test_a_body_is_filled_to_its_volume(start: tuple[float, ...], end: tuple[float, ...]) -> None:
    body = Cylinder(material="sand", start=start, end=end, radius=0.1)
    scene = Scene(dim=3, bodies=(body,))
    length = math.dist(start, end)
    assert body.measure == pytest.approx(math.pi * 0.01 * length)
    x = scene.sample().x
    assert len(x) * scene.spacing**3 == pytest.approx(body.measure, rel=0.02)
    lower, upper = body.bounds
    assert (x > lower).all()
    assert (x < upper).all()
    along = (np.array(end) - start) / length
    away = (x - start) - ((x - start) @ along)[:, None] * along
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(0.1, abs=scene.spacing)
    # The bounding box is tight: slightly larger cylinders reach out of it.
    assert (lower - (np.minimum(start, end) - 0.1)).min() >= -1e-12


def test_both_are_for_space_alone() -> None:
    flat = {"material": "water", "start": (0.3, 0.3), "end": (0.5, 0.3), "radius": 0.05}
    with pytest.raises(
        SceneError, match=r"bodies\[0\].shape: cylinder is for dim 3 only; dim 2 allows box, ball"
    ):
        Scene(dim=2, bodies=(Cylinder(**flat),))
    post = CylinderObstacle(start=(0.3, 0.3), end=(0.5, 0.3), radius=0.05)
    water = Box(material="water", lower=(0.2, 0.5), upper=(0.4, 0.6))
    with pytest.raises(SceneError, match=r"obstacles\[0\].shape: cylinder is for dim 3 only"):
        Scene(dim=2, bodies=(water,), obstacles=(post,))
    with pytest.raises(SceneError, match="end: must differ from start"):
        CylinderObstacle(start=(0.3, 0.3, 0.3), end=(0.3, 0.3, 0.3), radius=0.05)


@pytest.mark.parametrize("turns", [False, True])
def test_nothing_enters_a_post(*, turns: bool) -> None:
    motion = Motion(angular_velocity=(0.0, 0.0, 4.0), center=(0.5, 0.25, 0.5)) if turns else None
    post = CylinderObstacle(start=(0.35, 0.25, 0.5), end=(0.65, 0.25, 0.5), radius=0.07, motion=motion)
    water = Box(material="water", lower=(0.4, 0.4, 0.4), upper=(0.6, 0.55, 0.6), velocity=(0, -2, 0))
    scene = Scene(dim=3, resolution=40, bodies=(water,), obstacles=(post,))
    solver = MpmSolver(scene)
    path = solver.rollout(80)
    assert metrics.penetration_count(scene, path, tolerance=1e-4).max() == 0
    assert path[-1][:, 1].min() < 0.2
    assert "<ellipse" in scene._repr_html_()


def test_a_thin_post_is_warned_of() -> None:
    post = CylinderObstacle(start=(0.5, 0.1, 0.5), end=(0.5, 0.105, 0.5), radius=0.07)
    body = Cylinder(material="sand", start=(0.5, 0.2, 0.5), end=(0.5, 0.4, 0.5), radius=0.1)
    scene = Scene(dim=3, bodies=(body,), obstacles=(post,))
    assert "0.005 m thick" in scene.thin_obstacles()[0]
