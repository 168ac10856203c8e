"""Findings about viscous liquids that a grid does not show as their law says."""

import math
from collections.abc import Iterator

import numpy as np

from hybridmpm.checking.report import Finding
from hybridmpm.checking.speed import impact_speed
from hybridmpm.mpm.cost import cfl_substeps
from hybridmpm.scene import Liquid, Scene

WALL_LOSS = 0.03
"""Viscosity that no-slip walls a distance H apart seem to add, over dx^3 / (dt H) [-].

Measured in steady channels with sticky walls, 6 to 19 cells apart, within a factor of 1.5; viscosity itself
does not change it. Films on sticky floors and on those with friction agree."""
WITH_LOSS = 0.2
"""Factor on it with `transfer_loss`."""
ELASTIC = 0.4
"""Largest relaxation time, over the time that shear waves take through half of a body [-], of a liquid that
does not rebound: it keeps 2 % of its speed at 0.4, 18 % at 0.85 and half at 2.5."""
ELASTIC_YIELD = 0.1
"""Yield stress over that of a blow, rho c v [-], from which on it rebounds: at 0.08 with 6 % of its speed."""

_DEAR = 100.0
"""Factor on the bulk modulus from which on a lower viscosity is advised."""


def of_liquids(scene: Scene, resolution: int) -> Iterator[Finding]:
    """Yield the findings about the liquids of a scene; `resolution` is that of the simulator's grid."""
    for material in scene.materials:
        if isinstance(material, Liquid):
            yield from _thin(scene, material, resolution)
            yield from _elastic(scene, material)


def added_viscosity(scene: Scene, material: Liquid, resolution: int, thickness: float) -> float:
    """Return the viscosity [Pa s] that walls `thickness` [m] apart seem to add to a liquid's."""
    dt = scene.frame_dt / cfl_substeps(scene, scene.materials, resolution)
    kept = 1.0 if scene.transfer_loss is None else WITH_LOSS
    return kept * WALL_LOSS * material.density / (resolution**3 * dt * thickness)


def _thin(scene: Scene, liquid: Liquid, resolution: int) -> Iterator[Finding]:
    thickness = max(_extents(scene, liquid))
    gravity = float(np.linalg.norm(scene.gravity))
    # The rate of a flow that is as fast as the liquid is high.
    rate = math.sqrt(gravity / thickness) if gravity else 1.0
    own = liquid.yield_stress / rate + liquid.viscosity * rate ** (liquid.flow_index - 1)
    added = added_viscosity(scene, liquid, resolution, thickness)
    if own < added:
        loss = "" if scene.transfer_loss is not None else ", give transfer_loss, which leaves a fifth of it,"
        yield Finding(
            severity="warning",
            field=scene.made_of(liquid),
            problem=f"a liquid of {own:.2g} Pa s, {thickness:.2g} m thick, flows along walls like one of "
            f"about {own + added:.2g} Pa s on this grid",
            advice=f"take a finer grid{loss} or water, where viscosity does not matter",
        )


def _elastic(scene: Scene, liquid: Liquid) -> Iterator[Finding]:
    modulus = liquid.stiffness(scene.potential_drop or 1.0) / 2
    impedance = math.sqrt(modulus * liquid.density)
    half = min(_extents(scene, liquid)) / 2
    speed = impact_speed(scene, liquid)
    blow = impedance * speed
    # With other flow indices the viscosity at the shear rate of the blow counts.
    power = liquid.flow_index - 1
    viscosity = liquid.viscosity * ((speed / half) ** power if speed else float(power == 0))
    of_viscosity = viscosity / (ELASTIC * half * impedance)
    of_yield = liquid.yield_stress / (ELASTIC_YIELD * blow) if blow else 0.0
    if max(of_viscosity, of_yield) > 1:
        much = max(of_viscosity, of_yield) ** 2
        cause = "its viscosity" if of_viscosity >= of_yield else "its yield stress"
        bearable = (
            f"{liquid.viscosity / of_viscosity:.2g} Pa {'s^n' if power else 's'}"
            if of_viscosity >= of_yield
            else f"{liquid.yield_stress / of_yield:.2g} Pa"
        )
        stiffer = (
            f"give it {much:.2g} times the bulk_modulus, {2 * much * modulus:.2g} Pa, which takes "
            f"{math.sqrt(much):.2g} times the substeps"
        )
        yield Finding(
            severity="warning",
            field=scene.made_of(liquid),
            problem=f"{cause} is so high that it rebounds from a blow as an elastic solid of shear modulus "
            f"{modulus:.2g} Pa",
            advice=f"{stiffer if much <= _DEAR else f'lower it to {bearable}'}, or bear with it",
        )


def _extents(scene: Scene, liquid: Liquid) -> list[float]:
    """Return the smallest extent of each body of a liquid, and that across each of its emitters [m]."""
    bodies = [body.smallest_extent for body in scene.bodies if body.material == liquid]
    across = [
        emitter.bounds[1] - emitter.bounds[0] for emitter in scene.emitters if emitter.material == liquid
    ]
    return bodies + [float(extent[extent > 0].min()) for extent in across]
