"""Pictures of particles by plain numpy: `view_of(scene, types, width).draw(x, v, time)` gives RGB bytes."""

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
"""Between pictures side by side [pixels]."""


class View(Protocol):
    """Draws frames of one scene, all of one size with even height and width."""

    def draw(
        self, x: npt.NDArray[np.float32], v: npt.NDArray[np.float32], time: float = 0.0
    ) -> npt.NDArray[np.uint8]:
        """Picture uint8 (H, W, 3) of particles at `x` (N, D) [m] with velocities `v` (N, D) [m/s].

        Particles at NaN are left out. Moving obstacles are where they are at `time` [s].
        """


def view_of(scene: Scene, types: npt.NDArray[np.uint8], width: int = 640) -> View:
    """Prepare to draw `scene`.

    Parameters
    ----------
    scene : Scene
        Walls and obstacles are drawn from it.
    types : uint8 (N,)
        DeepMind's particle types, which choose the colours.
    width : int in [64, 4096]
        Of the pictures [pixels], rounded up to an even number.

    Raises
    ------
    ConfigError
        `width` is out of range.
    """
    if not MIN_WIDTH <= width <= MAX_WIDTH:
        raise ConfigError(f"width must be in [{MIN_WIDTH}, {MAX_WIDTH}] pixels, got {width}")
    return FlatView(scene, types, width) if scene.dim == 2 else PerspectiveView(scene, types, width)


def side_by_side(pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.uint8]:
    """Join pictures (H, W, 3) of one height into one, left to right with a narrow white gap."""
    gap = np.full((pictures[0].shape[0], _GAP, 3), 255, dtype=np.uint8)
    parts = [part for picture in pictures for part in (gap, picture)][1:]
    return np.concatenate(parts, axis=1)
