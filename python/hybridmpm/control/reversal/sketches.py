"""The sketch that stands for a motion: where the fluid goes, or the region where it ends."""

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.sketch.sketch import MIN_LENGTH, Arrow, Ellipse, width_of_depth
from hybridmpm.scene import Walls

SEGMENTS = 8
"""Number of segments of an arrow, of equal duration."""
_SIGMAS = 2.0
"""Semi-axis of an oval over the standard deviation of the particles along it."""


def arrow_of(motion: npt.NDArray[np.float32], weight: Floats, walls: Walls) -> Arrow:
    """Return the arrow along the way of the centre of mass, from the start of a motion to its end.

    Parameters
    ----------
    motion : (T + 1, N, D)
        Positions after each frame [m].
    weight : (N,)
        Mass of each particle over that of all [-].
    walls : Walls
        In 3D the depth between them gives the width of the stroke.

    Raises
    ------
    SketchError
        The centre of mass moves by less than two pixels in the front view.
    """
    moments = np.linspace(0, len(motion) - 1, SEGMENTS + 1).round().astype(int)
    way = np.stack([weight @ motion[moment].astype(np.float64) for moment in np.unique(moments)])
    front = np.clip(way[:, :2], 0.0, 1.0)
    return Arrow(front, None if motion.shape[2] == 2 else _widths(way[:, 2], walls))


def oval_of(x: npt.NDArray[np.float32], weight: Floats, walls: Walls) -> Ellipse:
    """Return the oval at two standard deviations around a cloud x (N, D) [m], in the front view.

    In 3D the width of its stroke tells the depth of the centre of mass. `weight` and `walls` are those of
    `arrow_of`.
    """
    cloud = x.astype(np.float64)
    mean = weight @ cloud
    away = cloud[:, :2] - mean[:2]
    values, vectors = np.linalg.eigh((weight[:, None] * away).T @ away)
    axes = np.clip(_SIGMAS * np.sqrt(np.maximum(values[::-1], 0.0)), MIN_LENGTH, 1.0)
    # An axis has no sense: of both angles take the one in (-pi / 2, pi / 2].
    major = vectors[:, 1] if vectors[0, 1] > 0 else -vectors[:, 1]
    angle = float(np.arctan2(major[1], major[0]))
    width = None if x.shape[1] == 2 else float(_widths(mean[2:], walls)[0])
    return Ellipse(np.clip(mean[:2], 0.0, 1.0), axes, angle, width)


def _widths(depths: Floats, walls: Walls) -> Floats:
    return np.array([width_of_depth(depth, walls.lower[2], walls.upper[2]) for depth in depths])
