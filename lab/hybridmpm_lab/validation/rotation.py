"""An elastic disc and an elastic ball turn once a second without gravity, away from all walls.

The angular momentum includes the affine part, m dx² / 4 (C_yx - C_xy) for each particle.
"""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Elastic, Scene
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, energies, recorded

_MAX_LOSS = 1e-3  # largest relative loss of kinetic energy over the run, as in matter's energy test
_MAX_GAIN = 1e-5
"""Largest rise of the total energy at the angular momentum of the start, over the kinetic energy."""
_MAX_TURN = 1e-4  # largest relative change of the angular momentum: that of the rounding of float32
_STUFF = Elastic(density=1550.0, youngs_modulus=1e6, poisson_ratio=0.3)
_RATE = 2 * np.pi  # angular velocity [rad/s], one turn a second
_SPIN_UP = 40  # number of frames over which a body is spun up, slowly, so that it hardly oscillates
_EVERY = 20  # number of frames from one measurement to the next


def run(*, disc_seconds: float = 20.0, ball_seconds: float = 10.0) -> Result:
    """Spin a disc of radius 0.2 m and a ball of radius 0.15 m, each for its number of seconds."""
    checks: list[Check] = []
    energy: list[Curve] = []
    angular: list[Curve] = []
    bodies = ((2, "disc", 0.2, disc_seconds), (3, "ball", 0.15, ball_seconds))
    for k, (dim, label, radius, seconds) in enumerate(bodies):
        time, (kinetic, total, momentum) = _spin(dim, radius, seconds)
        # Energies are judged at the angular momentum of the start.
        spin = (momentum / momentum[0]) ** 2
        loss = 1 - kinetic[-1] / kinetic[0] / spin[-1]
        rise = (total - total[0]) / kinetic[0]
        change = momentum / momentum[0] - 1
        lost = f"energy of the {label}, kinetic lost in {time[-1]:.0f} s"
        checks += (
            Check.between(lost, loss, (0, _MAX_LOSS)),
            Check.at_most(f"energy of the {label}, total gained", (rise - (spin - 1)).max(), _MAX_GAIN),
            Check.at_most(f"angular momentum of the {label}", np.abs(change).max(), _MAX_TURN),
        )
        energy += (
            Curve(time, (kinetic / kinetic[0] - 1) * 1e3, f"{label}, kinetic", k),
            Curve(time, rise * 1e3, f"{label}, total", k, "--"),
        )
        angular.append(Curve(time, change * 1e6, label, k))
    panels = (
        Panel("Change of energy", "time [s]", "[‰ of the kinetic energy]", energy),
        Panel("Change of angular momentum", "time [s]", "[millionths]", angular),
    )
    return Result(checks, panels)


def _spin(dim: int, radius: float, seconds: float) -> tuple[Floats, Floats]:
    """Return times (M,) [s], and kinetic energy, total energy and angular momentum (3, M)."""
    ball = Ball(material=_STUFF, center=(0.5,) * dim, radius=radius)
    solver = MpmSolver(Scene(dim=dim, resolution=32, gravity=(0.0,) * dim, bodies=(ball,)))
    frame_dt = solver.scene.frame_dt
    for _ in range(_SPIN_UP):
        solver.advance(force=_across(solver) * (_RATE / (_SPIN_UP * frame_dt)))

    def measure(solver: MpmSolver) -> tuple[float, ...]:
        C = solver.affine.astype(np.float64)
        inertia = solver.mass * solver.scene.dx**2 / 4
        orbital = (solver.mass * (_across(solver) * solver.velocities).sum(axis=1)).sum()
        return *energies(solver), float(orbital + (inertia * (C[:, 1, 0] - C[:, 0, 1])).sum())

    return recorded(solver, int(seconds / frame_dt) // _EVERY, measure, every=_EVERY)


def _across(solver: MpmSolver) -> Floats:
    """Return velocities (N, D) [m/s] of a rotation by 1 rad/s around the last axis, through the centroid."""
    x = solver.positions.astype(np.float64)
    arm = x - x.mean(axis=0)
    across = np.zeros_like(arm)
    across[:, 0], across[:, 1] = -arm[:, 1], arm[:, 0]
    return np.asarray(across)
