"""Which scenes a network of control is not for."""

from collections.abc import Sequence

from hybridmpm import scenarios
from hybridmpm.scene import Scene

_NEAR = 1e-3
"""Relative difference of lengths and accelerations that count as the same."""


def why_foreign(scene: Scene, names: Sequence[str]) -> str | None:
    """Tell in which way a scene is of another kind than scenarios without obstacles; None if it is not.

    Parameters
    ----------
    scene : Scene
    names : sequence of str
        Scenarios that a network is trained on; they share dimension, box and gravity.
    """
    like = scenarios.get(names[0], 0)
    if scene.dim != like.dim:
        return f"it is trained in {like.dim}D only"
    if scene.obstacles:
        return "it is trained without obstacles"
    if scene.is_open:
        return "it is trained without emitters and sinks"
    if not _alike(scene.walls.lower + scene.walls.upper, like.walls.lower + like.walls.upper):
        return "it is trained in another box"
    if not _alike(scene.gravity, like.gravity):
        return "it is trained under another gravity"
    known = {material.kind for name in names for material in scenarios.get(name, 0).materials}
    foreign = sorted({material.kind for material in scene.materials} - known)
    return f"it is trained without {foreign[0]}" if foreign else None


def _alike(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= _NEAR * max(1.0, abs(b)) for a, b in zip(one, other, strict=True))
