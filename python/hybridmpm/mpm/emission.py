"""From emitters to the layers of particles that leave them."""

import numpy as np

from hybridmpm import _core
from hybridmpm.coarse.merging import spacing_at
from hybridmpm.errors import SceneError
from hybridmpm.scene import Emitter, Scene
from hybridmpm.scene.sampling import JITTER

_PATTERNS = 16
"""Layers with jitter of their own; they are used in turn."""


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
    # Of the material that the scene's own layers bring while this one moves on by its thickness.
    own_layer = len(emitter.sites(scene.spacing)) * scene.spacing**scene.dim
    volume = own_layer * (spacing / scene.spacing) / len(sites)
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
