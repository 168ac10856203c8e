"""From a scene and settings to the compiled solver, and to the particles that it carries."""

import math

from hybridmpm import _core
from hybridmpm.coarse import CoarseLevel, Upsampler, merge
from hybridmpm.coarse.upsampler import Few
from hybridmpm.errors import ConfigError
from hybridmpm.mpm.emission import native_emitters
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.scene import Scene


def native_solver(
    scene: Scene,
    *,
    substeps: str | int,
    cfl: float | None,
    allow_unstable: bool,
    sleep: Sleep | None,
    level: CoarseLevel,
    threads: int,
) -> _core.Solver:
    """Build the solver of a scene's particles, merged as a coarse level says; see `MpmSolver` for the settings."""
    particles = merge(scene.sample(), level.r_p)
    materials = [
        material.softened(factor, scene.potential_drop) if factor < 1 else material
        for material, factor in zip(scene.materials, level.moduli, strict=True)
    ]
    return _core.Solver(
        resolution=level.resolution,
        frame_dt=scene.frame_dt,
        gravity=scene.gravity,
        wall_lower=scene.walls.lower,
        wall_upper=scene.walls.upper,
        wall_contact=[contact for contact, _ in scene.walls.surfaces],
        wall_friction=[friction for _, friction in scene.walls.surfaces],
        materials=[material.to_native(scene.potential_drop) for material in materials],
        obstacles=[obstacle.to_native() for obstacle in scene.obstacles],
        emitters=native_emitters(scene, level.r_p),
        sinks=[sink.to_native() for sink in scene.sinks],
        # A part of them must not leave room for more material than all of them.
        max_particles=max(math.ceil(level.r_p * scene.max_particles), len(particles.x)),
        x=particles.x,
        v=particles.v,
        material=particles.material,
        mass=particles.mass,
        volume=particles.volume,
        substeps=substeps,
        cfl=cfl,
        sleep_speed=None if sleep is None else sleep.speed,
        sleep_frames=1 if sleep is None else sleep.frames,
        allow_unstable=allow_unstable,
        threads=threads,
    )


def upsampler_of(scene: Scene, few: Few, solver: _core.Solver, level: CoarseLevel) -> Upsampler:
    """Return who carries all particles of a scene along with few that start as a solver's.

    Raises
    ------
    ConfigError
        There is nothing to carry.
    """
    if level.r_p == 1:
        raise ConfigError(
            "show_all=True needs r_p below 1, such as 1/16: at r_p = 1 the solver simulates all particles of "
            "the scene itself, so there is nothing to carry"
        )
    return Upsampler(
        scene,
        few,
        solver,
        native_emitters(scene),
        affine_share=level.affine_share,
        relaxation=level.relaxation,
    )
