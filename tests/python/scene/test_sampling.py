"""Particles fill their bodies evenly, stay inside, and never share a place."""

import contextlib
import math

import numpy as np
import pytest

from hybridmpm import (
    Ball,
    BallObstacle,
    Box,
    BoxObstacle,
    ConfigError,
    Cylinder,
    CylinderObstacle,
    HalfSpaceObstacle,
    Motion,
    MpmSolver,
    Polygon,
    Scene,
    SceneError,
    Walls,
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
    assert particles.mass.sum() == pytest.approx(body.material.density * measure, rel=1e-5)
    np.testing.assert_allclose(particles.volume, (1 / 256) ** 2, rtol=0.05)


@pytest.mark.parametrize("case", range(24))
def test_a_body_has_its_mass_wherever_it_lies(case: int) -> None:
    """Boxes from an eighth of a spacing, balls, cylinders; obstacles and earlier bodies take their share."""
    rng = np.random.default_rng(case)
    dim = 2 + case % 2
    center, half = rng.uniform(0.4, 0.6, dim), 10 ** rng.uniform(-3.3, -1, dim)
    start, end = (tuple((center + side * half).tolist()) for side in (-1, 1))
    body: Body = (
        Box(material="water", lower=start, upper=end),
        Ball(material="water", center=tuple(center), radius=half[0]),
        Cylinder(material="water", start=start, end=end, radius=0.01 + half[0]),
    )[case // 2 % dim]
    scene = Scene(dim=dim, resolution=64 if dim == 2 else 24, bodies=(body,))
    particles = scene.sample()
    assert particles.mass.sum() == pytest.approx(1000 * body.measure, rel=1e-5)
    if isinstance(body, Box):
        # Its centre of mass is in its middle, but for the jitter.
        assert (np.abs(particles.x.mean(axis=0) - center) < half / np.sqrt(len(particles.x))).all()
    # A wall over the lower half along the first axis, by an obstacle or by a body that was there before.
    beside = (np.full(dim, 0.1), np.concatenate([center[:1], np.full(dim - 1, 0.9)]))
    block = BoxObstacle(lower=tuple(beside[0]), upper=tuple(beside[1]))
    other = Box(material="sand", lower=tuple(beside[0]), upper=tuple(beside[1]))
    for cut in (
        scene.model_copy(update={"obstacles": (block,)}),
        scene.model_copy(update={"bodies": (other, body)}),
    ):
        with contextlib.suppress(SceneError):  # a body of one site in the middle has no room beside it
            left = cut.sample()
            kept = left.mass[left.body == left.body.max()].sum()
            assert kept == pytest.approx(500 * body.measure, rel=0.01)


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
    lower, upper = star_body.bounds
    inside = star_body.contains(np.random.default_rng(0).uniform(lower, upper, (200_000, 2))).mean()
    assert star_body.measure == pytest.approx(inside * np.prod(upper - lower), rel=0.01)
    assert star_body.contains(np.array([[0.5, 0.75]]))[0]


def test_a_polygon_around_several_lines_has_holes_and_parts() -> None:
    """A ring that holds an island, and a part beside it; the ways between the lines enclose nothing."""
    squares = [(0.4, 0.5, 0.2), (0.4, 0.5, 0.15), (0.4, 0.5, 0.05), (0.8, 0.3, 0.08)]
    lines = [
        np.array([[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])
        for x, y, half in squares
    ]
    body = Polygon.around(lines, material="water", velocity=(1.0, 0.0), seed=4)
    assert Polygon.model_validate(body.model_dump()) == body
    area = 4 * (0.2**2 - 0.15**2 + 0.05**2 + 0.08**2)
    assert body.measure == pytest.approx(area, rel=1e-9)
    # The last points lie on the way from one line to another.
    way = lines[0][0] + np.linspace(0.01, 0.99, 99)[:, None] * (lines[3][0] - lines[0][0])
    x = np.concatenate([np.random.default_rng(1).random((4000, 2)), way])
    around = sum((np.abs(x - (across, up)) < half).all(axis=1).astype(int) for across, up, half in squares)
    np.testing.assert_array_equal(body.contains(x), np.asarray(around) % 2 == 1)
    particles = Scene(dim=2, bodies=(body,)).sample()
    assert particles.mass.sum() == pytest.approx(1000 * area, rel=1e-5)
    assert len(particles.x) == pytest.approx(area / Scene(dim=2, bodies=(body,)).spacing ** 2, rel=0.02)
    # Four strokes of 0.05 m and two squares: a rectangle with this area and outline is thinner than they are.
    assert 0.03 < body.smallest_extent < 0.06


@pytest.mark.needs("contourpy", "shapes")
def test_texts_and_pictures_are_bodies_with_the_mass_of_their_area() -> None:
    from hybridmpm.control import shape_of_picture, shape_of_text

    row, column = np.mgrid[-100:101, -100:101]
    ring = np.where((row**2 + column**2 < 90**2) & (row**2 + column**2 > 40**2), 0.0, 1.0)
    word = shape_of_text("8i", (0.3, 0.4), 0.3)
    logo = shape_of_picture(ring, (0.7, 0.4), 0.3)
    bodies = [Polygon.around(shape.outlines, material="sand") for shape in (word, logo)]
    scene = Scene(dim=2, resolution=64, bodies=tuple(bodies))
    assert Scene.from_json(scene.to_json()) == scene
    particles = scene.sample()
    mass = np.bincount(particles.body, particles.mass)
    np.testing.assert_allclose(mass, [1600 * shape.area for shape in (word, logo)], rtol=5e-4)
    # The dark pixels, 179 of which are as high as the picture of the ring.
    assert mass[1] == pytest.approx(1600 * (ring == 0).sum() * (0.3 / 179) ** 2, rel=0.002)
    assert not bodies[1].contains(np.array([[0.7, 0.4]]))[0]


def test_lines_that_are_no_outlines_are_refused() -> None:
    for lines, text in (
        ([], "at least one line"),
        ([ELL, ELL[:2]], r"outlines\[1\] must have shape \(K, 2\)"),
        ([ELL] * 200, "1598 points .* at most 1000"),
    ):
        with pytest.raises(ConfigError, match=text):
            Polygon.around(lines, material="water")


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
    buried = BoxObstacle(lower=(0.1, 0.1), upper=(0.3, 0.3))
    with pytest.raises(SceneError, match=r"bodies\[0\]: has room for no particle"):
        Scene(dim=2, bodies=(speck,), obstacles=(buried,)).sample()
    twin = Box(material="water", lower=(0.2, 0.2), upper=(0.3, 0.3))
    with pytest.raises(SceneError, match=r"bodies\[1\]: has room for no particle"):
        Scene(dim=2, bodies=(twin, twin)).sample()
    # 5.5 spacings wide, so about 30 particles by its area, but of 6 x 6 sites.
    wide = Box(material="water", lower=(0.25, 0.25), upper=(0.25 + 5.51 / 256, 0.25 + 5.51 / 256))
    scene = Scene(dim=2, bodies=(wide,), max_particles=31)
    with pytest.raises(SceneError, match=r"bodies: need 36 or more particles, allowed are \[1, 31\]"):
        scene.sample()


def test_a_scene_far_above_its_limit_is_refused_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sheet far thinner than a spacing has a small volume and 671 000 sites."""
    sheet = Box(material="water", lower=(0.1, 0.1, 0.1), upper=(0.9, 0.9, 0.10001))
    scene = Scene(dim=3, resolution=512, bodies=(sheet,))
    looked_at = 0
    contains = Box.contains

    def counted(body: Box, x: np.ndarray) -> np.ndarray:
        nonlocal looked_at
        looked_at += len(x)
        return contains(body, x)

    monkeypatch.setattr(Box, "contains", counted)
    with pytest.raises(SceneError, match=r"bodies: need \d+ or more particles, allowed are \[1, 200000\]"):
        scene.sample()
    assert looked_at < 500_000


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
    particles = scene.sample()
    assert particles.volume.sum() == pytest.approx(body.measure, rel=1e-5)
    assert len(particles.x) * scene.spacing**3 == pytest.approx(body.measure, rel=0.05)
    x = particles.x
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


@pytest.mark.parametrize(("dim", "radius"), [(2, 0.06), (3, 0.04)])
def test_elastic_balls_are_round(dim: int, radius: float) -> None:
    ball = Ball(material="elastic", center=(0.5,) * dim, radius=radius)
    scene = Scene(dim=dim, resolution=64, bodies=(ball, ball.model_copy(update={"center": (0.2,) * dim})))
    particles = scene.sample()
    x = particles.x[particles.body == 0].astype(float) - 0.5
    rings = max(1, round(radius / scene.spacing))
    away = np.linalg.norm(x, axis=1)
    assert away.max() == pytest.approx((1 - 0.5 / rings) * radius, abs=1e-6)
    # Whole rings: as many particles as the volume has sites, in balance, and none beside another.
    assert len(x) == pytest.approx(ball.measure / scene.spacing**dim, rel=0.1)
    assert np.abs(x.mean(axis=0)).max() < 0.01 * scene.spacing
    apart = np.sort(np.linalg.norm(x[:, None] - x, axis=-1), axis=1)
    assert apart[:, 1].min() > 0.7 * scene.spacing
    turned = ball.model_copy(update={"seed": 1})
    assert not np.array_equal(
        particles.x[: len(x)], scene.model_copy(update={"bodies": (turned,)}).sample().x
    )
