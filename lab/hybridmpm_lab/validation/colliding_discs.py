"""Two elastic discs that meet head-on (Sulsky, Chen and Schreyer 1994): momentum, energy, early contact.

Discs of radius 0.2 m in a unit square start at (0.2, 0.2) and (0.8, 0.8) with velocities +-(0.1, 0.1) m/s;
E = 1000 Pa, nu = 0.3, density 1000 kg/m^3, no gravity. The surfaces of the discs meet at

    t = (0.6 sqrt(2) - 0.4) / (0.2 sqrt(2)) = 1.586 s.

Bodies in one velocity field act on each other as soon as they share grid nodes, at most three cells apart.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from hybridmpm._support.charts import COLOURS, panels
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Elastic, Scene, Walls
from hybridmpm_lab.validation.case import Case, Check, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONTACT_TIME = (0.6 * np.sqrt(2) - 0.4) / (0.2 * np.sqrt(2))
"""Time at which the surfaces of the discs meet [s]."""
MAX_MOMENTUM = 1e-5
"""Largest momentum of both discs together, over that of one disc [-]."""
MAX_GAIN = 1e-3
"""Largest rise of the total energy above its start, over its start [-]."""
MAX_GAP = 3.0
"""Largest gap between the surfaces at first contact [cells], the support of a quadratic spline."""

_RADIUS = 0.2
_SECONDS = 3.2
_FELT = 1e-3
"""Relative change of a disc's momentum from which on the discs are in contact [-]."""


@dataclass(frozen=True, kw_only=True)
class Collision:
    """One collision; arrays (F,) have an entry for each frame."""

    resolution: int
    time: Floats
    """Time [s]."""
    kinetic_energy: Floats
    """Kinetic energy [J], that of the affine velocities included."""
    elastic_energy: Floats
    """Elastic energy [J]."""
    first_momentum: Floats
    """Momentum of the first disc along its path [kg m/s]."""
    momentum: Floats
    """Largest component of the momentum of both discs together [kg m/s]."""
    gap: Floats
    """Distance of the centres minus two radii [m], which is the gap while the discs are round."""

    @property
    def total_energy(self) -> Floats:
        """Sum of kinetic and elastic energy [J]."""
        return self.kinetic_energy + self.elastic_energy

    @property
    def contact(self) -> int:
        """First frame at which the momentum of the first disc has changed."""
        changed = np.abs(self.first_momentum / self.first_momentum[0] - 1) > _FELT
        return int(np.flatnonzero(changed)[0])


@dataclass(frozen=True, kw_only=True)
class CollidingDiscsResult:
    """The same collision at several resolutions."""

    collisions: tuple[Collision, ...]

    @property
    def checks(self) -> tuple[Check, ...]:
        """Conservation of momentum and energy, and the gap at first contact."""
        return tuple(check for run in self.collisions for check in _checks(run))


def _checks(run: Collision) -> tuple[Check, ...]:
    where = f"{run.resolution}^2"
    start = run.total_energy[0]
    both = float(run.momentum.max() / run.first_momentum[0])
    gain = float(run.total_energy.max() / start - 1)
    gap = float(run.gap[run.contact] * run.resolution)
    return (
        Check.at_most(f"momentum of both / of one, {where}", both, MAX_MOMENTUM),
        Check.at_most(f"total energy gained, {where}", gain, MAX_GAIN),
        Check.between(f"gap at contact [cells], {where}", gap, 0, MAX_GAP),
        Check.reported(f"contact [s], {where}", float(run.time[run.contact]), f"{CONTACT_TIME:.3f}"),
        Check.reported(f"total energy lost, {where}", float(1 - run.total_energy[-1] / start), "0"),
    )


def run(resolutions: tuple[int, ...] = (32, 64, 128)) -> CollidingDiscsResult:
    """Let the discs collide at each resolution [cells/m]."""
    return CollidingDiscsResult(collisions=tuple(_collide(resolution) for resolution in resolutions))


def _collide(resolution: int) -> Collision:
    stuff = Elastic(density=1000.0, youngs_modulus=1000.0, poisson_ratio=0.3)
    discs = tuple(
        Ball(material=stuff, center=(at, at), radius=_RADIUS, velocity=(speed, speed), seed=seed)
        for seed, (at, speed) in enumerate([(0.2, 0.1), (0.8, -0.1)])
    )
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))
    scene = Scene(dim=2, resolution=resolution, gravity=(0.0, 0.0), walls=walls, bodies=discs)
    solver = MpmSolver(scene)
    first = scene.sample().body == 0
    frames = int(_SECONDS / scene.frame_dt)
    measured = [_measure(solver, first)]
    for _ in range(frames):
        solver.advance()
        measured.append(_measure(solver, first))
    kinetic, elastic, first_momentum, momentum, gap = np.array(measured).T
    return Collision(
        resolution=resolution,
        time=np.arange(frames + 1, dtype=np.float64) * scene.frame_dt,
        kinetic_energy=kinetic,
        elastic_energy=elastic,
        first_momentum=first_momentum,
        momentum=momentum,
        gap=gap,
    )


def _measure(solver: MpmSolver, first: npt.NDArray[np.bool_]) -> tuple[float, ...]:
    """Return the present kinetic energy, elastic energy, first momentum, momentum and gap of a collision."""
    totals = solver.diagnostics()
    x = solver.positions.astype(np.float64)
    mass = solver.mass.astype(np.float64)
    affine = (mass * (solver.affine.astype(np.float64) ** 2).sum(axis=(1, 2))).sum()
    along = solver.velocities.astype(np.float64)[first].sum(axis=1) / np.sqrt(2)
    apart = np.linalg.norm(x[~first].mean(axis=0) - x[first].mean(axis=0))
    return (
        totals.kinetic_energy + float(affine) * solver.scene.dx**2 / 8,
        totals.elastic_energy,
        float((mass[first] * along).sum()),
        float(np.abs(totals.momentum).max()),
        float(apart - 2 * _RADIUS),
    )


def draw(result: CollidingDiscsResult) -> "Figure":
    """Draw energies and momentum over time, with the time of exact contact."""
    figure, ((left, right),) = panels(2)
    for k, run_ in enumerate(result.collisions):
        start = run_.total_energy[0]
        label = f"{run_.resolution}²"
        left.plot(run_.time, run_.total_energy / start, color=COLOURS[k], label=label)
        left.plot(run_.time, run_.kinetic_energy / start, ":", color=COLOURS[k])
        right.plot(run_.time, run_.first_momentum / run_.first_momentum[0], color=COLOURS[k], label=label)
    left.set(
        title="Energy: total, dotted kinetic",
        xlabel="time [s]",
        ylabel="relative to the start",
        ylim=(0, 1.05),
    )
    right.set(title="Momentum of one disc", xlabel="time [s]", ylabel="relative to the start")
    for axes in (left, right):
        axes.axvline(CONTACT_TIME, color="black", linestyle="--", linewidth=1, label="exact contact")
        axes.legend(loc="lower left")
    return figure


CASE = Case(
    name="colliding_discs",
    title="Colliding elastic discs",
    text=(
        "Two soft elastic discs fly at each other, the case of Sulsky, Chen and Schreyer (1994): radius "
        "0.2 m, E = 1000 Pa, nu = 0.3, velocities ±(0.1, 0.1) m/s, no gravity. The momentum of both "
        "together has to stay zero, the total energy must not grow. All bodies share one velocity field, "
        "so contact begins when a disc's momentum has changed by a thousandth, before the surfaces meet "
        "at 1.586 s: at most three cells early, since quadratic splines reach no farther. The energy lost "
        "in contact is the price of the transfers' damping of what the grid cannot resolve; it falls with "
        "the cell size."
    ),
    run=run,
    draw=draw,
)
