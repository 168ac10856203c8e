"""Plans: the fastest method for a scene within an error bound, or the most accurate within a time budget.

`plan` returns a `Plan`, which makes the simulator; `estimates` returns error and time of every method.
`AutoSolver` keeps a time budget while it runs. Errors were measured once; times are those of the machine,
from `hybridmpm calibrate`.
"""

from hybridmpm.planner.auto import AutoSolver, Change
from hybridmpm.planner.planning import Estimate, Plan, estimates, plan
from hybridmpm.planner.store import CalibrationWarning

__all__ = ["AutoSolver", "CalibrationWarning", "Change", "Estimate", "Plan", "estimates", "plan"]
