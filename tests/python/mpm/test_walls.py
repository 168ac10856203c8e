"""Walls act alike wherever they lie between the nodes of the grid."""

import numpy as np
import pytest
from tests.python.conftest import native_solver

from hybridmpm import Box, ConfigError, Elastic, MpmSolver, Scene, SceneError, SnapshotError, _native
from hybridmpm.scene import Walls

DX = 1 / 64


def distance_at_contact(material: str, phase: float, *, upper: bool) -> float:
    """Return how far from a wall [cells] the nearest particle is when a body first feels it.

    The wall lies `phase` cells above a node.
    """
    wall = ((57 if upper else 7) + phase) * DX
    away = -1 if upper else 1
    faces = sorted((wall + away * 3 * DX, wall + away * 13 * DX))
    body = Box(material=material, lower=(0.4, faces[0]), upper=(0.6, faces[1]), velocity=(0.0, -0.8 * away))
    walls = Walls(lower=(0.1, 0.1 if upper else wall), upper=(0.9, wall if upper else 0.9))
    scene = Scene(dim=2, resolution=64, bodies=(body,), walls=walls, gravity=(0.0, 0.0))
    solver = MpmSolver(scene)
    while True:
        x = solver.positions[:, 1]
        solver.advance(1)
        if (np.abs(solver.velocities[:, 1]) < 0.78).any():
            return float(np.abs(x - wall).min() / DX)


@pytest.mark.parametrize("material", ["water", "sand"])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_material_touches_a_wall_at_one_distance(material: str, side: str) -> None:
    distances = [
        distance_at_contact(material, phase, upper=side == "upper") for phase in np.arange(0, 1, 0.1)
    ]
    # A frame moves the body by an eighth of a cell; the jitter and the lattice do the rest.
    assert max(distances) - min(distances) < 0.3, distances
    assert 0.2 < np.mean(distances) < 0.9


def gained_on(face: str, faces: dict[str, object], *, dim: int = 2, **walls: object) -> float:
    """Pull a block onto a wall by 9.81 m/s^2 and along it by 3 m/s^2; return its acceleration along it."""
    axis, inward = "xyz".index(face[0]), 1.0 if face.endswith("lower") else -1.0
    along = (axis + 1) % dim
    gravity, lower, upper = np.zeros(dim), np.full(dim, 0.2), np.full(dim, 0.4)
    gravity[axis], gravity[along] = -9.81 * inward, 3.0
    lower[axis], upper[axis] = (0.1, 0.2) if inward > 0 else (0.8, 0.9)
    jelly = Elastic(youngs_modulus=1e6, wall_friction=0.9)
    scene = Scene.model_validate(
        {
            "dim": dim,
            "resolution": 48 if dim == 2 else 24,
            "gravity": tuple(gravity),
            "walls": {"lower": (0.1,) * dim, "upper": (0.9,) * dim, "faces": faces, **walls},
            "bodies": ({"shape": "box", "material": jelly, "lower": tuple(lower), "upper": tuple(upper)},),
        }
    )
    solver = MpmSolver(scene)
    solver.advance(100)  # it lands
    early = np.mean(solver.velocities[:, along])
    solver.advance(60)
    return float(np.mean(solver.velocities[:, along]) - early) / 0.15


@pytest.mark.parametrize(
    ("face", "dim"),
    [
        *((f"{axis}_{side}", 2) for axis in "xy" for side in ("lower", "upper")),
        ("z_upper", 3),
        ("y_lower", 3),
    ],
)
def test_one_wall_rubs_and_the_others_do_as_they_are_told(face: str, dim: int) -> None:
    rough = {face: {"contact": "separating", "friction": 0.2}}
    assert gained_on(face, rough, dim=dim, contact="sticky") == pytest.approx(3 - 0.2 * 9.81, abs=0.1)
    smooth = {face: {"contact": "slip"}}
    assert gained_on(face, smooth, dim=dim, friction=0.5) == pytest.approx(3.0, abs=0.05)


def test_what_a_wall_leaves_out_is_that_of_all_walls() -> None:
    assert gained_on("y_lower", {"x_lower": {"friction": 0.0}}, friction=0.1) == pytest.approx(
        3 - 0.1 * 9.81, abs=0.1
    )
    assert gained_on("y_lower", {"y_lower": {"friction": 0.1}}) == pytest.approx(3 - 0.1 * 9.81, abs=0.1)
    # Without any, the material's own 0.9 holds it.
    assert gained_on("y_lower", {"x_upper": {"contact": "sticky"}}) == pytest.approx(0.0, abs=0.05)


MIXED = {
    "x_lower": {"contact": "slip"},
    "x_upper": {"contact": "sticky"},
    "y_lower": {"friction": 0.3},
    "y_upper": {"friction": 0.0},
}


def splash(faces: dict[str, dict[str, object]] | None, **settings: object) -> MpmSolver:
    """Return a solver of water that hits all four walls."""
    box = {
        "shape": "box",
        "material": "water",
        "lower": (0.3, 0.15),
        "upper": (0.6, 0.6),
        "velocity": (4.0, 3.0),
    }
    walls = {"lower": (0.1, 0.1), "upper": (0.9, 0.9), "faces": faces}
    scene = Scene.model_validate({"dim": 2, "resolution": 64, "bodies": (box,), "walls": walls})
    return MpmSolver(scene, **settings)  # type: ignore[arg-type]


def test_walls_that_differ_give_the_same_bits_on_any_threads_and_across_snapshots() -> None:
    one, four, again = splash(MIXED), splash(MIXED, threads=4), splash(MIXED)
    one.advance(120)
    four.advance(120)
    assert np.array_equal(one.positions, four.positions)
    again.advance(50)
    kept = again.snapshot()
    again.reset()
    again.restore(kept)
    again.advance(70)
    assert np.array_equal(one.positions, again.positions)
    uniform = splash(None)
    with pytest.raises(SnapshotError):
        uniform.restore(kept)
    uniform.advance(120)
    assert not np.array_equal(one.positions, uniform.positions)


def test_naming_each_wall_alike_changes_no_bit() -> None:
    alike = splash({name: {"contact": "separating"} for name in MIXED})
    plain = splash(None)
    for solver in (alike, plain):
        solver.advance(100)
    assert np.array_equal(alike.positions, plain.positions)


def test_those_who_are_carried_meet_the_same_walls() -> None:
    few = splash(MIXED, r_p=0.25, show_all=True)
    few.advance(80)
    lower, upper = np.float32(0.1), np.float32(0.9)
    assert ((few.positions >= lower) & (few.positions <= upper)).all()


@pytest.mark.parametrize(
    ("faces", "field", "words"),
    [
        (
            {"z_lower": {"contact": "slip"}},
            "walls.faces.z_lower",
            "is no wall in 2D; these are x_lower, x_upper",
        ),
        ({"floor": {"contact": "slip"}}, "walls.faces.floor", "unknown field"),
        (
            {"x_lower": {"contact": "slip", "friction": 0.1}},
            "walls.faces.x_lower.friction",
            "only for separating",
        ),
        ({"x_lower": {"friction": -1.0}}, "walls.faces.x_lower.friction", "must be in [0, 10]"),
        ({"x_lower": {"contact": "wet"}}, "walls.faces.x_lower.contact", "'sticky', 'slip' or 'separating'"),
    ],
)
def test_a_fault_of_one_wall_names_it(faces: dict[str, object], field: str, words: str) -> None:
    body = {"shape": "box", "material": "water", "lower": [0.3, 0.3], "upper": [0.5, 0.5]}
    walls = {"lower": [0.1, 0.1], "upper": [0.9, 0.9], "faces": faces}
    with pytest.raises(SceneError) as raised:
        Scene.parse({"dim": 2, "bodies": [body], "walls": walls})
    assert [(place, words in text) for place, text in raised.value.problems] == [(field, True)]


def test_the_core_asks_for_one_contact_or_one_for_each_wall() -> None:
    def make(**settings: object) -> None:
        water = _native.Material.water(density=1000.0, bulk_modulus=1e5)
        native_solver(np.full((1, 2), 0.5), 0.0, water, resolution=32, **settings)

    make(wall_contact=["slip"] * 4, wall_friction=[None, 0.1, None, 0.0])
    with pytest.raises(ConfigError, match="must be one value, or one for each of the 4 walls, got 3"):
        make(wall_contact=["slip"] * 3)
    with pytest.raises(ConfigError, match="wall_friction must be finite and >= 0"):
        make(wall_friction=[None, -0.1, None, 0.0])
