"""A network and MPM in one simulator: guards watch the network, and MPM takes over at an alarm.

- `HybridSimulator` is the simulator; `physics.Stepper` is what it asks of a network.
- `GUARDS` are the guards by name; `Guard` is their interface, for guards of your own.
- `Decision` is an entry of the log that a run can be replayed from; `Answered` counts frames.
"""

from hybridmpm.decisions import Answered, Decision
from hybridmpm.hybrid.audits import Audit, Drift
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.guards import (
    DEFAULT,
    GUARDS,
    Cosine,
    Density,
    Divergence,
    Energy,
    Impact,
    NonFinite,
    Outside,
)
from hybridmpm.hybrid.simulator import HybridSimulator

__all__ = [
    "DEFAULT",
    "GUARDS",
    "Answered",
    "Audit",
    "Cosine",
    "Decision",
    "Density",
    "Divergence",
    "Drift",
    "Energy",
    "Guard",
    "HybridSimulator",
    "Impact",
    "NonFinite",
    "Outside",
    "Stage",
    "View",
]
