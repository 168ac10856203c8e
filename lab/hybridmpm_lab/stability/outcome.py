"""Measures of a run, and the outcome that they amount to."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.splines import Stencils
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator

Outcome = Literal["survived", "refused", "degraded", "failed"]
OUTCOMES: tuple[Outcome, ...] = ("survived", "refused", "degraded", "failed")

ENERGY_GROWTH = 1.05
"""Largest energy of a run that survives, over that at the start and the work done."""
DENSITY_GROWTH = 1.1
"""Largest crowding of a run that survives, over the truth's, where all particles are simulated."""
SHOWN_DENSITY_GROWTH = 1.3
"""The same for shown particles, which follow coarse ones."""
VOLUME_CHANGE = 0.05
"""Largest difference of the volume of a run that survives to the truth's, in the last quarter."""
_PASSED = 0.001  # share of the particles that may pass a solid
_REST_ENERGY = 1e-3  # energy that is neglected [J/kg]: that of a speed of 4.5 cm/s, or a height of 0.1 mm
_QUARTERS = 4

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Look:
    """The measures of one state."""

    finite: bool
    outside: int
    """Particles more than a cell past a wall."""
    energy: float
    """Kinetic and potential energy above that of all mass at the lowest corner, of MPM also elastic [J]."""
    work: float
    """Work that forces and moving obstacles have done since the start [J]."""
    crowding: float
    """Volume of the particles at rest over the room that they take, which one in a hundred exceeds [-]."""
    volume: float
    """Volume that the matter takes, by the cells that it fills [m^D]."""


def look(simulator: Simulator, work: float) -> Look:
    """Measure the present state of a simulator, given the work done so far [J]."""
    scene, x, v = simulator.scene, simulator.positions, simulator.velocities
    if not (np.isfinite(x).all() and np.isfinite(v).all()):
        return Look(finite=False, outside=0, energy=0.0, work=work, crowding=0.0, volume=0.0)
    lower, upper = np.array(scene.walls.lower) - scene.dx, np.array(scene.walls.upper) + scene.dx
    crowding, volume = _room(scene, np.clip(x, 0, 1))
    return Look(
        finite=True,
        outside=int(((x < lower) | (x > upper)).any(axis=1).sum()),
        energy=_energy(simulator, x, v),
        work=work,
        crowding=crowding,
        volume=volume,
    )


def _energy(simulator: Simulator, x: _Floats, v: _Floats) -> float:
    scene, mass = simulator.scene, simulator.mass.astype(np.float64)
    gravity = np.array(scene.gravity)
    lowest = np.maximum(gravity * scene.walls.lower, gravity * scene.walls.upper).sum()
    by_mass = 0.5 * (v.astype(np.float64) ** 2).sum(axis=1) + lowest - x.astype(np.float64) @ gravity
    elastic = simulator.diagnostics().elastic_energy if simulator.r_p == 1 else 0.0
    return float(mass @ by_mass) + elastic


def _room(scene: Scene, x: _Floats) -> tuple[float, float]:
    """Return crowding and volume; all particles of a scene have the same volume at rest.

    A cell counts as a whole from three quarters full on, and not at all below one quarter. With a jump at one
    half, a plane surface would gain or lose a layer of cells at once, and without a slope no void would show.
    """
    stencils = Stencils.at(x.astype(np.float64), scene.resolution)
    share = (scene.spacing / scene.dx) ** scene.dim
    filled = stencils.scatter(np.full(len(x), share))
    cells = float(np.clip(2 * filled - 0.5, 0, 1).sum())
    return float(np.percentile(stencils.gather(filled), 99)), cells * scene.dx**scene.dim


@dataclass(frozen=True)
class Run:
    """One method on one trial, up to its end."""

    looks: tuple[Look, ...]
    mass: float
    """Mass of all particles [kg]."""
    passed: float = 0.0
    """Largest share of the particles that can be reached only through a solid."""
    same: bool = True
    """Whether a run from a snapshot gave the same bits."""

    def crowding(self) -> npt.NDArray[np.float64]:
        """Return the mean crowding of each quarter of the run."""
        parts = np.array_split(np.array([one.crowding for one in self.looks[1:]]), _QUARTERS)
        return np.array([part.mean() for part in parts])

    def volume(self) -> float:
        """Return the mean volume in the last quarter of the run [m^D]."""
        last = len(self.looks) - (len(self.looks) - 1) // _QUARTERS
        return float(np.mean([one.volume for one in self.looks[last:]]))


def judged(
    run: Run, truth: Run | None, others: Sequence[Run | None] = (), *, all_simulated: bool
) -> tuple[Outcome, list[str]]:
    """Return the outcome of a complete run, and the measures that speak against survival.

    `others` are the truth with other jitter. Where their volumes differ by more than is allowed, the motion
    is chaotic, and a run may differ by as much. Without a truth the state at the start takes its place.
    """
    finite = all(one.finite for one in run.looks)
    if not finite or any(one.outside for one in run.looks):
        return "failed", ["outside" if finite else "not finite"]
    faults = []
    start = run.looks[0]
    allowed = [ENERGY_GROWTH * (start.energy + one.work) + _REST_ENERGY * run.mass for one in run.looks]
    if any(one.energy > most for one, most in zip(run.looks, allowed, strict=True)):
        faults.append("energy")
    crowding = truth.crowding() if truth else np.full(_QUARTERS, start.crowding)
    growth = DENSITY_GROWTH if all_simulated else SHOWN_DENSITY_GROWTH
    if (run.crowding() > growth * crowding).any():
        faults.append("density")
    volume = truth.volume() if truth else start.volume
    spread = max((abs(one.volume() - volume) for one in others if truth and one), default=0.0)
    if abs(run.volume() - volume) > max(VOLUME_CHANGE * volume, spread):
        faults.append("volume")
    if run.passed > _PASSED:
        faults.append("passed a solid")
    if not run.same:
        faults.append("another state than the uninterrupted run")
    return ("degraded" if faults else "survived"), faults
