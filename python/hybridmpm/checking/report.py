"""`SceneCheck`: the result of a check, and `Finding`, one entry of it."""

import html
from dataclasses import dataclass
from typing import Any, Literal

Severity = Literal["error", "warning", "note"]
"""error: it does not run, or not stably. warning: it runs, and the result is not what one may expect. note:
it costs more than it has to."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What a check has found in one field of a scene."""

    severity: Severity
    field: str
    """Path of the part of the scene, such as "bodies[1]"; "" for the whole."""
    problem: str
    """The fault, with its figures."""
    advice: str
    """The remedy; "" where the problem contains it."""

    def __str__(self) -> str:
        where = f"{self.field}: " if self.field else ""
        return f"{self.severity}: {where}{'; '.join(filter(None, (self.problem, self.advice)))}"


@dataclass(frozen=True, kw_only=True)
class SceneCheck:
    """Stability, cost and likely faults of a scene before its first frame."""

    scene: str
    """Title of the scene."""
    particles: int
    """Number of particles that are shown at frame 0."""
    stable: bool | None
    """Whether the step of MPM is below the stability limit; None where a network moves the particles, for
    which no bound is known."""
    bound: str | None
    """Bound that limits the shortest substep: "sound", "speed", "obstacle", "frame", "reference" or "fixed",
    as in `FrameReport.bound`; None where no frame could be simulated, or a network made it."""
    substeps: int | None
    """Substeps of the first frames; None as with `bound`."""
    milliseconds: float | None
    """Time of a frame [ms], measured on this machine in the first frames; where emitters bring particles,
    estimated for the middle of the run. Within a factor of 2 of the median of a run with MPM
    (docs/guide/check.md). None where no frame could be tried."""
    memory: int
    """Memory that the simulation takes, estimated [bytes]."""
    findings: tuple[Finding, ...]
    """Likely faults and high costs, the most severe first."""

    @property
    def ok(self) -> bool:
        """Whether there is no error among the findings."""
        return not any(one.severity == "error" for one in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """Return the check as plain data for JSON."""
        plain = {name: value for name, value in vars(self).items() if name != "findings"}
        return plain | {"ok": self.ok, "findings": [dict(vars(one)) for one in self.findings]}

    def __str__(self) -> str:
        return "\n".join([*self._lines(), *(f"  {one}" for one in self.findings)])

    def _lines(self) -> list[str]:
        stable = {True: "stable", False: "unstable", None: "no bound of stability is known"}[self.stable]
        parts = [f"{self.particles} particles", stable]
        if self.substeps is not None:
            parts.append(
                f"{self.substeps} substep{'s' * (self.substeps != 1)} a frame, chosen by: {self.bound}"
            )
        if self.milliseconds is not None:
            parts.append(f"about {self.milliseconds:.3g} ms a frame")
        parts.append(f"{self.memory / 2**20:.0f} MiB")
        count = len(self.findings)
        found = "no findings" if count == 0 else f"{count} finding{'s' * (count > 1)}"
        return [f"{self.scene}: {'; '.join(parts)}; {found}"]

    __repr__ = __str__

    def _repr_html_(self) -> str:
        items = "".join(f"<li>{html.escape(str(one))}</li>" for one in self.findings)
        return f"<p>{html.escape(self._lines()[0])}</p><ul>{items}</ul>"
