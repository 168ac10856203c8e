"""Rigid bodies: laws in water, states that are restored, and what is refused."""

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    Box,
    BoxObstacle,
    CoarseWarning,
    ConfigError,
    MeshObstacle,
    MpmSolver,
    PolygonObstacle,
    RigidBall,
    RigidBox,
    RigidCylinder,
    RigidHull,
    Scene,
    SceneError,
    Water,
    check,
    data,
    export,
    plan,
)
from hybridmpm.control import Arrow, prepare, pull
from hybridmpm.data.generation.solids import Solids
from hybridmpm.recording import Recording, record
from hybridmpm.render import view_of
from hybridmpm.scene import HalfSpaceObstacle, Walls


def _pool(*rigid: Any, level: float = 0.5, resolution: int = 32, **fields: Any) -> Scene:
    """Return a pool 0.8 m wide with rigid bodies in it."""
    water = Box(lower=(0.1, 0.1), upper=(0.9, level), material=Water())
    return Scene(dim=2, resolution=resolution, bodies=[water], rigid=rigid, **fields)


def _box(x: float, y: float, width: float, height: float, **fields: Any) -> RigidBox:
    lower, upper = (x - width / 2, y - height / 2), (x + width / 2, y + height / 2)
    return RigidBox(lower=lower, upper=upper, **fields)


def _depth(solver: MpmSolver, body: RigidBox, side: float) -> float:
    """Return the height [m] of the water beside a body above its lower face, from its mass."""
    width, height = np.subtract(body.upper, body.lower)
    x, spacing = solver.positions, solver.particle_spacing
    bottom = solver.rigid_bodies.center[0, 1] - height / 2
    beside = np.abs(x[:, 0] - 0.5) > width / 2 + side
    above = np.clip((x[:, 1] - bottom) / spacing + 0.5, 0, 1)[beside].sum()
    return float(above * solver.mass[0] / 1000 / (0.8 - width - 2 * side))


@pytest.mark.parametrize("above", [0.02, 0.6])
def test_no_film_stays_below_a_body_that_came_down_on_water(above: float) -> None:
    # Over all of the water, so that nothing gets out of its way; in cells.
    width, level, dx = 12, 6.6, 1 / 32
    water = Box(lower=(0, 0), upper=(width * dx, level * dx), material=Water())
    lower, upper = (0, (level + above) * dx), (width * dx, (level + above + 4) * dx)
    body = RigidBox(lower=lower, upper=upper, density=500, friction=0)
    walls = Walls(lower=(0, 0), upper=(width * dx, 0.9))
    solver = MpmSolver(Scene(dim=2, resolution=32, walls=walls, bodies=[water], rigid=[body]))
    solver.advance(160)
    face = solver.rigid_bodies.center[0, 1] / dx - 2
    assert face == pytest.approx(level * solver.volume_ratio.mean(), abs=0.08)


@pytest.mark.long
@pytest.mark.parametrize("density", [300, 500, 800])
def test_the_submerged_share_is_the_ratio_of_the_densities(density: float) -> None:
    body = _box(0.5, 0.6 - density * 2e-4, 0.3, 0.2, density=density)
    solver = MpmSolver(_pool(body, resolution=64))
    solver.advance(1200)
    depths = []
    for _ in range(60):
        solver.advance(20)
        depths.append(_depth(solver, body, 0.08))
    share = np.mean(depths) / 0.2
    assert share == pytest.approx(density / 1000, rel=0.02)


@pytest.mark.long
def test_a_box_that_floats_rights_itself() -> None:
    # It is flat, so it is stable with its long side down alone.
    solver = MpmSolver(_pool(_box(0.5, 0.55, 0.3, 0.12, density=400, rotation=0.9), resolution=64))
    solver.advance(2400)
    assert abs(math.degrees(solver.rigid_bodies.rotation[0])) < 3


def test_a_body_and_water_give_each_other_the_same_momentum() -> None:
    # Nothing else acts until the splash reaches a wall.
    body = _box(0.5, 0.56, 0.1, 0.1, density=700, velocity=(1.0, -1.0))
    solver = MpmSolver(_pool(body, gravity=(0, 0)))
    mass = 700 * 0.01
    start = mass * 1.0
    solver.advance(8)
    of_body = mass * solver.rigid_bodies.velocity[0, 0]
    of_water = solver.mass @ solver.velocities[:, 0]
    assert of_body < 0.99 * start
    assert of_body + of_water == pytest.approx(start, rel=1e-3)


def test_boxes_stand_on_each_other_under_water_and_a_snapshot_keeps_the_bits() -> None:
    boxes = [_box(0.5 + 0.003 * k, 0.14 + 0.08 * k, 0.1, 0.08, density=2000) for k in range(4)]
    solver = MpmSolver(_pool(*boxes))
    solver.advance(40)
    saved = solver.snapshot()
    solver.advance(40)
    moved = solver.rigid_bodies.center - [body.mass_center for body in boxes]
    assert np.abs(moved).max() < 2e-3
    other = MpmSolver(_pool(*boxes), threads=2)
    other.restore(saved)
    other.advance(40)
    assert other.rigid_bodies.center.tobytes() == solver.rigid_bodies.center.tobytes()
    assert other.positions.tobytes() == solver.positions.tobytes()


@pytest.mark.parametrize("dim", [2, 3])
def test_turned_bodies_at_the_surface_have_the_same_bits_on_all_threads(dim: int) -> None:
    # Lines at their edges reach into planes of other threads.
    rigid: list[Any] = [
        RigidBox(lower=(0.25, 0.4), upper=(0.45, 0.55), rotation=0.5, density=500, angular_velocity=1.0),
        RigidHull(points=((0.6, 0.42), (0.82, 0.42), (0.7, 0.6)), rotation=0.3, density=400),
    ]
    if dim == 3:
        rigid = [
            RigidBox(lower=(0.2, 0.2, 0.25), upper=(0.45, 0.45, 0.55), rotation=(0.4, 0.3, 0.5), density=500),
            RigidCylinder(start=(0.7, 0.25, 0.6), end=(0.7, 0.5, 0.6), radius=0.12, rotation=(0.3, 0.2, 0.1)),
        ]
    upper = (0.9, 0.5) if dim == 2 else (0.9, 0.35, 0.9)
    water = Box(material="water", lower=(0.1,) * dim, upper=upper)
    scene = Scene(dim=dim, resolution=96 if dim == 2 else 24, bodies=(water,), rigid=rigid)
    bits = set()
    for threads in (1, 2, 3):
        solver = MpmSolver(scene, threads=threads)
        assert solver.particle_count > 10_000
        solver.advance(30 if dim == 2 else 12)
        states = solver.positions, solver.rigid_bodies.center, solver.rigid_bodies.angular_velocity
        bits.add(b"".join(state.tobytes() for state in states))
    assert len(bits) == 1


def test_no_water_creeps_under_a_box_that_is_pressed_to_the_floor() -> None:
    box = RigidBox(lower=(0.35, 0.001), upper=(0.65, 0.2), density=400)
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))
    water = Box(material="water", lower=(0.0, 0.0), upper=(1.0, 0.4))
    solver = MpmSolver(Scene(dim=2, resolution=64, walls=walls, bodies=(water,), rigid=(box,)))
    for _ in range(2):
        solver.advance(60, pull(0, (0.5, -2.0), strength=20_000.0))
    x = solver.positions
    assert not ((np.abs(x[:, 0] - 0.5) < 0.13) & (x[:, 1] < 0.05)).any()


def test_a_body_slides_and_holds_on_an_obstacle() -> None:
    angle = math.radians(20)
    normal = (math.sin(angle), math.cos(angle))
    slope = HalfSpaceObstacle(point=(0.2, 0.8), normal=normal)
    paths = {}
    for friction in (0.1, 0.5):
        place = np.array([0.3, 0.8 - 0.1 * math.tan(angle)]) + 0.05 * np.array(normal)
        body = _box(*place, 0.1, 0.1, density=1000, rotation=-angle, friction=friction)
        drop = Box(lower=(0.85, 0.85), upper=(0.9, 0.9), material=Water())
        walls = {"lower": (0.0, 0.0), "upper": (1.0, 1.0)}
        solver = MpmSolver(
            Scene(dim=2, resolution=32, bodies=[drop], rigid=[body], obstacles=[slope], walls=walls)
        )
        solver.advance(120)
        paths[friction] = np.linalg.norm(solver.rigid_bodies.center[0] - place)
    exact = 0.5 * 9.81 * (math.sin(angle) - 0.1 * math.cos(angle)) * 0.3**2
    assert paths[0.1] == pytest.approx(exact, rel=0.02)
    assert paths[0.5] < 1e-4


def test_bodies_of_all_shapes_fall_in_space() -> None:
    shapes = [
        RigidBox(lower=(0.2, 0.6, 0.2), upper=(0.3, 0.7, 0.3), rotation=(0.3, 0.2, 0.1)),
        RigidBall(center=(0.5, 0.65, 0.5), radius=0.06),
        RigidCylinder(start=(0.7, 0.6, 0.7), end=(0.7, 0.7, 0.75), radius=0.05),
        RigidHull(points=((0.7, 0.6, 0.2), (0.8, 0.6, 0.2), (0.75, 0.6, 0.3), (0.75, 0.7, 0.25))),
    ]
    water = Box(lower=(0.1, 0.1, 0.1), upper=(0.9, 0.3, 0.9), material=Water())
    solver = MpmSolver(Scene(dim=3, resolution=16, bodies=[water], rigid=shapes))
    start = solver.rigid_bodies.center
    assert start == pytest.approx(np.array([shape.mass_center for shape in shapes]), abs=1e-6)
    solver.advance(40)
    fallen = start - solver.rigid_bodies.center
    assert fallen[:, 1] == pytest.approx(0.5 * 9.81 * 0.1**2, rel=0.01)
    assert np.linalg.norm(solver.rigid_bodies.rotation, axis=1) == pytest.approx(1)
    solver.advance(300)
    assert (solver.rigid_bodies.center[:, 1] > 0.1).all()


def test_water_leaves_room_for_bodies() -> None:
    body = RigidHull(points=((0.4, 0.3), (0.6, 0.3), (0.5, 0.45)), density=900)
    particles = _pool(body).sample()
    assert particles.mass.sum() == pytest.approx(1000 * (0.8 * 0.4 - 0.015), rel=5e-3)
    assert (body.to_native().signed_distance(particles.x) > 0).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_recordings_have_the_bodies_and_pictures_show_them(dim: int) -> None:
    lower, upper = (0.4, 0.6, 0.5)[:dim], (0.7, 0.7, 0.6)[:dim]
    turn = 0.4 if dim == 2 else (0.0, 0.3, 0.4)
    body = RigidBox(lower=lower, upper=upper, rotation=turn)
    water = Box(lower=(0.1,) * dim, upper=(0.9, 0.2, 0.9)[:dim], material=Water())
    recording = record(MpmSolver(Scene(dim=dim, resolution=16, bodies=[water], rigid=[body])), 20, every=10)
    assert recording.rigid is not None
    assert recording.rigid[:, 0, 1] == pytest.approx(
        0.65 - 0.5 * 9.81 * (recording.frames * 0.0025) ** 2, abs=1e-3
    )
    view = view_of(recording.scene, recording.types, 128)
    without = view.draw(recording.positions[0], recording.velocities[0])
    drawn = (recording.picture(view, 0) != without).any(axis=2)
    assert 0.01 < drawn.mean() < 0.2
    corners = body._corners()
    assert body.moved(corners, recording.rigid[0, 0]) == pytest.approx(corners, abs=1e-6)
    moved = body.moved(corners, recording.rigid[2, 0])
    assert body.at_start(moved, recording.rigid[2, 0]) == pytest.approx(corners)


SHAPES = [
    RigidBox(lower=(0.2, 0.6, 0.2), upper=(0.35, 0.7, 0.3), rotation=(0.3, 0.2, 0.1), velocity=(1, 0, 0)),
    RigidBall(center=(0.5, 0.65, 0.5), radius=0.06, angular_velocity=(0, 0, 30)),
    RigidCylinder(start=(0.7, 0.6, 0.7), end=(0.7, 0.7, 0.75), radius=0.05, angular_velocity=(20, 0, 0)),
    RigidHull(points=((0.7, 0.6, 0.2), (0.8, 0.6, 0.2), (0.75, 0.6, 0.3), (0.75, 0.7, 0.25))),
]


def _falling() -> Recording:
    water = Box(lower=(0.1, 0.1, 0.1), upper=(0.9, 0.2, 0.9), material=Water())
    return record(MpmSolver(Scene(dim=3, resolution=24, bodies=[water], rigid=SHAPES)), 30, every=15)


@pytest.mark.needs("pysplashsurf", "surfaces")
def test_surfaces_and_clouds_have_the_bodies() -> None:
    recording = _falling()
    cloud = export.Cloud.of(recording, -1)
    points = cloud.positions[cloud.types == 0]
    found = {one.name: one for one in export.Surfaces(recording).at(-1)}
    assert [name for name in found if name.startswith("rigid")] == [f"rigid_{i}" for i in range(4)]
    sizes = []
    for index, body in enumerate(SHAPES):
        surface, numbers = found[f"rigid_{index}"], recording.rigid[-1, index]
        assert surface.volume == pytest.approx(body.mass / body.density, rel=1e-3)
        native, own = body.to_native(), body.at_start(surface.vertices.astype(float), numbers)
        away = native.signed_distance(own.astype(np.float32))
        assert away == pytest.approx(0, abs=0.02 * 0.06)
        outside = body.at_start(surface.vertices + 1e-3 * surface.normals, numbers).astype(np.float32)
        assert (native.signed_distance(outside) > away).all()
        sizes.append(len(body.filling(recording.scene.spacing)))
    assert len(points) == sum(sizes)
    assert len(points) * recording.scene.spacing**3 == pytest.approx(
        sum(body.mass / body.density for body in SHAPES), rel=0.1
    )
    # The ball turns about itself.
    ball = slice(sizes[0], sizes[0] + sizes[1])
    arms = points[ball] - recording.rigid[-1, 1, :3]
    wanted = recording.rigid[-1, 1, 7:10] + np.cross(recording.rigid[-1, 1, 10:], arms)
    assert cloud.velocities[cloud.types == 0][ball] == pytest.approx(wanted, abs=1e-4)


@pytest.mark.needs("pxr", "usd")
def test_usd_has_a_mesh_for_each_body(tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    recording = _falling()
    export.save(tmp_path / "film.usdc", recording)
    stage = Usd.Stage.Open(str(tmp_path / "film.usdc"))
    for index, body in enumerate(SHAPES):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/particles/rigid_{index}"))
        placed = mesh.ComputeLocalToWorldTransform(float(recording.frames[-1]))
        points = np.array([placed.Transform(point) for point in mesh.GetPointsAttr().Get()])
        at_start = body.at_start(points, recording.rigid[-1, index]).astype(np.float32)
        assert body.to_native().signed_distance(at_start) == pytest.approx(0, abs=0.02 * 0.06)
        assert len(np.unique(points, axis=0)) == len(points)
        assert len(mesh.GetFaceVertexIndicesAttr().Get()) == sum(mesh.GetFaceVertexCountsAttr().Get())


def test_data_sets_have_the_bodies_as_particles_of_type_0() -> None:
    body = _box(0.5, 0.6, 0.2, 0.1, rotation=0.3, angular_velocity=5.0, density=700)
    scene = _pool(body, level=0.2)
    solver = MpmSolver(scene)
    recording = record(solver, 40, every=20)
    trajectory = Solids.of(scene, 1.0).trajectory(
        solver, recording.positions, force=None, seed=3, rigid=recording.rigid
    )
    assert isinstance(trajectory, data.Trajectory)
    rigid = trajectory.types == 0
    assert rigid.sum() * scene.spacing**2 == pytest.approx(0.02, rel=0.15)
    assert trajectory.mass is not None
    assert trajectory.mass[rigid].sum() == pytest.approx(body.mass)
    x = trajectory.positions[:, rigid].astype(float)
    assert x.mean(axis=1) == pytest.approx(recording.rigid[:, 0, :2], abs=scene.spacing)
    apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=3)
    assert apart == pytest.approx(np.broadcast_to(apart[0], apart.shape), abs=1e-5)


def test_coarse_mode_shows_the_material_outside_of_bodies() -> None:
    body = _box(0.5, 0.55, 0.3, 0.12, density=500)
    scene = _pool(body, resolution=64)
    with pytest.warns(CoarseWarning, match=r"rigid\[0\] \(box\) is .* cells of coarse level"):
        coarse = MpmSolver(scene, coarse="1/16")
    whole = MpmSolver(scene)
    for solver in (coarse, whole):
        solver.advance(158)
    heights = [solver.rigid_bodies.center[0, 1] for solver in (coarse, whole)]
    assert heights[0] == pytest.approx(heights[1], abs=0.02)
    assert coarse.particle_count == whole.particle_count > 8 * coarse._coarse.particle_count
    # Between two updates, too.
    own = body.at_start(coarse.positions.astype(float), coarse.rigid_numbers()[0])
    assert body.to_native().signed_distance(own.astype(np.float32)).min() > -0.1 * scene.dx


def test_bodies_lie_on_polygons_and_meshes() -> None:
    # A bowl with water in it; the ball rolls down its rim.
    corners = ((0.1, 0.5), (0.3, 0.2), (0.6, 0.2), (0.8, 0.5), (0.9, 0.5), (0.9, 0.1), (0.1, 0.1))
    bowl = PolygonObstacle(vertices=corners)
    ball = RigidBall(center=(0.175, 0.5), radius=0.05, density=3000)
    box = _box(0.45, 0.25, 0.1, 0.1, density=3000)
    water = Box(lower=(0.3, 0.2), upper=(0.6, 0.25), material=Water())
    solver = MpmSolver(Scene(dim=2, resolution=32, bodies=[water], rigid=[ball, box], obstacles=[bowl]))
    solver.advance(600)
    (ball_x, ball_y), (box_x, box_y) = solver.rigid_bodies.center
    assert ball_y == pytest.approx(0.25, abs=1e-3)
    assert box_y == pytest.approx(0.25, abs=1e-3)
    assert 0.32 < ball_x < box_x < 0.56
    # A wedge whose side of 30 degrees leads down along x.
    rise = 0.5 * math.tan(math.radians(30))
    outline = [(0.1, 0.2), (0.6, 0.2), (0.1, 0.2 + rise)]
    vertices = [(*corner, z) for z in (0.3, 0.7) for corner in outline]
    triangles = [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)]
    wedge = MeshObstacle(vertices=vertices, triangles=triangles)
    normal = np.array([0.5, math.sqrt(0.75), 0])
    place = np.array([0.2, 0.2 + rise * 0.8, 0.5]) + 0.05 * normal
    body = RigidBox(
        lower=tuple(place - 0.05), upper=tuple(place + 0.05), rotation=(0, 0, -math.pi / 6), friction=0.2
    )
    drop = Box(lower=(0.8, 0.1, 0.8), upper=(0.9, 0.2, 0.9), material=Water())
    slides = MpmSolver(Scene(dim=3, resolution=16, bodies=[drop], rigid=[body], obstacles=[wedge]))
    slides.advance(100)
    path = np.linalg.norm(slides.rigid_bodies.center[0] - place)
    assert path == pytest.approx(0.5 * 9.81 * (0.5 - 0.2 * math.sqrt(0.75)) * 0.25**2, rel=0.03)


def test_a_cylinder_is_where_the_scene_has_it() -> None:
    body = RigidCylinder(start=(0.3, 0.5, 0.4), end=(0.5, 0.6, 0.7), radius=0.05, rotation=(0.2, 0.3, 0.4))
    water = Box(lower=(0.1, 0.1, 0.1), upper=(0.9, 0.2, 0.9), material=Water())
    solver = MpmSolver(Scene(dim=3, resolution=16, bodies=[water], rigid=[body]))
    corners = body._corners()
    assert body.moved(corners, solver.rigid_numbers()[0]) == pytest.approx(corners, abs=1e-6)
    assert body.to_native().signed_distance(corners.astype(np.float32)) == pytest.approx(0, abs=1e-6)


def test_scenes_with_bodies_survive_files() -> None:
    scene = _pool(_box(0.5, 0.6, 0.1, 0.1, rotation=0.2, angular_velocity=3.0, restitution=0.5))
    assert Scene.from_json(scene.to_json()) == scene
    assert "polygon" in scene._repr_html_()


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ({"shape": "box", "lower": (0.0, 0.4), "upper": (0.2, 0.5)}, "must lie inside the walls"),
        ({"shape": "box", "lower": (0.3, 0.4), "upper": (0.4, 0.5), "rotation": (0, 0, 1)}, "one number"),
        ({"shape": "ball", "center": (0.5, 0.5), "radius": 0.1, "density": 0}, "must be in"),
        ({"shape": "hull", "points": [(0.2, 0.2), (0.3, 0.3), (0.4, 0.4)]}, "on no common line"),
        ({"shape": "cylinder", "start": (0.3, 0.3), "end": (0.4, 0.3), "radius": 0.1}, "for dim 3 only"),
        ({"shape": "ball", "center": (0.5, 0.5), "radius": 0.1, "mass": 3}, "unknown field"),
    ],
)
def test_faults_of_bodies_are_named(body: dict[str, Any], text: str) -> None:
    with pytest.raises(SceneError, match=text) as caught:
        _pool(body)
    assert "rigid[0]" in str(caught.value)


def test_bodies_that_overlap_are_refused() -> None:
    pair = [_box(0.5, 0.6, 0.1, 0.1), _box(0.56, 0.6, 0.1, 0.1)]
    with pytest.raises(
        SceneError, match=r"rigid\[0\]: overlaps rigid\[1\]: .* at most 0\.01 .*; move one of"
    ):
        MpmSolver(_pool(*pair))
    assert "rigid[0]" in [one.field for one in check(_pool(*pair)).findings if one.severity == "error"]
    obstacle = BoxObstacle(lower=(0.5, 0.5), upper=(0.6, 0.7))
    with pytest.raises(SceneError, match=r"rigid\[0\]: overlaps obstacles\[0\]"):
        MpmSolver(_pool(pair[0], obstacles=[obstacle]))


def test_what_does_not_know_rigid_bodies_says_so() -> None:
    scene = _pool(_box(0.5, 0.6, 0.2, 0.2))
    sketch = Arrow(points=np.array([[0.3, 0.3], [0.6, 0.3]]))
    for refused, reason in (
        (lambda: plan(scene, max_error=0.5), "errors were measured in scenes without them"),
        (
            lambda: prepare(MpmSolver(scene), sketch, "analytic", frames=30),
            "ways lead around solids whose places are known",
        ),
    ):
        with pytest.raises(ConfigError, match=f"not made for rigid bodies, .*: {reason}"):
            refused()


@pytest.mark.parametrize(
    ("body", "text"),
    [(_box(0.5, 0.6, 0.2, 0.05), "4 cells"), (_box(0.5, 0.6, 0.2, 0.2, density=10), "weighs 0.4 kg")],
)
def test_check_warns_of_thin_and_light_bodies(body: RigidBox, text: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = check(_pool(body)).findings
    assert [text in one.problem for one in found if one.field == "rigid[0]"] == [True]
