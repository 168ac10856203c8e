"""The choice of a network of control for a scene."""

from typing import Any

from hybridmpm._support.networks import Network, ServedNetwork, cached
from hybridmpm.control.methods.method import FallBack
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scenarios.trained_on import TrainedOn
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
        for one in _of_dimension(kind, scene.dim) if name is None else [name]:
            network: Any = cached(kind, one)
            if (reason := why_foreign(scene, network.spec.trained_on)) is None:
                return network  # type: ignore[no-any-return]
            reasons.append(f"{one} cannot serve this scene: {reason}")
    except (DataError, ConfigError) as error:
        raise FallBack(f"there is no network: {error}") from error
    raise FallBack("; ".join(reasons) or f"no network in {scene.dim}D comes with this library")


def _of_dimension(kind: type[ServedNetwork], dim: int) -> list[str]:
    """Return the names of the library's networks for a dimension, without loading any."""
    return [name for name, entry in kind.FOLDER.entries().items() if entry.get("dim") == dim]


def why_foreign(scene: Scene, trained: TrainedOn) -> str | None:
    """Return the first difference of a scene to the training data of a network; None if there is none."""
    if scene.dim != trained.dim:
        return f"it is trained in {trained.dim}D only"
    foreign = sorted({material.kind for material in scene.materials} - trained.materials.keys())
    box, like = scene.walls.lower + scene.walls.upper, trained.lower + trained.upper
    differences = {
        "it is trained without obstacles": scene.obstacles and not trained.obstacles,
        "it is trained with obstacles at rest": any(one.motion is not None for one in scene.obstacles),
        "it is trained without emitters and sinks": scene.is_open,
        "it is trained in worlds of one metre along each axis": not _alike(scene.size, (1.0,) * scene.dim),
        "it is trained in another box": not _alike(box, like),
        "it is trained under another gravity": not _alike(scene.gravity, trained.gravity),
        f"it is trained without {' and '.join(foreign)}": foreign,
    }
    return next((text for text, differs in differences.items() if differs), None)


def _alike(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= _NEAR * max(1.0, abs(b)) for a, b in zip(one, other, strict=True))
