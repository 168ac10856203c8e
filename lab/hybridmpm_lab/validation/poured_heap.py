"""Sand is poured slowly onto a rough floor, in plane strain, and comes to rest as a wedge."""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import RectangularEmitter, Sand, Scene, Walls
from hybridmpm_lab.validation.case import Check, Curve, Panel, Result
from hybridmpm_lab.validation.column_collapse import angle_for_sand, plane_strain_angle

REPOSE = (16.0, 24.0, 32.0)
"""Angles of repose [degrees]."""
_TOLERANCE = 0.15  # accepted relative error of the angle [-]
_AREA = 0.05  # of the sand that is poured [m^2]
_WIDTH, _SPEED = 0.03, 0.05  # of the opening [m], [m/s]
_FLOOR, _MIDDLE = 0.1, 0.5  # positions of floor and opening [m]
_ABOVE = 1.15  # height of the opening over that of the highest heap [-]: sand falls some centimetres onto it
_REST = 1.5  # time after the last grain [s]
_FIRST_SEED = 10  # the correction of volumes was chosen with smaller ones


def run(resolutions: tuple[int, ...] = (64, 128, 192), *, seeds: int = 4) -> Result:
    """Pour heaps for each angle of repose at each resolution [cells/m], as many as `seeds`."""
    checks, curves = [], [Curve(REPOSE, REPOSE, "arctan(sin(phi))", style="--")]
    for k, resolution in enumerate(resolutions):
        slopes = []
        for repose in REPOSE:
            found = [_slope(repose, resolution, _FIRST_SEED + seed) for seed in range(seeds)]
            slopes.append(float(np.mean(found)))
            band = (1 - _TOLERANCE) * repose, (1 + _TOLERANCE) * repose
            name = f"sand that slides at {repose:g} degrees, {resolution}^2"
            checks.append(Check.between(f"{name}: slope [degrees]", slopes[-1], band))
            part = slopes[-1] / plane_strain_angle(repose)
            checks.append(Check.reported(f"{name}: slope over phi", part, "1"))
        curves.append(Curve(REPOSE, slopes, f"{resolution}^2", k, "o"))
    across = "steady sliding [degrees]"
    return Result(checks, [Panel("Poured heaps", across, "slope of the heap [degrees]", curves)])


def _slope(repose: float, resolution: int, seed: int) -> float:
    """Return the slope [degrees] of the wedge with the area and the height of the centre of a heap."""
    plane = plane_strain_angle(repose)
    # A heap of this slope.
    opening = _FLOOR + _ABOVE * float(np.sqrt(_AREA * np.tan(np.radians(plane))))
    emitter = RectangularEmitter(
        material=Sand(friction_angle=angle_for_sand(plane)),
        lower=(_MIDDLE - _WIDTH / 2, opening),
        upper=(_MIDDLE + _WIDTH / 2, opening),
        velocity=(0.0, -_SPEED),
        stop=_AREA / _WIDTH / _SPEED,
        seed=seed,
    )
    walls = Walls(lower=(0.02, _FLOOR), upper=(0.98, 0.9), contact="sticky")
    scene = Scene(dim=2, resolution=resolution, walls=walls, bodies=(), emitters=(emitter,))
    solver = MpmSolver(scene)
    solver.advance(int((_AREA / _WIDTH / _SPEED + _REST) / scene.frame_dt))
    height = float(solver.positions[:, 1].mean(dtype=np.float64)) - _FLOOR
    # A wedge of slope s has its centre at a third of its height h, and the area h^2 / s.
    area = solver.diagnostics().emitted_mass / emitter.material.density
    return float(np.degrees(np.arctan(9 * height**2 / area)))
