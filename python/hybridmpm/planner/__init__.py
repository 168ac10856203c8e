"""Plans: which coarse level of all ladders simulates a scene within an error, or within a time.

`plan(scene, max_error=...)` answers the cheapest, `plan(scene, budget_ms=...)` the most accurate; the `Plan`
makes the simulator. Errors were measured once for all, times are those of the machine: `hybridmpm bench
calibrate` takes them.
"""

from hybridmpm.planner.auto import AutoSolver, Change
from hybridmpm.planner.planning import Plan, Prospect, plan, prospective
from hybridmpm.planner.store import CalibrationWarning

__all__ = [
    "AutoSolver",
    "CalibrationWarning",
    "Change",
    "Plan",
    "Prospect",
    "plan",
    "prospective",
]
