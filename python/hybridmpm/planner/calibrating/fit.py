"""Times of each kind of work from times of simulators, by least squares without negative results."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

_ROUNDS = 2000
_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Time of a frame of one simulator in one scene."""

    name: str
    """Name of the candidate."""
    particles: int
    """Particles that are simulated."""
    shown: int
    """Particles that are shown."""
    substeps: float
    """Median number of substeps of a frame."""
    cells: float
    """Cells that the material fills at rest."""
    obstacles: int
    """Number of obstacles."""
    show_all: bool
    """Whether more particles are shown than simulated."""
    microseconds: float
    """Median time of a frame [us]."""


FIELDS = (
    "substep", "particle_substep", "cell_substep", "obstacle_substep", "obstacle_particle_substep",
    "frame", "particle", "upsample", "upsample_coarse", "upsample_shown", "upsample_obstacle",
)  # fmt: skip
"""Kinds of work; see `planner.calibration.MaterialTimes`."""


def fitted_work(samples: Sequence[Sample]) -> dict[str, float]:
    """Return the time of each kind of work [us], with the least squares of relative errors.

    Parameters
    ----------
    samples : sequence of Sample
        Times of MPM with one material in one dimension.
    """
    rows = np.array(
        [
            [
                one.substeps,
                one.substeps * one.particles,
                one.substeps * one.cells,
                one.substeps * one.obstacles,
                one.substeps * one.particles * one.obstacles,
                1.0,
                one.particles,
                float(one.show_all),
                one.show_all * one.particles,
                one.show_all * one.shown,
                one.show_all * one.shown * one.obstacles,
            ]
            for one in samples
        ]
    )
    times = np.array([one.microseconds for one in samples])
    found = non_negative_least_squares(rows / times[:, None], np.ones(len(samples)))
    return dict(zip(FIELDS, found.tolist(), strict=True))


def fitted_line(sizes: Sequence[int], microseconds: Sequence[float]) -> tuple[float, float]:
    """Return what a frame and what each particle takes [us], of times that grow with the particles."""
    rows = np.stack([np.ones(len(sizes)), np.array(sizes, dtype=np.float64)], axis=1)
    times = np.array(microseconds)
    frame, particle = non_negative_least_squares(rows / times[:, None], np.ones(len(sizes)))
    return float(frame), float(particle)


def non_negative_least_squares(matrix: _Floats, target: _Floats) -> _Floats:
    """Return x >= 0 with the least |matrix x - target|^2, by coordinate descent (Franc et al. 2005).

    Parameters
    ----------
    matrix : (M, K)
    target : (M,)

    Returns
    -------
    (K,)
    """
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0] = 1.0
    columns = matrix / scale
    gram, slope = columns.T @ columns, -columns.T @ target
    x = np.zeros(matrix.shape[1])
    for _ in range(_ROUNDS):
        for k in range(len(x)):
            if gram[k, k] > 0:
                now = max(0.0, x[k] - slope[k] / gram[k, k])
                slope += (now - x[k]) * gram[:, k]
                x[k] = now
    return np.asarray(x / scale)
