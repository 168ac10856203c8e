"""What a frame will cost, told from its scene alone, and the materials that make it slow."""

import math
from dataclasses import dataclass

import numpy as np

from hybridmpm.scene import Material, Motion, Scene

MANY_SUBSTEPS = 200
"""Substeps of a frame from which on the scene is said to be slow."""
_SPEED_CFL = 0.55
"""Part of a cell that a particle may cross in a substep, as in rust/mpm/src/substep/timestep.rs."""


@dataclass(frozen=True)
class FrameCost:
    """About how much work the first frame of a scene is for MPM, as its CFL bound cuts it into substeps."""

    particles: int
    """Number of particles."""
    substeps: int
    """Number of substeps: what materials, speeds at the start and moving obstacles ask for."""

    @property
    def particle_substeps(self) -> int:
        """Particles times substeps, to which the time of a frame is about proportional."""
        return self.particles * self.substeps


def frame_cost(scene: Scene) -> FrameCost:
    """Estimate what a frame of a scene costs, without making a particle.

    Particles in overlapping bodies are counted twice. Speeds that come later, e.g. by a force, may ask for
    more substeps.
    """
    particles = math.ceil(sum(body.measure for body in scene.bodies) / scene.spacing**scene.dim)
    steps = [_step(material, scene, scene.resolution, None) for material in scene.materials]
    speed = max((float(np.linalg.norm(body.velocity or 0.0)) for body in scene.bodies), default=0.0)
    speed += max((_speed_of_obstacle(obstacle.motion) for obstacle in scene.obstacles), default=0.0)
    if speed > 0.0:
        steps.append(_SPEED_CFL * scene.dx / speed)
    return FrameCost(particles=particles, substeps=math.ceil(scene.frame_dt / min(steps)))


def costly_materials(scene: Scene, resolution: int, cfl: float | None) -> list[str]:
    """Return a sentence for each material whose waves alone ask for `MANY_SUBSTEPS` in a frame.

    `resolution` is the grid's, in cells per metre; `cfl` is the CFL number of all materials, None for that of
    each.
    """
    texts = []
    counts = substeps_by_material(scene, resolution, cfl)
    for material, substeps in zip(scene.materials, counts, strict=True):
        if substeps >= MANY_SUBSTEPS:
            native = material.to_native(scene.potential_drop)
            texts.append(
                f"{scene.made_of(material)}: {material.kind} of {native.density:g} kg/m^3 with waves of "
                f"{native.signal_speed(scene.dim):.0f} m/s takes {substeps} substeps in each frame of "
                f"{scene.frame_dt * 1e3:g} ms; make it denser or softer, or take a coarser grid"
            )
    return texts


def substeps_by_material(scene: Scene, resolution: int, cfl: float | None) -> list[int]:
    """Return how many substeps a frame the waves of each material of `Scene.materials` ask for.

    Parameters are those of `costly_materials`.
    """
    return [
        math.ceil(scene.frame_dt / _step(material, scene, resolution, cfl)) for material in scene.materials
    ]


def _step(material: Material, scene: Scene, resolution: int, cfl: float | None) -> float:
    """Return the longest substep [s] that the waves of a material allow."""
    native = material.to_native(scene.potential_drop)
    return (cfl or native.default_cfl) / (resolution * native.signal_speed(scene.dim))


def _speed_of_obstacle(motion: Motion | None) -> float:
    """Return a bound of an obstacle's speed [m/s]; its points are at most a diagonal of the box away."""
    if motion is None:
        return 0.0
    turn = float(np.linalg.norm(motion.angular_velocity or 0.0))
    return float(np.linalg.norm(motion.velocity or 0.0)) + turn * math.sqrt(3.0)
