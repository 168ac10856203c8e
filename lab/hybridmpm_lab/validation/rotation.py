"""An elastic disc and an elastic ball that spin freely: kinetic energy and angular momentum stay.

Both bodies are spun up from rest by an external acceleration across the radius. Then they spin without
gravity, away from all walls. The kinetic energy is that of the particles' velocities. The angular momentum
includes the affine part, m dx^2 / 4 (C_yx - C_xy) for each particle (Jiang et al. 2015, The affine
particle-in-cell method).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridmpm._support.charts import COLOURS, panels
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Elastic, Scene
from hybridmpm_lab.validation.case import Case, Check, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_LOSS = 1e-3
"""Largest relative loss of kinetic energy over the run, as in matter's energy test
(github.com/larsblatny/matter)."""
MAX_GAIN = 1e-5
"""Largest rise of the total energy at the angular momentum of the start, over the kinetic energy."""
MAX_TURN = 1e-4
"""Largest relative change of the angular momentum: that of the rounding of float32."""

_STUFF = Elastic(density=1550.0, youngs_modulus=1e6, poisson_ratio=0.3)
_RATE = 2 * np.pi
"""Angular velocity [rad/s], one turn a second."""
_SPIN_UP = 40
"""Number of frames over which a body is spun up, slowly, so that it hardly oscillates."""
_EVERY = 20
"""Number of frames from one measurement to the next."""


@dataclass(frozen=True, kw_only=True)
class Spin:
    """One spinning body; arrays (M,) have an entry for each measurement."""

    label: str
    time: Floats
    """Time since the end of the spin-up [s]."""
    kinetic_energy: Floats
    """Kinetic energy of the particles' velocities [J]."""
    total_energy: Floats
    """Kinetic energy, that of the affine velocities included, plus elastic energy [J]."""
    angular_momentum: Floats
    """Angular momentum about the centroid, around the last axis [kg m^2/s]."""

    @property
    def spin(self) -> Floats:
        """Kinetic energy (M,), over that at the start, of the present angular momentum L: it goes as L^2."""
        return np.asarray((self.angular_momentum / self.angular_momentum[0]) ** 2)

    @property
    def loss(self) -> float:
        """Fraction of the kinetic energy that is lost at the end, at the angular momentum of the start."""
        return float(1 - self.kinetic_energy[-1] / self.kinetic_energy[0] / self.spin[-1])

    @property
    def gain(self) -> float:
        """Largest rise of the total energy over the kinetic energy, less what angular momentum adds."""
        rise = (self.total_energy - self.total_energy[0]) / self.kinetic_energy[0]
        return float((rise - (self.spin - 1)).max())

    @property
    def turn(self) -> float:
        """Largest relative change of the angular momentum."""
        return float(np.abs(self.angular_momentum / self.angular_momentum[0] - 1).max())

    @property
    def checks(self) -> tuple[Check, ...]:
        """Loss and gain of energy and change of angular momentum of this body."""
        lost = f"energy of the {self.label}, kinetic lost in {self.time[-1]:.0f} s"
        return (
            Check.between(lost, self.loss, 0, MAX_LOSS),
            Check.at_most(f"energy of the {self.label}, total gained", self.gain, MAX_GAIN),
            Check.at_most(f"angular momentum of the {self.label}", self.turn, MAX_TURN),
        )


@dataclass(frozen=True, kw_only=True)
class RotationResult:
    """A spinning disc and a spinning ball."""

    spins: tuple[Spin, ...]

    @property
    def checks(self) -> tuple[Check, ...]:
        """Loss and gain of energy and change of angular momentum of both bodies."""
        return tuple(check for spin in self.spins for check in spin.checks)


def run(*, disc_seconds: float = 20.0, ball_seconds: float = 10.0) -> RotationResult:
    """Spin a disc of radius 0.2 m and a ball of radius 0.15 m, each for its number of seconds."""
    return RotationResult(spins=(_spin(2, 0.2, disc_seconds), _spin(3, 0.15, ball_seconds)))


def _spin(dim: int, radius: float, seconds: float) -> Spin:
    ball = Ball(material=_STUFF, center=(0.5,) * dim, radius=radius)
    solver = MpmSolver(Scene(dim=dim, resolution=32, gravity=(0.0,) * dim, bodies=(ball,)))
    frame_dt = solver.scene.frame_dt
    for _ in range(_SPIN_UP):
        solver.advance(force=_across(solver) * (_RATE / (_SPIN_UP * frame_dt)))
    measured = [_measure(solver)]
    for _ in range(int(seconds / frame_dt) // _EVERY):
        solver.advance(_EVERY)
        measured.append(_measure(solver))
    kinetic, total, angular = np.array(measured).T
    return Spin(
        label="disc" if dim == 2 else "ball",
        time=np.arange(len(measured), dtype=np.float64) * _EVERY * frame_dt,
        kinetic_energy=kinetic,
        total_energy=total,
        angular_momentum=angular,
    )


def _across(solver: MpmSolver) -> Floats:
    """Return velocities (N, D) [m/s] of a rotation by 1 rad/s around the last axis, through the centroid."""
    arm = _arm(solver)
    across = np.zeros_like(arm)
    across[:, 0], across[:, 1] = -arm[:, 1], arm[:, 0]
    return across


def _arm(solver: MpmSolver) -> Floats:
    x = solver.positions.astype(np.float64)
    return np.asarray(x - x.mean(axis=0))


def _measure(solver: MpmSolver) -> tuple[float, float, float]:
    """Return the present kinetic energy [J], total energy [J] and angular momentum [kg m^2/s]."""
    mass = solver.mass.astype(np.float64)
    C = solver.affine.astype(np.float64)
    inertia = mass * solver.scene.dx**2 / 4
    totals = solver.diagnostics()
    affine_energy = float((inertia * (C**2).sum(axis=(1, 2))).sum()) / 2
    orbital = (mass * (_across(solver) * solver.velocities).sum(axis=1)).sum()
    affine = (inertia * (C[:, 1, 0] - C[:, 0, 1])).sum()
    total = totals.kinetic_energy + affine_energy + totals.elastic_energy
    return totals.kinetic_energy, total, float(orbital + affine)


def draw(result: RotationResult) -> "Figure":
    """Draw energy and angular momentum over time, relative to the start."""
    figure, ((left, right),) = panels(2)
    for k, spin in enumerate(result.spins):
        label = spin.label
        start = spin.kinetic_energy[0]
        left.plot(
            spin.time, (spin.kinetic_energy / start - 1) * 1e3, color=COLOURS[k], label=f"{label}, kinetic"
        )
        total = (spin.total_energy - spin.total_energy[0]) / start
        left.plot(spin.time, total * 1e3, "--", color=COLOURS[k], label=f"{label}, total")
        angular = spin.angular_momentum / spin.angular_momentum[0] - 1
        right.plot(spin.time, angular * 1e6, color=COLOURS[k], label=label)
    left.set(title="Change of energy", xlabel="time [s]", ylabel="[‰ of the kinetic energy]")
    right.set(title="Change of angular momentum", xlabel="time [s]", ylabel="[millionths]")
    left.legend()
    right.legend()
    return figure


CASE = Case(
    name="rotation",
    title="Rigid rotation",
    text=(
        "An elastic disc and an elastic ball (E = 1 MPa, nu = 0.3, density 1550 kg/m³, the constants of "
        "matter's energy test) turn once a second without gravity, 32 cells per metre. They are spun up "
        "by an external acceleration over 0.1 s, then left alone. The kinetic energy may lose up to a "
        "thousandth over the whole run and must not gain; the total energy may never rise, and the "
        "angular momentum stays, to the rounding of float32. Energies are judged at the angular momentum "
        "of the start, because what rounding adds to L it adds twice to the kinetic energy, which goes as "
        "L²: L of the ball creeps up by 3 millionths a second, 5 x 10^-10 a substep, a hundredth of the "
        "last place of a float32. A twin in double precision keeps L to 10^-14, and its total energy only "
        "falls, by 3 x 10^-5 in ten seconds, with 12, 24 or 48 substeps a frame alike. In single precision "
        "that held only after F was updated as F + dt C F: of (I + dt C) F, where 1 + dt C_ii keeps few "
        "digits of dt C_ii, the energy rose by 5 x 10^-5, and a twin with F alone in double precision lost "
        "energy as it should."
    ),
    run=run,
    draw=draw,
)
