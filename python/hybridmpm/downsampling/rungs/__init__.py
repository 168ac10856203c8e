"""Rungs: settings at which few particles simulate a scene and carry all others, and how they are chosen."""

from hybridmpm.downsampling.rungs.choice import rung_for
from hybridmpm.downsampling.rungs.rung import Rung
from hybridmpm.downsampling.rungs.table import HeldOut, RungEntry, RungTable, rung_table

__all__ = ["HeldOut", "Rung", "RungEntry", "RungTable", "rung_for", "rung_table"]
