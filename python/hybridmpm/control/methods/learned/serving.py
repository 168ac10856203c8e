"""The choice of a network of control for a scene."""

from collections.abc import Sequence
from typing import Any

from hybridmpm import scenarios
from hybridmpm._support.networks import Network, cached
from hybridmpm.control.methods.method import FallBack
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene import Scene

_NEAR = 1e-3
"""Relative difference of lengths and accelerations that count as the same."""


def serving(kind: type[Network], name: str | None, scene: Scene) -> Network:
    """Return the network of a name or file, or the first of the library, that serves a scene.

    Raises
    ------
    FallBack
        None serves it; the message has the reasons.
    """
    reasons = []
    try:
        for one in kind.FOLDER.entries() if name is None else [name]:
            network: Any = cached(kind, one)
            if (reason := why_foreign(scene, network.spec.scenarios)) is None:
                return network  # type: ignore[no-any-return]
            reasons.append(f"{one} cannot serve this scene: {reason}")
    except (DataError, ConfigError) as error:
        raise FallBack(f"there is no network: {error}") from error
    raise FallBack("; ".join(reasons) or "no network comes with this library")


def why_foreign(scene: Scene, names: Sequence[str]) -> str | None:
    """Return the first difference of a scene to the training data of a network; None if there is none.

    Parameters
    ----------
    scene : Scene
    names : sequence of str
        Scenarios in the training data, without obstacles; they share dimension, box and gravity.
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
