"""Fewer particles and fewer frames: merging at a ratio r_p, striding at r_t, and the way back.

r_p is the number of particles kept over those there were, r_t the number of frames that one step spans.
"""

from hybridmpm.downsampling.carry import strided, upsample
from hybridmpm.downsampling.merging import FEWEST_PER_CELL, coarse_resolution, merge

__all__ = ["FEWEST_PER_CELL", "coarse_resolution", "merge", "strided", "upsample"]
