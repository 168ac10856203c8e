"""A column of water, `a` wide and `2 a` high, collapses at a wall of a frictionless box.

With n² = 2, the front and the height at the wall over time are

    Z = x_front / a,   T = n t sqrt(g / a),   H = h_wall / (n² a),   tau = t sqrt(g / a).
"""

from typing import NamedTuple

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene, Water, World
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, cell_counts, extent, times

# J. C. Martin and W. J. Moyce, "An experimental study of the collapse of liquid columns on a rigid
# horizontal plane", Phil. Trans. R. Soc. A 244 (1952) 312-324, n^2 = 2, a = 2.25 in. The front is from
# table 2, the height from table 6, both as in the plot script of Ocellaris' dam break
# (bitbucket.org/trlandet/ocellaris).
FRONT = np.array([
    (0.41, 1.11), (0.84, 1.22), (1.19, 1.44), (1.43, 1.67), (1.63, 1.89), (1.83, 2.11), (1.98, 2.33),
    (2.20, 2.56), (2.32, 2.78), (2.51, 3.00), (2.65, 3.22), (2.83, 3.44), (2.98, 3.67), (3.11, 3.89),
    (3.33, 4.11),
])  # fmt: skip
"""Times T and positions Z of the front in the experiment, table 2."""
HEIGHT = np.array([
    (0.56, 0.94), (0.77, 0.89), (0.93, 0.83), (1.08, 0.78), (1.28, 0.72), (1.46, 0.67), (1.66, 0.61),
    (1.84, 0.56), (2.00, 0.50), (2.21, 0.44), (2.45, 0.39), (2.70, 0.33), (3.06, 0.28), (3.44, 0.22),
    (4.20, 0.17), (5.25, 0.11), (7.40, 0.06),
])  # fmt: skip
"""Times tau and heights H at the wall in the experiment, table 6."""
FRONT_FIGURE = np.array([
    (0.832, 1.217), (1.219, 1.474), (1.997, 2.292), (2.547, 2.995), (3.345, 4.134), (4.034, 4.944),
    (4.418, 5.881), (5.091, 6.980), (5.685, 7.945), (6.306, 8.966), (6.822, 9.986), (7.439, 10.963),
    (8.031, 11.977), (8.633, 13.005), (9.237, 13.970),
])  # fmt: skip
"""Times T and positions Z of the front, read off figure 3 by pysph (examples/db_exp_data.py, mm_data_2)."""
FRONT_COMPUTED = np.array([
    (0.778, 1.351), (0.958, 1.512), (1.095, 1.637), (1.226, 1.771), (1.381, 1.931), (1.536, 2.100),
    (1.684, 2.268), (1.858, 2.480), (2.043, 2.707), (2.278, 3.004), (2.451, 3.251), (2.604, 3.481),
    (2.752, 3.700), (2.943, 3.997),
])  # fmt: skip
"""Times T and positions Z of the front of water without viscosity that Koshizuka and Oka computed.

Moving particles (Nuclear Science and Engineering 123 (1996) 421-434), read off by pysph
(examples/db_exp_data.py, ko_mps_data).
"""
FRONT_KOSHIZUKA_OKA = np.array([
    (0.381, 1.111), (0.769, 1.252), (1.153, 1.505), (1.537, 1.892), (1.935, 2.241), (2.323, 2.615),
    (2.719, 3.003), (3.096, 3.624),
])  # fmt: skip
"""The same of their own experiment (ko_data)."""

_LAST_TAU = 2.45
"""Last time tau at which the height is judged; the front is compared up to the last T of `FRONT`."""
_MAX_FRONT_ERROR = 0.03
_MAX_HEIGHT_ERROR = 0.05
_WIDTH = 0.05715  # width a of the column [m], that of the experiment: 2.25 in
_TANK = (0.4, 0.2)
"""Size of the tank [m]; the front has room until Z = 7."""
_FRAME_DT = 0.00125  # [s]
_G = 9.81
_N = np.sqrt(2.0)


class _Collapse(NamedTuple):
    """One simulated collapse; arrays (F,) have an entry for each frame."""

    size: str
    tau: Floats
    height: Floats
    front: Floats
    """Position Z where the water is half a cell deep."""
    deep_front: Floats
    """Position Z up to which the water is 0.2 a deep, a tenth of the column's height."""

    @property
    def T(self) -> Floats:
        return np.asarray(_N * self.tau)

    def error(self, table: Floats, *, shift: float = 0.0, deep: bool = False) -> float:
        """Return the root mean square of the relative difference of Z to a table, whose T are shifted."""
        T, Z = table.T
        found = np.interp(T + shift, self.T, self.deep_front if deep else self.front)
        return float(np.sqrt(np.mean((found / Z - 1.0) ** 2)))

    @property
    def height_error(self) -> float:
        tau, H = HEIGHT[HEIGHT[:, 0] <= _LAST_TAU].T
        return float(np.abs(np.interp(tau, self.tau, self.height) - H).max())


def run(resolutions: tuple[int, ...] = (210, 420, 840)) -> Result:
    """Run the collapse at each resolution [cells/m], at which the column is 12, 24 and 48 cells wide."""
    runs = [_collapse(resolution) for resolution in resolutions]
    return Result(_checks(runs), _panels(runs))


def _collapse(resolution: int) -> _Collapse:
    column = Box(material=Water(), lower=(0.0, 0.0), upper=(_WIDTH, 2 * _WIDTH))
    world = World(size=_TANK)
    scene = Scene(dim=2, world=world, resolution=resolution, frame_dt=_FRAME_DT, bodies=(column,))
    unit = np.sqrt(_WIDTH / _G)
    states = MpmSolver(scene).rollout(int(np.ceil(1.05 * _LAST_TAU * unit / scene.frame_dt)))
    filled = [cell_counts(x, (0.0, 0.0), scene) for x in states]
    half_cell = scene.particles_per_cell / 2
    deep = 0.2 * _WIDTH / scene.dx * scene.particles_per_cell
    return _Collapse(
        size=f"a = {_WIDTH * resolution:.0f} cells",
        tau=times(scene, len(states)) / unit,
        height=np.array([extent(n[0] >= half_cell) for n in filled]) * scene.dx / (2 * _WIDTH),
        front=np.array([extent(n.sum(axis=1) >= half_cell) for n in filled]) * scene.dx / _WIDTH,
        deep_front=np.array([extent(n.sum(axis=1) >= deep) for n in filled]) * scene.dx / _WIDTH,
    )


def _checks(runs: list[_Collapse]) -> tuple[Check, ...]:
    judged = []
    for one in runs:
        judged.append(Check.at_most(f"front, {one.size}", one.error(FRONT_COMPUTED), _MAX_FRONT_ERROR))
        judged.append(Check.at_most(f"height, {one.size}", one.height_error, _MAX_HEIGHT_ERROR))
    measured = FRONT[1:]  # before, the experiment's gate opens
    plain = [Check.reported(f"front of the experiment, {one.size}", one.error(measured)) for one in runs]
    finest = runs[-1]
    late = (FRONT[3, 0] <= finest.T) & (FRONT[-1, 0] >= finest.T)
    speed = float(np.polyfit(finest.T[late], finest.front[late], 1)[0])
    target = float(np.polyfit(FRONT[3:, 0], FRONT[3:, 1], 1)[0])
    shift = float(min(np.linspace(-0.5, 0.5, 101), key=lambda shift: finest.error(measured, shift=shift)))
    shifted, deep = finest.error(measured, shift=shift), finest.error(measured, deep=True)
    return (
        *judged,
        *plain,
        Check.reported(f"dZ/dT, {finest.size}", speed, f"{target:.3f}"),
        Check.reported(f"best shift of T, {finest.size}", shift),
        Check.reported(f"front of the experiment with that shift, {finest.size}", shifted),
        Check.reported(f"front of the experiment, of a layer 0.2 a deep, {finest.size}", deep),
    )


def _panels(runs: list[_Collapse]) -> tuple[Panel, Panel]:
    finest, last = runs[-1], len(runs) - 1
    table_6 = HEIGHT[HEIGHT[:, 0] < finest.tau[-1]]
    points: tuple[tuple[str, Floats, dict[str, str]], ...] = (
        ("computed (Koshizuka, Oka)", FRONT_COMPUTED, {"marker": "x"}),
        ("table 2", FRONT, {}),
        ("Koshizuka, Oka", FRONT_KOSHIZUKA_OKA, {"marker": "^", "fillstyle": "none"}),
        ("figure 3", FRONT_FIGURE[FRONT_FIGURE[:, 0] < finest.T[-1]], {"marker": "s", "fillstyle": "none"}),
    )
    fronts = (
        *(Curve(one.T, one.front, one.size, k) for k, one in enumerate(runs)),
        Curve(finest.T, finest.deep_front, "0.2 a deep", last, "--"),
        *(Curve(x[:, 0], x[:, 1], label, style="o", options=look) for label, x, look in points),
    )
    heights = (
        *(Curve(one.tau, one.height, one.size, k) for k, one in enumerate(runs)),
        Curve(table_6[:, 0], table_6[:, 1], "table 6", style="o"),
    )
    return (
        Panel("Front", "T = t √(2g/a)", "Z = x / a", fronts, {"xlim": (0, 3.45), "ylim": (0.9, 5.0)}),
        Panel("Height at the wall", "τ = t √(g/a)", "H = h / 2a", heights, {"ylim": (0, 1.05)}),
    )
