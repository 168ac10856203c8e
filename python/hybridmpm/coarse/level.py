"""`CoarseLevel`: settings of coarse mode in one scene, and the bounds within which they were fitted."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from hybridmpm._support.suggestions import nearest
from hybridmpm.coarse.merging import FEWEST_PER_CELL, checked_ratio, coarse_resolution
from hybridmpm.coarse.table import CoarseTable, FittedLevel, coarse_table
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Emitter, Scene

FULL = 0.97
"""Share of the box between the walls [-] from which on matter has no free surface."""


@dataclass(frozen=True, kw_only=True)
class CoarseLevel:
    """Settings of coarse mode in one scene: of coarse MPM and of the upsampling to shown particles.

    The core checks the ranges of `resolution`, `cfl`, `affine_share` and `relaxation`.
    """

    name: str | None
    """Name in the table of fitted levels, such as "1/16"; None for settings that were not fitted."""
    r_p: float
    """Number of coarse particles over that of the scene, in (0, 1]."""
    resolution: int
    """Grid cells per metre."""
    moduli: tuple[float, ...]
    """Factor on the elastic moduli of each of the scene's materials, in (0, 1] [-]."""
    cfl: float | None = None
    """CFL number of the substeps, in (0, 1]; None for that of each material."""
    affine_share: float = 0.5
    """Part of the affine motion of coarse particles that is interpolated, in [0, 1] [-]."""
    relaxation: float = 2.0
    """Displacement of shown particles in a pass of the density relaxation [cells] per excess density and
    cell, in [0, 8]."""
    fastest: float | None = None
    """Largest speed of matter in the scenes of the fit [m/s]; None for settings that were not fitted."""

    def __post_init__(self) -> None:
        checked_ratio(self.r_p)
        for factor in self.moduli:
            if not 0 < factor <= 1:
                raise ConfigError(f"the moduli of a coarse level are factors in (0, 1], got {factor!r}")

    @classmethod
    def unfitted(cls, scene: Scene, r_p: float) -> Self:
        """Return the coarse level with the scene's own materials and the grid that fits the particles."""
        return cls(
            name=None,
            r_p=checked_ratio(r_p),
            resolution=coarse_resolution(scene, r_p),
            moduli=(1.0,) * len(scene.materials),
        )

    def named(self, name: str) -> Self:
        """Return the same settings under a name."""
        return dataclasses.replace(self, name=name)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain data for JSON."""
        return dataclasses.asdict(self) | {"moduli": list(self.moduli)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read the data of `to_dict`; raises TypeError or KeyError for wrong fields."""
        return cls(**{**data, "moduli": tuple(data["moduli"])})


def coarse_level(scene: Scene, name: str, table: CoarseTable | None = None) -> CoarseLevel:
    """Return the settings of a fitted level in a scene; `coarse_warnings` checks whether they suit it.

    With several materials, the grid has as many particles per cell as the material that needs most, step and
    affine share are the smallest and the relaxation is the largest of all; each material keeps its own
    modulus. A material without a fit in this dimension, such as an elastic solid, has the constants of
    `MpmSolver(r_p=..., show_all=True)`.

    Moduli are lowered only as far as matter settled between the walls is compressed by
    `CoarseTable.largest_compression`, or as far as the scene's own moduli allow: so deep scenes get a stiffer
    level, which takes more substeps.

    Parameters
    ----------
    scene : Scene
    name : str
        Name of a level, such as "1/16".
    table : CoarseTable, optional
        Fitted levels; those of the library if absent.

    Raises
    ------
    ConfigError
        There is no such level, or its grid would be too coarse for the scene.
    """
    known = coarse_table() if table is None else table
    r_p = _ratio(name, known)
    entries = [known.find(material.kind, scene.dim, name) for material in scene.materials]
    fitted = [entry for entry in entries if entry is not None]
    plain = CoarseLevel.unfitted(scene, r_p)
    if not fitted:
        return plain.named(name)
    natives = [material.to_native(scene.potential_drop) for material in scene.materials]
    unfitted = [native for native, entry in zip(natives, entries, strict=True) if entry is None]
    per_cell = max([entry.particles_per_cell for entry in fitted] + [FEWEST_PER_CELL] * bool(unfitted))
    settled = settled_potential(scene) / known.largest_compression
    return CoarseLevel(
        name=name,
        r_p=r_p,
        resolution=coarse_resolution(scene, r_p, per_cell),
        moduli=tuple(
            1.0 if entry is None else _modulus(entry, settled / native.sound_speed**2)
            for native, entry in zip(natives, entries, strict=True)
        ),
        cfl=min([entry.cfl for entry in fitted] + [native.default_cfl for native in unfitted]),
        affine_share=min([entry.affine_share for entry in fitted] + [plain.affine_share] * bool(unfitted)),
        relaxation=max([entry.relaxation for entry in fitted] + [plain.relaxation] * bool(unfitted)),
        fastest=min(entry.fastest for entry in fitted),
    )


def _modulus(entry: FittedLevel, least: float) -> float:
    """Return the factor on a material's moduli, at least `least` for the depth of the scene."""
    return min(1.0, max(entry.modulus, least))


def _ratio(name: str, table: CoarseTable) -> float:
    ratios = table.ratios
    if isinstance(name, str) and name in ratios:
        return ratios[name]
    known = ", ".join(repr(one) for one in ratios)
    raise ConfigError(f"coarse level must be one of {known}, got {name!r}{_suggestion(name, ratios)}")


def _suggestion(name: object, ratios: dict[str, float]) -> str:
    """Return a question with the nearest coarse level; empty if none is near."""
    near: str | None = None
    if isinstance(name, int | float) and not isinstance(name, bool) and name > 0 and math.isfinite(name):
        near = min(ratios, key=lambda one: abs(math.log(ratios[one] / name)))
    else:
        near = nearest(name, ratios)
    return "" if near is None else f"; did you mean {near!r}?"


def settled_potential(scene: Scene) -> float:
    """Return the product g h [m^2/s^2], where h is the depth of all matter, settled between the walls."""
    sides = np.subtract(scene.walls.upper, scene.walls.lower)
    return float(np.abs(scene.gravity) @ sides) * filled_share(scene)


def filled_share(scene: Scene) -> float:
    """Return the volume of all matter over that of the box between the walls [-].

    Matter of emitters counts up to the scene's suggested length. Obstacles count as free space.
    """
    sides = np.subtract(scene.walls.upper, scene.walls.lower)
    volume = sum(body.measure for body in scene.bodies)
    volume += sum(_emitted(scene, emitter) for emitter in scene.emitters)
    largest = scene.max_particles * scene.spacing**scene.dim
    return float(min(volume, largest) / sides.prod())


def fastest_impact(scene: Scene, place: Sequence[float] | None = None) -> float:
    """Return a bound of the speed [m/s] of matter in free fall at the floor, or at a place (D,) [m]."""
    gravity = np.array(scene.gravity)
    if place is None:
        floor = np.maximum(gravity * scene.walls.lower, gravity * scene.walls.upper).sum()
    else:
        floor = gravity @ place
    squares = [0.0]
    for part in (*scene.bodies, *scene.emitters):
        lower, upper = part.bounds
        top = np.minimum(gravity * lower, gravity * upper).sum()
        velocity = part.velocity or ()
        squares.append(sum(v**2 for v in velocity) + 2 * (floor - top))
    return math.sqrt(max(squares))


def _emitted(scene: Scene, emitter: Emitter) -> float:
    """Return the volume [m^D] that an emitter adds within the scene's suggested length."""
    end = scene.frames * scene.frame_dt
    seconds = max(0.0, min(end, emitter.stop if emitter.stop is not None else end) - emitter.start)
    return float(emitter.measure * emitter.speed * seconds)
