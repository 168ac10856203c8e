"""`TrainedOn`: the properties of the scenes of a training, against which other scenes are held."""

import functools
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self

from hybridmpm.errors import ConfigError
from hybridmpm.scenarios.scenarios import get
from hybridmpm.scene import Fluid, Material, Scene

_SHARED = ("dim", "frame_dt", "spacing", "lower", "upper", "gravity")
"""Properties that all scenes of a training must share."""
_MARGIN, _NEAR = 0.1, 0.01
"""Distances from a range of constants, over its width and over its end, up to which a constant counts as
within: a scene drawn from the same ranges may lie somewhat beyond those of the training."""
REFERENCE_DENSITY = 1000.0
"""Density [kg/m^3] at which constants are compared where all of a scene's materials have the same one."""
_PER_DENSITY = ("density", "youngs_modulus", "bulk_modulus", "viscosity", "yield_stress")
"""Constants that scale with it: matter of one density moves by its stiffness over its density alone."""


@dataclass(frozen=True, kw_only=True)
class TrainedOn:
    """Properties of scenes in D dimensions.

    Raises
    ------
    ConfigError
        A number is not finite, or there are not as many as there must be.
    """

    dim: int
    """Dimension D."""
    frame_dt: float
    """Length of a frame [s]."""
    spacing: float
    """Mean distance of neighbouring particles at r_p = 1 [m]."""
    lower: tuple[float, ...]
    """Lower corner of the walls (D,) [m]."""
    upper: tuple[float, ...]
    """Upper corner of the walls (D,) [m]."""
    gravity: tuple[float, ...]
    """(D,) [m/s^2]."""
    obstacles: bool
    """Whether any scene has obstacles."""
    materials: Mapping[str, Mapping[str, tuple[float, float]]] = field(hash=False)
    """Smallest and largest value of each constant of each material, in SI units, by `constants`."""

    def __post_init__(self) -> None:
        vectors = (self.lower, self.upper, self.gravity)
        numbers = [self.frame_dt, self.spacing, *(number for vector in vectors for number in vector)]
        numbers += [end for one in self.materials.values() for ends in one.values() for end in ends]
        if (
            self.dim not in {2, 3}
            or any(len(vector) != self.dim for vector in vectors)
            or not all(map(math.isfinite, numbers))
            or min(self.frame_dt, self.spacing) <= 0
        ):
            raise ConfigError(f"the scenes of a training must have finite numbers in 2D or 3D, got {self}")

    @classmethod
    def of(cls, scenes: Iterable[Scene]) -> Self:
        """Return what scenes, at least one, have in common.

        Raises
        ------
        ConfigError
            They differ in what one network must share, or one has emitters, sinks, moving obstacles or a
            world of its own size.
        """
        first: tuple[str, dict[str, Any]] | None = None
        materials: dict[str, dict[str, tuple[float, float]]] = {}
        obstacles = False
        for scene in scenes:
            _refuse_untrainable(scene)
            shared = {key: getattr(scene, key) for key in ("dim", "frame_dt", "spacing", "gravity")}
            shared |= {"lower": scene.walls.lower, "upper": scene.walls.upper}
            first = first or (scene.title, shared)
            for key in _SHARED:
                if shared[key] != first[1][key]:
                    raise ConfigError(
                        "one network is for scenes of one dimension, frame_dt, particle spacing, box and "
                        f"gravity: {key} is {first[1][key]} in {first[0]} and {shared[key]} in "
                        f"{scene.title}; train a network for each"
                    )
            obstacles |= bool(scene.obstacles)
            for material in scene.materials:
                ranges = materials.setdefault(material.kind, {})
                for key, value in constants(material, scene).items():
                    low, high = ranges.get(key, (value, value))
                    ranges[key] = (min(low, value), max(high, value))
        if first is None:
            raise ConfigError("a network needs at least one scene, got none")
        return cls(**first[1], obstacles=obstacles, materials=materials)

    @staticmethod
    @functools.cache
    def of_scenarios(names: tuple[str, ...]) -> "TrainedOn":
        """Return what scenarios have in common; errors as `of`, and `UnknownScenarioError`."""
        return TrainedOn.of(get(name, 0) for name in names)

    @property
    def bounds(self) -> list[list[float]]:
        """Lower and upper wall of each axis [m], as in a data set's metadata."""
        return [list(pair) for pair in zip(self.lower, self.upper, strict=True)]

    def constant_beyond(self, scene: Scene) -> tuple[Material, str, float, tuple[float, float]] | None:
        """Return a material, and name, value and known range of its constant that is out of this range.

        None where there is none; the materials must be known.
        """
        for material in scene.materials:
            for name, value in constants(material, scene).items():
                low, high = self.materials[material.kind][name]
                margin = _MARGIN * (high - low) + _NEAR * abs(high)
                if not low - margin <= value <= high + margin:
                    scaled = name in _PER_DENSITY and _factor(material, scene) != 1
                    label = f"{name} per {REFERENCE_DENSITY:g} kg/m^3" if scaled else name
                    return material, label, value, (low, high)
        return None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that `from_dict` reads."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], *, where: str) -> Self:
        """Read what `to_dict` gave; where it is damaged, raises `ConfigError` that begins with `where`."""
        try:
            plain: dict[str, Any] = {
                key: tuple(value) if isinstance(value, list) else value for key, value in data.items()
            }
            plain["materials"] = {
                kind: {name: (float(low), float(high)) for name, (low, high) in ranges.items()}
                for kind, ranges in plain["materials"].items()
            }
            # Older metadata have the densities of the scenes.
            densities = {end for ranges in plain["materials"].values() for end in ranges["density"]}
            if len(densities) == 1:
                factor = REFERENCE_DENSITY / densities.pop()
                for ranges in plain["materials"].values():
                    ranges |= {
                        key: (factor * ranges[key][0], factor * ranges[key][1])
                        for key in ranges.keys() & _PER_DENSITY
                    }
            return cls(**plain)
        except (TypeError, ValueError, KeyError, AttributeError) as error:
            raise ConfigError(f"{where} does not describe the scenes of its training: {error}") from None


def constants(material: Material, scene: Scene) -> dict[str, float]:
    """Return the numbers of a material of a scene by name, its stiffness as it follows from the scene.

    Where all materials have one density, it and the stiffness are those at `REFERENCE_DENSITY`: the scene
    moves the same with them.
    """
    numbers = material.model_dump(exclude={"kind", "bulk_modulus", "max_compression"})
    if isinstance(material, Fluid):
        numbers["bulk_modulus"] = material.stiffness(scene.potential_drop)
    factor = _factor(material, scene)
    return {name: number * (factor if name in _PER_DENSITY else 1.0) for name, number in numbers.items()}


def _factor(material: Material, scene: Scene) -> float:
    """Return the reference density over a material's where all of the scene have it, else 1."""
    same = len({one.density for one in scene.materials}) == 1
    return REFERENCE_DENSITY / material.density if same else 1.0


def _refuse_untrainable(scene: Scene) -> None:
    if scene.world is not None:
        raise ConfigError(
            f"{scene.title}: a network is trained in a world of one metre along each axis: leave `world` out"
        )
    if scene.is_open:
        raise ConfigError(
            f"{scene.title}: a network is trained on the same particles throughout: remove emitters and sinks"
        )
    if any(obstacle.motion is not None for obstacle in scene.obstacles):
        raise ConfigError(
            f"{scene.title}: a network is trained with obstacles at rest: remove the motion of obstacles"
        )
