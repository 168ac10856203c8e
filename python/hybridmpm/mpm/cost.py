"""Cost of a frame, estimated from its scene alone, and the materials that make it slow."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hybridmpm import _core
from hybridmpm.scene import Material, Motion, Scene

MANY_SUBSTEPS = 200
"""Substeps of a frame from which on a material counts as costly."""


@dataclass(frozen=True)
class FrameCost:
    """Approximate work of MPM in the first frame of a scene, with the substeps of the CFL law."""

    particles: int
    """Number of particles."""
    substeps: int
    """Number of substeps for the materials, the initial speeds and the moving obstacles."""

    @property
    def particle_substeps(self) -> int:
        """Particles times substeps, to which the time of a frame is about proportional."""
        return self.particles * self.substeps


def frame_cost(scene: Scene) -> FrameCost:
    """Estimate the cost of a frame of a scene, without sampling particles.

    Particles in overlapping bodies are counted twice. Higher speeds in later frames, e.g. under a force, may
    need more substeps.
    """
    particles = math.ceil(sum(body.measure for body in scene.bodies) / scene.spacing**scene.dim)
    speed = max((float(np.linalg.norm(body.velocity or 0.0)) for body in scene.bodies), default=0.0)
    speed += max((_speed_of_obstacle(obstacle.motion) for obstacle in scene.obstacles), default=0.0)
    substeps = cfl_substeps(scene, scene.materials, scene.resolution, speed=speed)
    return FrameCost(particles=particles, substeps=substeps)


def cfl_substeps(
    scene: Scene,
    materials: Sequence[Material],
    resolution: int,
    *,
    speed: float = 0.0,
    cfl: float | None = None,
) -> int:
    """Return the number of substeps of a frame of a scene by the CFL law.

    Parameters
    ----------
    scene : Scene
    materials : sequence of Material
        Materials that count, such as `scene.materials`, one of them, or softer ones.
    resolution : int
        Grid cells per metre.
    speed : float
        Largest speed of particles plus that of obstacles [m/s].
    cfl : float in (0, 1], optional
        CFL number of all materials and of motion; each has its own if absent.
    """
    return _core.cfl_substeps(
        [material.to_native(scene.potential_drop) for material in materials],
        dim=scene.dim,
        resolution=resolution,
        frame_dt=scene.frame_dt,
        speed=speed,
        cfl=cfl,
    )


def costly_materials(scene: Scene, resolution: int, cfl: float | None) -> list[str]:
    """Return a sentence for each material whose waves alone need `MANY_SUBSTEPS` in a frame.

    `resolution` is that of the grid, in cells per metre; `cfl` is the CFL number of all materials, None for
    that of each.
    """
    texts = []
    for material in scene.materials:
        substeps = cfl_substeps(scene, [material], resolution, cfl=cfl)
        if substeps >= MANY_SUBSTEPS:
            native = material.to_native(scene.potential_drop)
            texts.append(
                f"{scene.made_of(material)}: {material.kind} of {native.density:g} kg/m^3 with waves of "
                f"{native.signal_speed(scene.dim):.0f} m/s takes {substeps} substeps in each frame of "
                f"{scene.frame_dt * 1e3:g} ms; make it denser or softer, or take a coarser grid"
            )
    return texts


def _speed_of_obstacle(motion: Motion | None) -> float:
    """Return a bound of an obstacle's speed [m/s]; its points are at most a diagonal of the box away."""
    if motion is None:
        return 0.0
    turn = float(np.linalg.norm(motion.angular_velocity or 0.0))
    return float(np.linalg.norm(motion.velocity or 0.0)) + turn * math.sqrt(3.0)
