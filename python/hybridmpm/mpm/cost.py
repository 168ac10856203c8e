"""Materials that make frames slow."""

import math

from hybridmpm.scene import Scene

MANY_SUBSTEPS = 200
"""Substeps of a frame from which on the scene is said to be slow."""


def costly_materials(scene: Scene, resolution: int, cfl: float | None) -> list[str]:
    """Return a sentence for each material whose waves alone ask for `MANY_SUBSTEPS` in a frame.

    `resolution` is the grid's, in cells per metre; `cfl` is the CFL number of all materials, None for that of
    each.
    """
    texts = []
    for index, material in enumerate(scene.materials):
        native = material.to_native(scene.potential_drop)
        step = (cfl or native.default_cfl) / (resolution * native.signal_speed(scene.dim))
        substeps = math.ceil(scene.frame_dt / step)
        if substeps >= MANY_SUBSTEPS:
            places = [
                f"{field}[{place}]"
                for field, owners in (("bodies", scene.bodies), ("emitters", scene.emitters))
                for place, owner in enumerate(owners)
                if scene.materials.index(owner.material) == index
            ]
            texts.append(
                f"{', '.join(places)}: {material.kind} of {native.density:g} kg/m^3 with waves of "
                f"{native.signal_speed(scene.dim):.0f} m/s takes {substeps} substeps in each frame of "
                f"{scene.frame_dt * 1e3:g} ms; make it denser or softer, or take a coarser grid"
            )
    return texts
