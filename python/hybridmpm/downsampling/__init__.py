"""Fewer particles and frames: merging particles at a ratio r_p, striding frames at r_t, and the way back.

r_p is the number of particles after merging over the number before; r_t is the number of frames in a step.
"""

from hybridmpm.downsampling.carrier import Carrier
from hybridmpm.downsampling.carry import strided, upsample
from hybridmpm.downsampling.carrying import CarryingSimulator
from hybridmpm.downsampling.merging import FEWEST_PER_CELL, coarse_resolution, merge
from hybridmpm.downsampling.rungs import Rung, RungTable, rung_for, rung_table

__all__ = [
    "FEWEST_PER_CELL",
    "Carrier",
    "CarryingSimulator",
    "Rung",
    "RungTable",
    "coarse_resolution",
    "merge",
    "rung_for",
    "rung_table",
    "strided",
    "upsample",
]
