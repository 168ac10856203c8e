"""Scenarios that match a scene: their errors stand in for its own."""

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
class MatchingScenarios:
    """Scenarios whose errors stand in for a scene's."""

    names: tuple[str, ...]
    """Their names; the worst of their errors counts."""
    learned: bool
    """Whether the networks of these scenarios accept the scene."""
    notes: tuple[str, ...]
    """Differences of the scene from the scenarios' scenes."""


def matching_scenarios(scene: Scene) -> MatchingScenarios:
    """Return the scenarios of the same dimension and materials, with obstacles where the scene has some."""
    kinds: list[str] = sorted({material.kind for material in scene.materials})
    notes = [
        f"nothing was calibrated for {strange}: figures of sand are used"
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
            f"times are those of {particle_count(scene)} particles: all that emitters add within "
            f"{scene.frames} frames, without what sinks remove"
        )
    notes += _other_stiffness(scene, names)
    return MatchingScenarios(names=names, learned=_learned(scene, names), notes=tuple(notes))


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
    """Return notes on materials much stiffer or softer than those of the scenarios."""
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
    """Return whether each network of the scenarios accepts the scene."""
    mine = [name for name, entry in models().items() if set(names) <= set(entry.scenarios)]
    try:
        for name in mine:
            loaded(name, 1).check(scene)
    except ConfigError:
        return False
    return bool(mine)
