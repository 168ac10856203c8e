"""Coarse mode: merge the particles of a scene into coarse ones, simulate those, and show all of them.

r_p is the number of coarse particles over that of the scene.
"""

from hybridmpm.coarse.level import (
    FULL,
    CoarseLevel,
    coarse_level,
    fastest_impact,
    filled_share,
    settled_potential,
)
from hybridmpm.coarse.merging import FEWEST_PER_CELL, balanced_clusters, coarse_resolution, merge
from hybridmpm.coarse.simulator import CoarseSimulator
from hybridmpm.coarse.suitability import coarse_warnings
from hybridmpm.coarse.table import CoarseTable, FittedLevel, HeldOut, coarse_table
from hybridmpm.coarse.upsampler import CoarseParticles, Upsampler

__all__ = [
    "FEWEST_PER_CELL",
    "FULL",
    "CoarseLevel",
    "CoarseParticles",
    "CoarseSimulator",
    "CoarseTable",
    "FittedLevel",
    "HeldOut",
    "Upsampler",
    "balanced_clusters",
    "coarse_level",
    "coarse_resolution",
    "coarse_table",
    "coarse_warnings",
    "fastest_impact",
    "filled_share",
    "merge",
    "settled_potential",
]
