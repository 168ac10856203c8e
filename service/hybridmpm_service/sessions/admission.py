"""Limits on scenes before they are built: memory, estimated time of a frame, static findings."""

from hybridmpm import Scene, SceneError
from hybridmpm.checking import Finding, findings
from hybridmpm.mpm import frame_cost
from hybridmpm_service.sessions.solvers import SolverChoice
from hybridmpm_service.settings import Settings

_SECONDS_PER_PARTICLE_SUBSTEP = 25e-9
"""Estimate for a particle in a substep; on one core MPM takes 15 (2D water) to 43 ns (3D sand)."""


def estimated_frame_seconds(scene: Scene) -> float:
    """Return the estimated time of a scene's frame [s]."""
    cost = frame_cost(scene)
    return cost.particles * cost.substeps * _SECONDS_PER_PARTICLE_SUBSTEP


def within_limits(scene: Scene, settings: Settings) -> Scene:
    """Return the scene with the particle limit of this service.

    Raises
    ------
    SceneError
        The scene is beyond a limit; the message has the figure, the limit and a remedy.
    """
    most = settings.max_grid_nodes
    nodes = (scene.resolution + 1) ** scene.dim
    if nodes > most:
        allowed = int(most ** (1 / scene.dim)) - 1
        text = f"must be at most {allowed} in {scene.dim}D on this server, got {scene.resolution}"
        raise SceneError.of([("resolution", text)])
    limit = min(scene.max_particles, settings.max_particles)
    cost = frame_cost(scene)
    # Emitters fill a scene up to the limit. More particles at the start are refused when they are made.
    particles = limit if scene.emitters else min(cost.particles, limit)
    if particles * cost.substeps > settings.max_frame_cost:
        text = (
            f"make a frame of about {particles} particles x {cost.substeps} substeps = "
            f"{particles * cost.substeps}, and this server takes up to {settings.max_frame_cost} (setting "
            "max_frame_cost): shorten frame_dt, lower the resolution, or take softer or smaller bodies"
        )
        raise SceneError.of([("bodies", text)])
    return scene.model_copy(update={"max_particles": limit})


def static_findings(scene: Scene, choice: SolverChoice) -> tuple[Finding, ...]:
    """Return the static findings of a scene's check, for which no frame is simulated.

    Raises
    ------
    SceneError
        There are errors among them: the scene would not run. The message has remedies.
    """
    found = findings(scene)
    errors = [one for one in found if one.severity == "error"]
    if errors and choice.solver == "mpm" and choice.coarse is None:
        raise SceneError.of([(one.field, f"{one.problem}; {one.advice}") for one in errors])
    # In coarse mode grid and time step differ from the scene's, so its static errors do not apply.
    return tuple(one for one in found if one not in errors)
