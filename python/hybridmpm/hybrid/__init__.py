"""A network and MPM in one simulator: the network goes ahead, guards watch it, MPM is what it falls back to.

- `HybridSimulator` is the simulator; `Stepper` is what it asks of a network, `FreeFall` the simplest one.
- `GUARDS` are the guards by name; `Guard` is their interface, for guards of your own.
- `Decision` is an entry of the log that a run can be replayed from.
"""

from hybridmpm.hybrid.free_fall import FreeFall
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.guards import (
    DEFAULT,
    GUARDS,
    Audit,
    Cosine,
    Density,
    Divergence,
    Energy,
    Impact,
    NonFinite,
    Outside,
)
from hybridmpm.hybrid.log import Decision
from hybridmpm.hybrid.simulator import HybridSimulator
from hybridmpm.physics.stepper import Stepper

__all__ = [
    "DEFAULT",
    "GUARDS",
    "Audit",
    "Cosine",
    "Decision",
    "Density",
    "Divergence",
    "Energy",
    "FreeFall",
    "Guard",
    "HybridSimulator",
    "Impact",
    "NonFinite",
    "Outside",
    "Stage",
    "Stepper",
    "View",
]
