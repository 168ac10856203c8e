"""Limits on scenes before they are built: memory, estimated work of building and of a frame, findings."""

import math

import numpy as np
import numpy.typing as npt

from hybridmpm import Scene, SceneError
from hybridmpm.checking import Finding
from hybridmpm.mpm import frame_cost
from hybridmpm.scene import Body, Motion, RigidBody
from hybridmpm_service.sessions.solvers import SolverChoice
from hybridmpm_service.settings import Settings

_SECONDS_PER_PARTICLE_SUBSTEP = 25e-9
"""Estimate for a particle in a substep; on one core MPM takes 15 (2D water) to 43 ns (3D sand)."""
_SHAPE_TESTS = {"segment": 1.5, "cylinder": 3.0, "polygon": 3.0, "mesh": 5.0, "hull": 3.0}
"""Cost of the distance to a shape that is not a ball or a box, in those; one of a ball takes about 10 ns."""
_TESTS_PER_PARTICLE_SUBSTEP = 2.5
"""Tests that take as long as a particle in a substep."""
_SEARCH_SHARE, _SEARCH_CELLS = 1 / 3, 2.0
"""Share of the nodes that a search for the nodes near a moving obstacle tests, and its motion in between."""
_COST_OF_A_NODE, _NEAR_CELLS = 3.0, 4.0
"""Work of a node near a rigid body in a substep, in that of a particle, and how far such nodes reach."""
_LAYERS = 4
"""Fewest layers of all emitters that a scene of the largest number of particles has room for."""
_MESH_TESTS = 30
"""Tests that take as long as one of a point against a triangle of a mesh, about 0.3 us."""
_CHECK_POINTS = 20_000
"""Largest number of points of a body that its findings test."""


def grid_nodes(scene: Scene) -> int:
    """Return the number of nodes of a scene's grid."""
    return math.prod(cells + 1 for cells in scene.cells)


def building_cost(scene: Scene) -> float:
    """Return the estimated cost of building a scene, in tests of a point against a solid or a body."""
    nodes = grid_nodes(scene)
    still = sum(_tests(one.shape) for one in scene.obstacles if one.motion is None)
    solids = sum(_tests(one.shape) for one in (*scene.obstacles, *scene.rigid))
    sites = [_sites(scene, *body.bounds) for body in scene.bodies]
    filled = frame_cost(scene).particles
    tests = nodes * still + search_cost(scene)
    for index, (body, count) in enumerate(zip(scene.bodies, sites, strict=True)):
        points = min(count, _CHECK_POINTS)
        corners = _MESH_TESTS * body.tests_of_a_point if body.shape == "mesh" else _corners(body)
        # Its sites, those of earlier bodies that are merged with them, and the points of its findings.
        tests += count * (5 + corners) + filled + (min(count, filled) + points) * solids + points * index
    return tests


def _corners(body: Body) -> int:
    return len(body.vertices) if body.shape == "polygon" else 0


def search_cost(scene: Scene) -> float:
    """Return the estimated cost of finding the nodes near moving obstacles, in tests as `building_cost`."""
    moving = sum(_tests(one.shape) for one in scene.obstacles if one.motion is not None)
    return grid_nodes(scene) * moving * _SEARCH_SHARE


def estimated_frame_cost(scene: Scene, particles: int) -> float:
    """Return the estimated cost of a frame, in particles times substeps.

    Particles are tested against all obstacles. Moving ones are looked for on the grid whenever they have
    moved by two cells. Rigid bodies take what the nodes near them do.
    """
    substeps, solids = frame_cost(scene).substeps, sum(_tests(one.shape) for one in scene.obstacles)
    fastest = max((_speed(one.motion) for one in scene.obstacles if one.motion is not None), default=0.0)
    searches = 1 + fastest * scene.frame_dt / (_SEARCH_CELLS * scene.dx)
    tests = particles * substeps * solids / 4 + searches * search_cost(scene)
    near = sum(float(np.prod(_extent(body) / scene.dx + _NEAR_CELLS)) for body in scene.rigid)
    return (particles + _COST_OF_A_NODE * near) * substeps + tests / _TESTS_PER_PARTICLE_SUBSTEP


def estimated_frame_seconds(scene: Scene) -> float:
    """Return the estimated time of a scene's frame [s]."""
    return estimated_frame_cost(scene, frame_cost(scene).particles) * _SECONDS_PER_PARTICLE_SUBSTEP


def _speed(motion: Motion) -> float:
    """Return a bound of an obstacle's speed [m/s]."""
    turn = float(np.linalg.norm(motion.angular_velocity or 0.0))
    return float(np.linalg.norm(motion.velocity or 0.0)) + turn * math.sqrt(3.0)


def _extent(body: RigidBody) -> npt.NDArray[np.float64]:
    """Return the sides of the box around a rigid body [m]."""
    lower, upper = body.bounds
    return np.asarray(upper - lower)


def _tests(shape: str) -> float:
    return _SHAPE_TESTS.get(shape, 1.0)


def _sites(scene: Scene, lower: npt.ArrayLike, upper: npt.ArrayLike) -> float:
    """Return the number of lattice sites in a box."""
    sides = (np.asarray(upper) - np.asarray(lower)) / scene.spacing
    return float(np.prod(np.ceil(sides) + 1))


def within_limits(scene: Scene, settings: Settings) -> Scene:
    """Return the scene with the particle limit of this service.

    Raises
    ------
    SceneError
        The scene is beyond a limit; the message has the figure, the limit and a remedy.
    """
    most = settings.max_grid_nodes
    if grid_nodes(scene) > most:
        allowed = scene.resolution
        while allowed > 1 and math.prod(math.ceil(length * allowed) + 1 for length in scene.size) > most:
            allowed -= 1
        text = f"must be at most {allowed} in {scene.dim}D on this server, got {scene.resolution}"
        raise SceneError.of([("resolution", text)])
    limit = min(scene.max_particles, settings.max_particles)
    places = sum(one.measure for one in scene.emitters) / scene.spacing ** (scene.dim - 1)
    # Sixteen patterns of a layer are kept, and belong to each snapshot.
    if places > settings.max_particles // _LAYERS:
        text = (
            f"have room for about {places:.0f} particles side by side, and this server takes up to "
            f"{settings.max_particles // _LAYERS} (a quarter of the setting max_particles): make the "
            "openings smaller, or lower the resolution"
        )
        raise SceneError.of([("emitters", text)])
    cost = frame_cost(scene)
    # Emitters fill a scene up to the limit. More particles at the start are refused when they are made.
    particles = limit if scene.emitters else min(cost.particles, limit)
    frame, most_frame = estimated_frame_cost(scene, particles), settings.max_frame_cost
    if frame > most_frame:
        counts = {"obstacles": len(scene.obstacles), "rigid bodies": len(scene.rigid)}
        beside = "".join(f" and {count} {name}" for name, count in counts.items() if count)
        text = (
            f"make a frame of about {particles} particles x {cost.substeps} substeps{beside} = "
            f"{round(frame)}, and this server takes up to {most_frame} (setting max_frame_cost): shorten "
            "frame_dt, lower the resolution, take softer or smaller bodies, or fewer obstacles or rigid ones"
        )
        raise SceneError.of([("bodies", text)])
    allowed_tests = settings.max_building_cost
    # A search is the longest part of a frame that cannot be ended in the middle.
    for tests, limit_of, which in (
        (building_cost(scene), allowed_tests, "setting max_building_cost"),
        (search_cost(scene), allowed_tests // 10, "a tenth of max_building_cost, for those that move"),
    ):
        if tests > limit_of:
            text = (
                f"take about {tests:.0f} tests of grid nodes and lattice sites, and this server makes up to "
                f"{limit_of} ({which}): lower the resolution, or take fewer obstacles and bodies"
            )
            field = "obstacles" if scene.obstacles else "rigid" if scene.rigid else "bodies"
            raise SceneError.of([(field, text)])
    return scene.model_copy(update={"max_particles": limit})


def without_errors(found: tuple[Finding, ...], choice: SolverChoice) -> tuple[Finding, ...]:
    """Return the findings about a scene that a simulator can run in spite of them.

    Raises
    ------
    SceneError
        There are errors among them: the scene would not run. The message has remedies.
    """
    errors = [one for one in found if one.severity == "error"]
    if errors and choice.solver == "mpm" and choice.coarse is None:
        raise SceneError.of([(one.field, f"{one.problem}; {one.advice}") for one in errors])
    # In coarse mode grid and time step differ from the scene's, so its static errors do not apply.
    return tuple(one for one in found if one not in errors)
