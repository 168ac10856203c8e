"""Pictures of particles, by numpy alone: `view_of(scene, types, width).draw(x, v, time)` gives RGB bytes."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError
from hybridmpm.render.flat import FlatView
from hybridmpm.render.perspective import PerspectiveView
from hybridmpm.scene import Scene

__all__ = ["MAX_WIDTH", "MIN_WIDTH", "View", "side_by_side", "view_of"]

MIN_WIDTH, MAX_WIDTH = 64, 4096
_GAP = 6
"""Distance between pictures side by side [pixels]."""


class View(Protocol):
    """Draws states of one scene as pictures of one size, whose height and width are even."""

    def draw(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        time: float = 0.0,
        rigid: npt.NDArray[np.float64] | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Draw particles at `x` (N, D) [m] with velocities `v` (N, D) [m/s] as a picture, uint8 (H, W, 3).

        Particles whose position is NaN are left out. Moving obstacles are drawn where they are at `time` [s],
        rigid bodies by their numbers (B, 13), see `Recording.rigid`.
        """


def view_of(
    scene: Scene, types: npt.NDArray[np.uint8], width: int = 640, spacing: float | None = None
) -> View:
    """Return a view that draws states of a scene.

    Parameters
    ----------
    scene : Scene
        Scene with the walls and obstacles to draw.
    types : uint8 (N,)
        DeepMind's particle types, which choose the colours.
    width : int in [64, 4096]
        Width of the pictures [pixels], rounded up to an even number.
    spacing : float, optional
        Distance of the particles at rest [m], by which they are drawn as large; that of the scene if not
        given.

    Raises
    ------
    ConfigError
        `width` is out of range.
    """
    if not MIN_WIDTH <= width <= MAX_WIDTH:
        raise ConfigError(f"width must be in [{MIN_WIDTH}, {MAX_WIDTH}] pixels, got {width}")
    kind = FlatView if scene.dim == 2 else PerspectiveView
    return kind(scene, types, width, scene.spacing if spacing is None else spacing)


def side_by_side(pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.uint8]:
    """Join pictures (H, W, 3) of equal height into one, from left to right with narrow white gaps."""
    gap = np.full((pictures[0].shape[0], _GAP, 3), 255, dtype=np.uint8)
    parts = [part for picture in pictures for part in (gap, picture)][1:]
    return np.concatenate(parts, axis=1)
