"""Which scenes this service takes: those whose frames it can compute in its memory and in bearable time."""

from hybridmpm import Scene, SceneError
from hybridmpm.mpm import frame_cost
from hybridmpm_service.settings import Settings


def within_limits(scene: Scene, settings: Settings) -> Scene:
    """Return the scene with the particle limit of this service.

    Raises
    ------
    SceneError
        The scene is beyond a limit; the message has the figure, the limit and what to do.
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
