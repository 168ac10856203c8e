"""Closed surfaces of triangles as goals in 3D: what they enclose, growth, refusals, and fluids in them."""

import re
from typing import Any

import numpy as np
import pytest
import trimesh

from hybridmpm import Box, BoxObstacle, ConfigError, MpmSolver, Scene, SketchError, scenarios
from hybridmpm.control import Arrow, Guidance, Keyframe, Solid, follow, prepare, render_png
from hybridmpm.playing.ways import drawn

L = [(0.15, 0.15), (0.15, 0.5), (0, 0.5), (0, 0), (0.4, 0), (0.4, 0.15)]


def letter() -> Solid:
    """Return a prism over an L, which is seen whole from its first corner."""
    fan = [(0, i, i + 1) for i in range(1, 5)]
    walls = [(i, (i + 1) % 6, (i + 1) % 6 + 6) for i in range(6)]
    walls += [(i, (i + 1) % 6 + 6, i + 6) for i in range(6)]
    lids = [(a, c, b) for a, b, c in fan] + [(a + 6, b + 6, c + 6) for a, b, c in fan]
    return Solid(np.array([(x + 0.3, y + 0.3, z) for z in (0.4, 0.55) for x, y in L]), np.array(lids + walls))


def made(mesh: Any) -> Solid:
    """Return a surface of trimesh, in the middle of a metre."""
    return Solid(np.asarray(mesh.vertices) + 0.5, np.asarray(mesh.faces))


BALL = made(trimesh.creation.icosphere(3, 0.2))
TORUS = made(trimesh.creation.torus(0.15, 0.06))


def sized(solid: Solid, volume: float) -> Solid:
    """Return a solid of another volume [m^3] at the same place."""
    factor = (volume / solid.volume) ** (1 / 3)
    return Solid(solid.center + factor * (solid.vertices - solid.center), solid.triangles)


def test_a_solid_knows_what_it_encloses_and_how_it_looks() -> None:
    assert BALL.volume == pytest.approx(4 / 3 * np.pi * 0.2**3, rel=0.02)
    np.testing.assert_allclose(TORUS.center, 0.5, atol=1e-9)
    # Two boxes make up the letter.
    middle = (0.15 * 0.5 * 0.075 + 0.25 * 0.15 * 0.275) / (0.15 * 0.5 + 0.25 * 0.15)
    assert letter().center[[0, 2]] == pytest.approx([0.3 + middle, 0.475])
    x = np.random.default_rng(4).uniform(0.2, 0.8, (3000, 3))
    around = np.hypot(np.hypot(x[:, 0] - 0.5, x[:, 1] - 0.5) - 0.15, x[:, 2] - 0.5)
    clear = np.abs(around - 0.06) > 4e-3
    np.testing.assert_array_equal(TORUS.covers(x)[clear], (around < 0.06)[clear])
    grown = 0.5 + (x - 0.5) / 1.3
    np.testing.assert_array_equal(TORUS.covers(x, 1.3), TORUS.covers(grown))
    # Cells of a lattice are those whose centres are inside.
    lattice = np.stack(np.meshgrid(*[0.21 + 0.06 * np.arange(10)] * 3, indexing="ij"), axis=-1)
    inside = TORUS.covers_cells([0.18] * 3, 0.06, [10] * 3, 1.2)
    np.testing.assert_array_equal(inside, TORUS.covers(lattice.reshape(-1, 3), 1.2))
    # Seen from the front, a ring has two lines, the outer one first.
    sizes = [np.ptp(line, axis=0).max() for line in TORUS.outlines]
    assert sizes == pytest.approx([0.42, 0.18], abs=0.01)
    assert [len(line) for line in letter().outlines] == [6]
    assert render_png(TORUS)
    assert not BALL.crosses_itself
    both = np.concatenate([BALL.vertices, BALL.vertices + 0.1])
    assert Solid(both, np.concatenate([BALL.triangles, BALL.triangles + len(BALL.vertices)])).crosses_itself


@pytest.mark.parametrize(
    ("vertices", "triangles", "message"),
    [
        (
            BALL.vertices[:, :2],
            BALL.triangles,
            "vertices must have 4 to 200000 rows of 3 numbers, got (642, 2)",
        ),
        (BALL.vertices, BALL.triangles / 2, "triangles must be whole numbers"),
        (BALL.vertices - 0.4, BALL.triangles, "must be three numbers in [0, 4096], got [-0."),
        (BALL.vertices, BALL.triangles + 1, "must be indices in [0, 641], got ["),
        (BALL.vertices, BALL.triangles[1:], "triangles must be closed, but have 3 open edges: vertices"),
        (
            BALL.vertices,
            [*BALL.triangles[1:], BALL.triangles[0, ::-1]],
            "triangles must turn the same way round",
        ),
        (np.ma.masked_array(BALL.vertices), BALL.triangles, "without a mask"),
    ],
)
def test_what_is_no_solid_is_refused(vertices: Any, triangles: Any, message: str) -> None:
    with pytest.raises(SketchError, match=re.escape(message)):
        Solid(vertices, triangles)


def test_a_solid_has_to_lie_in_a_world_in_space() -> None:
    block = Box(lower=(0.3, 0.2, 0.4), upper=(0.45, 0.35, 0.55), material="water")
    solver = MpmSolver(Scene(dim=3, resolution=32, bodies=[block]))
    far = Solid(BALL.vertices + np.array([0.0, 0.0, 0.4]), BALL.triangles)
    with pytest.raises(SketchError, match=r"vertices\[\d+\]: must be in \[0, 1\] x \[0, 1\] x \[0, 1\] m"):
        prepare(solver, far)
    with pytest.raises(SketchError, match=r"must reach over at least 0\.007812 m"):
        prepare(solver, sized(BALL, 1e-8))
    flat = Box(lower=(0.3, 0.2), upper=(0.45, 0.35), material="water")
    with pytest.raises(SketchError, match="in 3D only: in 2D draw a shape"):
        prepare(MpmSolver(Scene(dim=2, resolution=32, bodies=[flat])), BALL)
    with pytest.raises(ConfigError, match="a Shape or a Solid, got str"):
        prepare(solver, "ball")  # type: ignore[arg-type]
    thin = prepare(solver, sized(TORUS, 0.004)).needs()
    assert not thin.reachable
    assert "100 % of the solid is thinner than 4 grid cells, 12.5 cm: make it thicker" in str(thin)
    volume = 1.15 * solver.particle_count / 8 / 32**3
    # A large one is filled evenly, or shrunk to the fluid; a small one grows with its hole.
    for solid, fill, scale in (
        (BALL, "even", 1.0),
        (BALL, "shrink", (volume / BALL.volume) ** (1 / 3)),
        (sized(TORUS, 0.001), "even", (volume / 0.001) ** (1 / 3)),
    ):
        goal = prepare(solver, solid, "analytic", fill=fill).goal  # type: ignore[arg-type]
        assert goal.region is not None
        assert goal.region.scale == pytest.approx(scale, rel=0.02)
        assert solid.covers(goal.region.cells, goal.region.scale).all()
        assert goal.region.volume == pytest.approx(solid.volume * scale**3, rel=0.04)
    # Obstacles take their part, and the rest grows for it.
    half = BoxObstacle(lower=(0.5, 0.0, 0.0), upper=(0.9, 0.9, 0.9))
    beside = prepare(
        MpmSolver(Scene(dim=3, resolution=32, bodies=[block], obstacles=[half])), sized(BALL, 0.005)
    )
    assert beside.goal.region is not None
    assert beside.goal.region.scale > 1.1
    assert beside.goal.region.cells[:, 0].max() < 0.5


def test_a_fluid_fills_solids_and_goes_on_from_a_snapshot() -> None:
    solver = MpmSolver(scenarios.water_3d(2_000_004))
    solver.advance(60)
    volume = float(solver.mass.sum()) / 1000
    torus = sized(TORUS, volume)
    guidance = prepare(solver, torus, "auto")
    assert guidance.method == "analytic"
    assert any("narrower than 4 grid cells" in note for note in guidance.needs().notes)
    assert len(drawn(guidance)) == 2
    for _ in range(guidance.frames - 30):
        solver.advance(1, guidance)
    twin = solver.copy()
    again = Guidance.restored(guidance.snapshot(), solver.scene)
    for one, law in ((solver, guidance), (twin, again)):
        one.advance(30, law)
    assert solver.digest() == twin.digest()
    x, weight = solver.positions.astype(np.float64), guidance.goal.cloud.weight
    inside = guidance.goal.inside(x)
    assert inside is not None
    assert weight @ inside > 0.95
    # The hole of the ring is empty.
    assert weight @ (np.hypot(*(x[:, :2] - 0.5).T) < 0.02) < 0.01
    # A letter, and the arrow after it.
    following = follow(
        solver, [Keyframe(sized(letter(), volume), 120), (Arrow([[0.5, 0.5], [0.6, 0.5]]), 40)]
    )
    first = following.run().passed[0]
    assert first.inside is not None
    assert first.inside > 0.9
    with pytest.raises(ConfigError, match="chooses none"):
        prepare(solver, torus, who=Solid(sized(BALL, 1e-6).vertices + 0.35, BALL.triangles))
