"""Which scenarios a scene is like, whose errors stand in for its own, and where it differs from them."""

from dataclasses import dataclass

from hybridmpm import _core, scenarios
from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import models
from hybridmpm.planner.candidates import loaded
from hybridmpm.planner.cost import particle_count
from hybridmpm.scene import Scene

_NEAR = 1.25
"""Factor within which a length or a stiffness counts as the scenarios'."""


@dataclass(frozen=True, kw_only=True)
class Likeness:
    """What stands in for a scene."""

    scenarios: tuple[str, ...]
    """Scenarios whose worst error counts."""
    learned: bool
    """Whether the networks of these scenarios take the scene."""
    notes: tuple[str, ...]
    """Where the scene differs from the scenarios' scenes."""


def likeness(scene: Scene) -> Likeness:
    """Find the scenarios of the same dimension and materials, with obstacles where the scene has some."""
    kinds: list[str] = sorted({material.kind for material in scene.materials})
    notes = [
        f"nothing was calibrated for {strange}: figures of sand stand in for it"
        for strange in kinds
        if strange not in {"water", "sand"}
    ]
    known: list[str] = sorted({kind if kind in {"water", "sand"} else "sand" for kind in kinds}) or ["water"]
    names = _names(known, scene, notes)
    like = scenarios.get(names[0], 0)
    if not 1 / _NEAR < scene.resolution / like.resolution < _NEAR:
        notes.append(
            f"errors were measured on {like.resolution} cells per metre, the scene has {scene.resolution}"
        )
    if scene.is_open:
        notes.append(
            f"times are those of {particle_count(scene)} particles: all that emitters let in within "
            f"{scene.frames} frames, and nothing that sinks take away"
        )
    notes += _other_stiffness(scene, names)
    return Likeness(scenarios=names, learned=_learned(scene, names), notes=tuple(notes))


def _names(known: list[str], scene: Scene, notes: list[str]) -> tuple[str, ...]:
    if scene.dim == 2 and len(known) == 2:
        if scene.obstacles:
            notes.append("errors of water and sand together were measured without obstacles")
        return ("water_sand_2d",)
    if scene.dim == 2:
        return (f"{known[0]}_ramps_2d" if scene.obstacles else f"{known[0]}_2d",)
    if scene.obstacles:
        notes.append("errors in 3D were measured without obstacles")
    if len(known) == 2:
        notes.append("errors in 3D were measured with one material: the worse of the two counts")
    return tuple(f"{kind}_3d" for kind in known)


def _other_stiffness(scene: Scene, names: tuple[str, ...]) -> list[str]:
    """Tell of materials much stiffer or softer than those that errors were measured with."""
    usual: dict[str, _core.Material] = {}
    for name in names:
        one = scenarios.get(name, 0)
        usual |= {material.kind: material.to_native(one.potential_drop) for material in one.materials}
    found = []
    for material in scene.materials:
        if material.kind in usual:
            factor = material.to_native(scene.potential_drop).sound_speed / usual[material.kind].sound_speed
            if not 1 / _NEAR < factor < _NEAR:
                found.append(
                    f"errors were measured with {material.kind} whose waves are {1 / factor:.3g} times as "
                    "fast"
                )
    return found


def _learned(scene: Scene, names: tuple[str, ...]) -> bool:
    """Tell whether each network that serves the scenarios takes the scene."""
    mine = [name for name, entry in models().items() if set(names) <= set(entry.scenarios)]
    try:
        for name in mine:
            loaded(name, 1).check(scene)
    except ConfigError:
        return False
    return bool(mine)
