"""A guard that lets network and MPM take turns by the log of another run."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from hybridmpm.decisions import Decision, without_undone
from hybridmpm.hybrid import Guard, GuardInput, Stage


@dataclass(eq=False)
class Scripted(Guard):
    """Alarms, without undoing a step, at those frames where MPM simulates by a log."""

    name = "scripted"
    stage = Stage.MOTION
    is_fault = False

    log: Iterable[Decision] = field(default=())

    def value(self, given: GuardInput) -> float:
        decided = [one.mode for one in without_undone(self.log) if one.frame <= given.mpm.frame]
        return float(not decided or decided[-1] == "mpm")

    def alarms(self, value: float) -> bool:
        return value > 0
