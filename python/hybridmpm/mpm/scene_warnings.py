"""Warnings about the matter of a scene, from the scene alone: soft materials."""

import numpy as np

from hybridmpm.scene import Fluid, Material, Scene

SOFT = 0.1
"""Smallest compression of a material by its own weight that counts as too soft [-]."""


def settled_compression(scene: Scene, material: Material) -> float:
    """Return the approximate compression of a material at its lowest point at rest [-].

    It is the pressure of the material alone, over its modulus against compression along one axis. A fluid
    counts as spread over the whole floor, other materials as their tallest body at the start. Above 1 the
    material collapses.
    """
    gravity = np.array(scene.gravity)
    axis = int(np.argmax(np.abs(gravity)))
    mine = [body for body in scene.bodies if body.material == material]
    if isinstance(material, Fluid):
        sides = np.array(scene.walls.upper) - np.array(scene.walls.lower)
        depth = sum(body.measure for body in mine) / float(np.prod(np.delete(sides, axis)))
    else:
        depth = max((float((body.bounds[1] - body.bounds[0])[axis]) for body in mine), default=0.0)
    # Without gravity no stiffness of a fluid follows from its depth, and any number above 0 gives 0.
    native = material.to_native(scene.potential_drop or 1.0)
    modulus = native.density * native.sound_speed**2
    return float(native.density * abs(gravity[axis]) * depth / modulus)


def soft_materials(scene: Scene) -> list[str]:
    """Return a warning for each material that its own weight compresses by more than `SOFT`.

    Fluids with `max_compression` is left out: there the compression is the caller's choice.
    """
    texts = []
    for material in scene.materials:
        compression = settled_compression(scene, material)
        asked_for = isinstance(material, Fluid) and material.max_compression is not None
        if compression > SOFT and not asked_for:
            or_so = ", or give max_compression" if isinstance(material, Fluid) else ""
            texts.append(
                f"{scene.made_of(material)}: {material.kind} is so soft that its own weight compresses it by "
                f"{min(compression, 1.0):.0%}, so it loses its volume; make it {compression / SOFT:.2g} "
                f"times as stiff{or_so}"
            )
    return texts
