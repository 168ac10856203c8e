"""Two soft elastic discs fly at each other, the case of Sulsky, Chen and Schreyer (1994).

Contact counts from a change of a disc's momentum by a thousandth.
"""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Elastic, Scene, Walls
from hybridmpm.scene.scene import ADVISED_LOSS
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, energies, recorded

CONTACT_TIME = (0.6 * np.sqrt(2) - 0.4) / (0.2 * np.sqrt(2))
"""Time at which the surfaces of the discs meet [s]."""
_MAX_MOMENTUM = 1e-5  # largest momentum of both discs together, over that of one disc [-]
_MAX_GAIN = 1e-3  # largest rise of the total energy above its start, over its start [-]
_MAX_GAP = 0.5
"""Largest distance of the surfaces at first contact, apart or overlapping [cells]."""
SUBSTEPS = (12, 40, 160)
"""Substeps of a frame."""
FRAME_SPEEDS = (0.0, 0.1, 0.3, 1.0)
"""Speeds of the frames of reference [m/s]."""
_RADIUS = 0.2
_SECONDS = 3.2
_CONTACT = 1e-3  # relative change of a disc's momentum from which on the discs are in contact [-]


def run(resolutions: tuple[int, ...] = (32, 64, 128)) -> Result:
    """Let the discs collide at each resolution [cells/m]."""
    checks: list[Check] = []
    energy: list[Curve] = []
    momentum: list[Curve] = []
    for k, resolution in enumerate(resolutions):
        size = f"{resolution}^2"
        time, (kinetic, total, of_first, of_both, gap) = _collide(resolution)
        contact = int(np.flatnonzero(np.abs(of_first / of_first[0] - 1) > _CONTACT)[0])
        checks += (
            Check.at_most(f"momentum of both / of one, {size}", of_both.max() / of_first[0], _MAX_MOMENTUM),
            Check.at_most(f"total energy gained, {size}", total.max() / total[0] - 1, _MAX_GAIN),
            Check.between(
                f"gap at contact [cells], {size}", gap[contact] * resolution, (-_MAX_GAP, _MAX_GAP)
            ),
            Check.reported(f"contact [s], {size}", time[contact], f"{CONTACT_TIME:.3f}"),
            Check.reported(f"total energy lost, {size}", 1 - total[-1] / total[0]),
        )
        energy += (
            Curve(time, total / total[0], f"{size}, total", k),
            Curve(time, kinetic / total[0], f"{size}, kinetic", k, ":"),
        )
        momentum.append(Curve(time, of_first / of_first[0], size, k))
    for speed in FRAME_SPEEDS:
        name = f"parting / closing speed, frame at {speed:g} m/s, 64^2"
        checks.append(Check.between(name, parting(speed), (0.85, 1.0)))
    speeds = [parting(0.0, substeps=count, loss=ADVISED_LOSS) for count in SUBSTEPS]
    name = f"parting / closing speed, loss {ADVISED_LOSS:g}/s, {SUBSTEPS[0]} to {SUBSTEPS[-1]} substeps, 64^2"
    checks += (
        Check.between(f"{name}: least", min(speeds), (0.85, 1.0)),
        Check.at_most(f"{name}: spread", max(speeds) - min(speeds), 0.05),
        Check.reported(
            f"parting / closing speed, APIC, {SUBSTEPS[-1]} substeps, 64^2",
            parting(0.0, substeps=SUBSTEPS[-1]),
        ),
    )
    exact = [CONTACT_TIME] * 2
    energy.append(Curve(exact, [0, 1], "exact contact", style="--"))
    momentum.append(Curve(exact, [-1, 1], "exact contact", style="--"))
    label = "relative to the start"
    panels = (
        Panel("Energy", "time [s]", label, energy, {"ylim": (0, 1.05)}),
        Panel("Momentum of one disc", "time [s]", label, momentum),
    )
    return Result(checks, panels)


def _collide(resolution: int) -> tuple[Floats, Floats]:
    """Return times (F,) [s] and the figures of a collision (5, F).

    Kinetic energy with that of the affine velocities, and total energy [J]; momentum of the first disc along
    its path, and largest component of that of both [kg m/s]; distance of the centres less two radii [m].
    """
    stuff = Elastic(density=1000.0, youngs_modulus=1000.0, poisson_ratio=0.3)
    discs = tuple(
        Ball(material=stuff, center=(at, at), radius=_RADIUS, velocity=(speed, speed), seed=seed)
        for seed, (at, speed) in enumerate([(0.2, 0.1), (0.8, -0.1)])
    )
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))
    scene = Scene(dim=2, resolution=resolution, gravity=(0.0, 0.0), walls=walls, bodies=discs)
    first = scene.sample().body == 0

    def measure(solver: MpmSolver) -> tuple[float, ...]:
        totals, (_, total) = solver.diagnostics(), energies(solver)
        x = solver.positions.astype(np.float64)
        along = solver.velocities.astype(np.float64)[first].sum(axis=1) / np.sqrt(2)
        return (
            total - totals.elastic_energy,
            total,
            float((solver.mass[first] * along).sum()),
            float(np.abs(totals.momentum).max()),
            float(np.linalg.norm(x[~first].mean(axis=0) - x[first].mean(axis=0)) - 2 * _RADIUS),
        )

    return recorded(MpmSolver(scene), int(_SECONDS / scene.frame_dt), measure)


def parting(
    frame_speed: float, resolution: int = 64, *, substeps: int | None = None, loss: float | None = None
) -> float:
    """Return parting over closing speed of two discs, seen from a frame that moves along their path [m/s]."""
    start = 0.5 - 0.125 * frame_speed
    discs = tuple(
        Ball(material=Elastic(), center=(start + at, 0.5), radius=0.08, velocity=(frame_speed - 5 * at, 0.0))
        for at in (-0.1, 0.1)
    )
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))
    scene = Scene(
        dim=2, resolution=resolution, gravity=(0.0, 0.0), walls=walls, bodies=discs, transfer_loss=loss
    )
    first = scene.sample().body == 0
    solver = MpmSolver(scene) if substeps is None else MpmSolver(scene, substeps=substeps)
    solver.advance(100)
    along = solver.velocities[:, 0].astype(np.float64)
    return float(along[~first].mean() - along[first].mean())
