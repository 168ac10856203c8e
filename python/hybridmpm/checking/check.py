"""`check`: stability, cost and likely faults of a scene before its first frame."""

import math
import warnings
from collections.abc import Callable
from dataclasses import replace

from hybridmpm.checking.geometry import of_geometry
from hybridmpm.checking.liquids import of_liquids
from hybridmpm.checking.matter import of_matter
from hybridmpm.checking.openings import of_openings
from hybridmpm.checking.probe import Probe, probe, probe_scene
from hybridmpm.checking.report import Finding, SceneCheck
from hybridmpm.checking.speed import of_speed
from hybridmpm.coarse import coarse_warnings
from hybridmpm.errors import ConfigError, FrameCancelledError, SceneError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.mpm.cost import frame_cost
from hybridmpm.scene import Scene
from hybridmpm.scene.world import cells_of
from hybridmpm.simulator import Simulator, checked_simulator

_SEVERITIES = ("error", "warning", "note")
_NODE_BYTES = 16
"""Memory of a grid node [bytes]: momentum and mass."""
_PARTICLE_BYTES = {"water": 380, "liquid": 560, "sand": 780, "elastic": 780}
"""Memory of a particle with its state before the frame and what a frame needs, by material [bytes]."""
_BASE_BYTES = 60 * 2**20
"""Memory of a process that has imported the library [bytes]."""


def check(scene: Scene | Simulator, solver: Simulator | None = None) -> SceneCheck:
    """Check stability, cost and likely faults of a scene before its first frame.

    Some frames are simulated on a copy, for about half a second. Of a longer frame some substeps are
    simulated, or at least two frames of a given `solver`.

    Parameters
    ----------
    scene : Scene or Simulator
        A scene, or a simulator, which stands for its scene and itself.
    solver : Simulator, optional
        A simulator of this scene, which does not change; `MpmSolver(scene)` if absent. The findings contain
        what its coarse level does not suit.

    Returns
    -------
    SceneCheck
        A scene that cannot run is an error among its findings; the call raises nothing.

    Raises
    ------
    ConfigError
        `scene` is neither a scene nor a simulator, or `solver` is none, or one of another scene.
    """
    if not isinstance(scene, Scene):
        subject = checked_simulator(scene)
        scene, solver = subject.scene, subject if solver is None else solver
    if solver is not None and checked_simulator(solver).scene != scene:
        raise ConfigError("solver simulates another scene: make one of this scene, or leave it out")
    level = getattr(solver, "coarse", None)
    unsuited = [] if level is None else coarse_warnings(scene, level)
    found = [Finding(severity="warning", field="", problem=text, advice="") for text in unsuited]
    found += findings(scene, resolution_of(solver, scene))
    tried: Probe | None = None
    simulator: Simulator | None = solver
    try:
        with warnings.catch_warnings():
            # The findings contain the same.
            warnings.simplefilter("ignore")
            simulator = MpmSolver(scene) if solver is None else solver
            tried = probe_scene(scene) if solver is None else probe(solver)
    except FrameCancelledError:
        raise
    except (ConfigError, SimulationError) as error:
        faults = error.problems if isinstance(error, SceneError) else []
        for field, text in faults or [("", str(error))]:
            found.append(Finding(severity="error", field=field, problem=text, advice=""))
    unstable = _unstable(scene, simulator, tried)
    if unstable is not None:
        found.append(unstable)
    if tried is None or any(one.severity == "error" for one in found):
        stable: bool | None = False
    else:
        stable = None if simulator is not None and simulator.kind == "neural" else unstable is None
    count = frame_cost(scene).particles if simulator is None else simulator.particle_count
    return SceneCheck(
        scene=scene.title,
        particles=count,
        stable=stable,
        bound=None if tried is None else tried.bound,
        substeps=None if tried is None else tried.substeps,
        milliseconds=None if tried is None else 1e3 * tried.seconds,
        memory=estimated_memory(scene, resolution_of(simulator, scene), count),
        findings=_most_severe_first(found),
    )


def check_with(scene: Scene, make: Callable[[], Simulator]) -> SceneCheck:
    """Check a scene as `check` does, for a simulator that is not made yet.

    Parameters
    ----------
    scene : Scene
    make : callable
        Makes the simulator of this scene. A `SimulationError` that it raises becomes an error among the
        findings.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # The findings contain the same.
        try:
            simulator = make()
        except FrameCancelledError:
            raise
        except SimulationError as error:
            refused = Finding(severity="error", field="", problem=str(error), advice="")
            return replace(check(scene), stable=False, findings=(refused, *findings(scene)))
    return check(scene, simulator)


def findings(scene: Scene, resolution: int | None = None) -> tuple[Finding, ...]:
    """Return the findings about the scene itself, without a frame, the most severe first.

    `resolution` is that of the grid that simulates, in cells per metre; the scene's if absent.
    """
    cells = resolution or scene.resolution
    return _most_severe_first(
        [
            *of_geometry(scene),
            *of_openings(scene),
            *of_matter(scene, cells),
            *of_liquids(scene, cells),
            *of_speed(scene),
        ]
    )


def estimated_memory(scene: Scene, resolution: int, particles: int) -> int:
    """Return the approximate memory of a process with so many particles on such a grid [bytes]."""
    nodes = math.prod(cells + 16 for cells in cells_of(scene.size, resolution))
    largest = max(_PARTICLE_BYTES[material.kind] for material in scene.materials)
    return _BASE_BYTES + _NODE_BYTES * nodes + largest * particles


def resolution_of(simulator: Simulator | None, scene: Scene) -> int:
    """Return the cells per metre of a simulator's grid; the scene's where it has none."""
    return int(getattr(simulator, "resolution", scene.resolution))


def _most_severe_first(found: list[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(found, key=lambda one: _SEVERITIES.index(one.severity)))


def _unstable(scene: Scene, simulator: Simulator | None, tried: Probe | None) -> Finding | None:
    """Return the finding that the caller's substeps exceed the stability limit; None where they do not."""
    if tried is None or tried.substeps is None or tried.bound not in ("fixed", "reference"):
        return None
    dx = 1 / resolution_of(simulator, scene)
    longest = min(
        native.cfl_limit * dx / native.signal_speed(scene.dim)
        for native in (material.to_native(scene.potential_drop or 1.0) for material in scene.materials)
    )
    if scene.frame_dt / tried.substeps <= longest:
        return None
    return Finding(
        severity="error",
        field="",
        problem=f"{tried.substeps} substeps a frame are too few: each is "
        f"{scene.frame_dt / tried.substeps:.3g} s long, and the stability limit is {longest:.3g} s",
        advice=f'take {math.ceil(scene.frame_dt / longest)} or more, or substeps="cfl"',
    )
