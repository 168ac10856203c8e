"""Coarse simulation: merge the particles of a scene into fewer, simulate those, and show all of them.

r_p is the number of particles after merging over the number before.
"""

from hybridmpm.coarse.choice import coarse_level
from hybridmpm.coarse.level import CoarseLevel
from hybridmpm.coarse.merging import FEWEST_PER_CELL, coarse_resolution, merge
from hybridmpm.coarse.simulator import CoarseSimulator
from hybridmpm.coarse.table import CoarseTable, FittedLevel, HeldOut, coarse_table
from hybridmpm.coarse.upsampler import Upsampler

__all__ = [
    "FEWEST_PER_CELL",
    "CoarseLevel",
    "CoarseSimulator",
    "CoarseTable",
    "FittedLevel",
    "HeldOut",
    "Upsampler",
    "coarse_level",
    "coarse_resolution",
    "coarse_table",
    "merge",
]
