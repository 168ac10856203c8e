"""The compiled solver, upsampler and emitters of a scene."""

import math

import numpy as np

from hybridmpm import _core
from hybridmpm.coarse import CoarseLevel, Upsampler
from hybridmpm.coarse.merging import spacing_at
from hybridmpm.coarse.upsampler import CoarseParticles
from hybridmpm.errors import ConfigError, SceneError
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.scene import Emitter, Particles, Scene
from hybridmpm.scene.sampling import JITTER
from hybridmpm.scene.world import cells_of

_PATTERNS = 16
"""Number of layers with jitter of their own; they are used in turn."""


def native_solver(
    scene: Scene,
    particles: Particles,
    *,
    substeps: str | int,
    cfl: float | None,
    allow_unstable: bool,
    sleep: Sleep | None,
    level: CoarseLevel,
    threads: int,
) -> _core.Solver:
    """Return the solver of a scene's particles, as merged for a coarse level; settings as in `MpmSolver`.

    Raises
    ------
    SceneError
        Rigid bodies overlap each other or something else.
    ConfigError
        A setting is not allowed.
    """
    materials = [
        material.softened(factor, scene.potential_drop) if factor < 1 else material
        for material, factor in zip(scene.materials, level.moduli, strict=True)
    ]
    try:
        return _core.Solver(
            resolution=level.resolution,
            cells=cells_of(scene.size, level.resolution),
            frame_dt=scene.frame_dt,
            gravity=scene.gravity,
            wall_lower=scene.walls.lower,
            wall_upper=scene.walls.upper,
            wall_contact=[contact for contact, _ in scene.walls.surfaces],
            wall_friction=[friction for _, friction in scene.walls.surfaces],
            materials=[material.to_native(scene.potential_drop) for material in materials],
            obstacles=[obstacle.to_native() for obstacle in scene.obstacles],
            rigid=[body.to_native() for body in scene.rigid],
            emitters=native_emitters(scene, level.r_p),
            sinks=[sink.to_native() for sink in scene.sinks],
            # The limit of the scene's own particles, in particles of this size.
            max_particles=max(math.ceil(level.r_p * scene.max_particles), len(particles.x)),
            x=particles.x,
            v=particles.v,
            material=particles.material,
            mass=particles.mass,
            volume=particles.volume,
            body=particles.body.astype(np.uint32),
            contact_friction=scene.contact_friction,
            transfer_loss=scene.transfer_loss,
            substeps=substeps,
            cfl=cfl,
            sleep_speed=None if sleep is None else sleep.speed,
            sleep_frames=1 if sleep is None else sleep.frames,
            allow_unstable=allow_unstable,
            threads=threads,
        )
    except ConfigError as error:
        if error.fault is None:
            raise
        raise SceneError.of([error.fault]) from None


def upsampler_of(
    scene: Scene, coarse: CoarseParticles, solver: _core.Solver, level: CoarseLevel
) -> Upsampler:
    """Return the upsampler from coarse particles, which start as a solver's, to all particles of a scene.

    Raises
    ------
    ConfigError
        At `r_p` = 1 the solver's particles are those of the scene.
    """
    if level.r_p == 1:
        raise ConfigError(
            "show_all=True needs r_p below 1, such as 1/16: at r_p = 1 the solver simulates and shows all "
            "particles of the scene itself"
        )
    return Upsampler(
        scene,
        coarse,
        solver,
        native_emitters(scene),
        affine_share=level.affine_share,
        relaxation=level.relaxation,
    )


def native_emitters(scene: Scene, r_p: float = 1.0) -> list[_core.Emitter]:
    """Build the core's emitters; a layer is one spacing thick, its back lies on the opening.

    At a ratio `r_p` below 1 particles are larger and fewer, and layers thicker; the flow of mass is that of
    the scene's own emitters.

    Raises
    ------
    SceneError
        An obstacle at rest is in front of an opening.
    """
    materials = scene.materials
    return [
        _native_emitter(scene, index, emitter, materials.index(emitter.material), r_p)
        for index, emitter in enumerate(scene.emitters)
    ]


def _native_emitter(scene: Scene, index: int, emitter: Emitter, material: int, r_p: float) -> _core.Emitter:
    spacing = spacing_at(scene, r_p)
    sites = emitter.sites(spacing) + 0.5 * spacing * emitter.direction
    for number, obstacle in enumerate(scene.obstacles):
        solid = obstacle.to_native()
        if obstacle.motion is None and (solid.signed_distance(sites.astype(np.float32)) <= 0).any():
            text = f"must open into free space, but obstacles[{number}] is in front of it"
            raise SceneError.of([(f"emitters[{index}]", text)])
    rng = np.random.default_rng(emitter.seed)
    volume = emitter.measure * spacing / len(sites)
    return _core.Emitter(
        material=material,
        velocity=emitter.velocity,
        spacing=spacing,
        sites=sites.astype(np.float32),
        jitter=(spacing * rng.uniform(-JITTER, JITTER, (_PATTERNS, *sites.shape))).astype(np.float32),
        mass=emitter.material.density * volume,
        volume=volume,
        start=emitter.start,
        stop=emitter.stop,
    )
