"""No control: what happens by itself, to compare with."""

from hybridmpm.control.laws import Unforced
from hybridmpm.control.methods.method import Task
from hybridmpm.simulator import Simulator


class NoControl:
    """Applies no force."""

    name = "none"

    def plan(self, simulator: Simulator, task: Task) -> Unforced:  # noqa: ARG002 - whatever is asked
        """Return the law without force."""
        return Unforced()
