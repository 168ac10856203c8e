"""Pairs of near points by SciPy's k-d tree."""

import numpy as np
import numpy.typing as npt
import scipy
from scipy.spatial import cKDTree

NAME = f"scipy {scipy.__version__}"


def pairs(x: npt.NDArray[np.float32], radius: float) -> npt.NDArray[np.intp]:
    """Build a tree of points (N, D) [m] and return each pair at most `radius` [m] apart once, (E / 2, 2)."""
    found: npt.NDArray[np.intp] = cKDTree(x).query_pairs(radius, output_type="ndarray")
    return found
