"""Matter faster than its sound speed: no inverted particle, a finding before, and torn bodies reported."""

import warnings

import numpy as np
import pytest

from hybridmpm import Ball, Box, BoxObstacle, Elastic, MpmSolver, Sand, Scene, TornBodyWarning, Water
from hybridmpm.checking import findings
from hybridmpm.mpm.tearing import largest_piece
from hybridmpm.scene import Material

pytestmark = pytest.mark.filterwarnings("ignore::hybridmpm.TornBodyWarning")


def thrown(material: Material, speed: float, seed: int = 0, dim: int = 2) -> Scene:
    center = (0.5 + 0.003 * seed, 0.4, 0.5)[:dim]
    velocity = (0.6 * speed, -0.8 * speed, 0.0)[:dim]
    ball = Ball(material=material, center=center, radius=0.1, velocity=velocity, seed=seed)
    return Scene(dim=dim, resolution=48 if dim == 2 else 24, gravity=(0,) * dim, bodies=[ball])


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    "material",
    [
        Water(),
        Water(bulk_modulus=2e4, tension=1.0),
        Sand(poisson_ratio=-0.8),
        Elastic(youngs_modulus=2e4),
        *[Elastic(poisson_ratio=ratio) for ratio in (-0.3, -0.7, -0.9)],
    ],
    ids=str,
)
def test_no_speed_of_a_scene_inverts_matter(material: Material, dim: int) -> None:
    for seed, speed in enumerate((15.0, 30.0, 50.0)):
        solver = MpmSolver(thrown(material, speed, seed, dim))
        solver.advance(40)
        assert solver.diagnostics().min_volume_ratio > 0


def test_an_auxetic_solid_stretches_as_theory_says() -> None:
    """A bar that is free across grows as wide as it gets long times -nu / (1 - nu), in plane strain."""
    scene = Scene(
        dim=2,
        resolution=64,
        gravity=(0, 0),
        bodies=[
            Box(
                material=Elastic(poisson_ratio=-0.5, density=1000),
                lower=(0.3, 0.45),
                upper=(0.7, 0.55),
            )
        ],
    )
    solver = MpmSolver(scene)
    x, y = solver.positions.T - 0.5
    # The lowest stretching wave of the bar, so slow that its sections stay in equilibrium across.
    force = np.stack([4.0 * np.sin(np.pi * x / 0.4), 0 * y], axis=1).astype(np.float32)
    widths, lengths = [], []
    for _ in range(12):
        solver.advance(1, force)
        a, b = solver.positions.T - 0.5
        middle = np.abs(x) < 0.05
        lengths.append(np.polyfit(x[middle], a[middle], 1)[0] - 1)
        widths.append(np.polyfit(y[middle], b[middle], 1)[0] - 1)
    assert np.mean(widths) / np.mean(lengths) == pytest.approx(1 / 3, rel=0.15)


@pytest.mark.parametrize(
    ("material", "low"), [(Water(), 0.3), (Sand(), 0.3), (Elastic(), 0.3), (Elastic(poisson_ratio=-0.6), 0.3)]
)
def test_a_finding_names_the_compression_that_an_impact_brings(material: Material, low: float) -> None:
    sound = material.to_native(1.0).sound_speed
    assert not findings(thrown(material, low * sound))
    scene = thrown(material, 0.7 * sound)
    (found,) = findings(scene)
    assert "0.7 of its sound speed" in found.problem
    assert found.field == "bodies[0]"
    told = int(found.problem.split("compresses it by ")[1].split("%")[0]) / 100
    solver, least = MpmSolver(scene), 1.0
    for _ in range(20):
        solver.advance(1)
        least = min(least, float(np.quantile(solver.volume_ratio, 0.1)))
    assert 1 - least == pytest.approx(told, abs=0.15)


def test_speeds_come_from_falls_emitters_obstacles_and_other_bodies() -> None:
    soft = {"kind": "water", "bulk_modulus": 2e4}
    jelly = {"kind": "elastic", "youngs_modulus": 2e4}
    box = {"shape": "box", "lower": [0.3, 0.1], "upper": [0.5, 0.2]}
    high = {"shape": "box", "lower": [0.3, 0.7], "upper": [0.5, 0.8]}
    steel = {"kind": "elastic", "density": 8000, "youngs_modulus": 1e8}

    def speeds(*bodies: dict[str, object], **more: object) -> list[str]:
        scene = Scene.parse({"dim": 2, "bodies": list(bodies), **more})
        return [
            f"{one.field}: {one.problem.split(',')[0]}" for one in findings(scene) if "hit" in one.problem
        ]

    assert speeds({**box, "material": soft}) == []
    assert speeds({**high, "material": soft}) == ["bodies[0]: water may hit something at 3.4 m/s"]
    assert speeds({**high, "material": soft}, gravity=[0, 9.81]) == []
    hit = speeds({**box, "material": jelly}, {**high, "material": steel, "velocity": [0, -5]})
    assert hit == ["bodies[0]: elastic may hit something at 6 m/s"]
    emitter = {"shape": "round", "center": [0.7, 0.7], "radius": 0.05, "velocity": [4, 0], "material": soft}
    assert speeds(emitters=[emitter], gravity=[0, 0]) == ["emitters[0]: water may hit something at 4 m/s"]
    paddle = {"shape": "box", "lower": [0.6, 0.5], "upper": [0.8, 0.54]}
    turning = {**paddle, "motion": {"angular_velocity": 20.0, "center": [0.7, 0.52]}}
    assert speeds({**box, "material": soft}, obstacles=[turning]) == []
    fast = {**paddle, "motion": {"velocity": [3.0, 0.0], "period": 1.0}}
    assert speeds({**box, "material": soft}, obstacles=[fast]) == [
        "bodies[0]: water may hit something at 3 m/s"
    ]


def test_a_torn_body_is_reported_once() -> None:
    scene = thrown(Elastic(youngs_modulus=1e4), 30.0)
    solver = MpmSolver(scene)
    with pytest.warns(
        TornBodyWarning, match=r"bodies\[0\] has come apart by frame 64: its largest piece has"
    ):
        solver.advance(64)
    assert solver.torn_bodies()[0] < 0.99
    told = [findings(thrown(Elastic(youngs_modulus=1e4), speed))[0].problem for speed in (9.0, 30.0)]
    assert ["tear it or end in an error" in one for one in told] == [False, True]
    slow = MpmSolver(thrown(Elastic(), 5.0))
    slow.advance(64)
    assert slow.torn_bodies() == {}
    assert MpmSolver(thrown(Water(), 5.0)).torn_bodies() == {}


def test_each_torn_body_is_reported_once() -> None:
    weak = Elastic(youngs_modulus=1e4)
    places = {(0.5, 0.395): (18.0, -24.0), (0.5, 0.605): (-18.0, 24.0)}
    bodies = [Ball(material=weak, center=x, radius=0.1, velocity=v) for x, v in places.items()]
    solver = MpmSolver(Scene(dim=2, resolution=48, gravity=(0, 0), bodies=bodies))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(4):
            solver.advance(64)
    texts = [str(one.message) for one in caught]
    assert sorted(text.split(" has come")[0] for text in texts) == ["bodies[0]", "bodies[1]"]
    assert sorted(solver.torn_bodies()) == [0, 1]


def test_a_body_that_an_obstacle_parts_from_the_start_is_not_torn() -> None:
    jelly = Box(material=Elastic(), lower=(0.2, 0.1), upper=(0.8, 0.2))
    wall = BoxObstacle(lower=(0.4, 0.1), upper=(0.6, 0.3))
    solver = MpmSolver(Scene(dim=2, resolution=48, bodies=[jelly], obstacles=[wall]))
    solver.advance(32)
    assert solver.torn_bodies() == {}


@pytest.mark.parametrize("dim", [2, 3])
def test_pieces_are_parted_by_three_cells_and_joined_over_one_and_a_half(dim: int) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        x = rng.uniform(0, 1, (300, dim)) * [1.0, *[0.1] * (dim - 1)]
        near, far = x.copy(), x.copy()
        near[:, 0] += np.where(x[:, 0] < 0.4, 0, 0.15 - 0.02)
        far[:, 0] += np.where(x[:, 0] < 0.4, 0, 0.31)
        assert largest_piece(near.astype(np.float32), 0.1) == 1
        assert largest_piece(far.astype(np.float32), 0.1) == pytest.approx((x[:, 0] >= 0.4).mean())
