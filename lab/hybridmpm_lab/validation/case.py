"""The parts of a validation case: judged figures, curves, and the measurements that cases share."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene

Floats = npt.NDArray[np.float64]


class Check(NamedTuple):
    """A measured figure with the values that are accepted."""

    quantity: str
    """Name of the figure, with its unit."""
    measured: float
    target: str
    """Value that the figure should have."""
    tolerance: str
    """Values that are accepted; "none" if the figure is only reported."""
    verdict: Literal["pass", "FAIL", "reported"]

    @classmethod
    def at_most(cls, quantity: str, measured: float, limit: float) -> Self:
        """Return a check of an error, which must be at most `limit` in size; NaN fails."""
        return cls(quantity, measured, "0", f"<= {limit:g}", "pass" if abs(measured) <= limit else "FAIL")

    @classmethod
    def between(
        cls, quantity: str, measured: float, band: tuple[float, float], *, control: bool = False
    ) -> Self:
        """Return a check of a figure, which must lie in a band, as a control outside it; NaN fails."""
        low, high = band
        accepted = measured < low or measured > high if control else low <= measured <= high
        where = "outside the band" if control else "inside the band"
        return cls(quantity, measured, f"{low:.3g} to {high:.3g}", where, "pass" if accepted else "FAIL")

    @classmethod
    def reported(cls, quantity: str, measured: float, target: str = "0") -> Self:
        """Return a check that reports a figure and accepts every value."""
        return cls(quantity, measured, target, "none", "reported")


@dataclass(frozen=True)
class Curve:
    """A line or a set of points of a panel."""

    x: npt.ArrayLike
    y: npt.ArrayLike
    label: str = ""
    colour: int | None = None
    """Index of the chart's colours and markers; None is black."""
    style: str = "-"
    """Line style of matplotlib; "o" stands for points with the marker of the colour."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Further options of matplotlib's `plot`."""


class Panel(NamedTuple):
    """A panel of a chart."""

    title: str
    xlabel: str
    ylabel: str
    curves: Sequence[Curve]
    options: Mapping[str, Any] = {}
    """Limits, scales and ticks, as options of matplotlib's `Axes.set`."""
    legend_columns: int = 0
    """Columns of a legend below the chart, where curves leave no room for one among them; else 0."""


class Result(NamedTuple):
    """Judged figures and curves of a run."""

    checks: Sequence[Check]
    panels: Sequence[Panel]


def recorded(
    solver: MpmSolver, steps: int, measure: Callable[[MpmSolver], tuple[float, ...]], *, every: int = 1
) -> tuple[Floats, Floats]:
    """Return times (M,) [s] and the K figures of `measure` (K, M): at the start and every few frames."""
    measured = [measure(solver)]
    for _ in range(steps):
        solver.advance(every)
        measured.append(measure(solver))
    return times(solver.scene, steps + 1, every), np.array(measured, dtype=np.float64).T


def times(scene: Scene, count: int, every: int = 1) -> Floats:
    """Return the times of `count` states (M,) [s], the first at 0."""
    return np.arange(count, dtype=np.float64) * every * scene.frame_dt


def energies(solver: MpmSolver) -> tuple[float, float]:
    """Return the kinetic energy of the particles' velocities and the total energy [J].

    The total has the kinetic energy of the affine velocities, too, and the elastic energy.
    """
    totals = solver.diagnostics()
    squares = (solver.affine.astype(np.float64) ** 2).sum(axis=(1, 2))
    affine = float((solver.mass * squares).sum()) * solver.scene.dx**2 / 8
    return totals.kinetic_energy, totals.kinetic_energy + affine + totals.elastic_energy


def cell_counts(x: npt.NDArray[np.float32], corner: tuple[float, float], scene: Scene) -> Floats:
    """Return the number of particles at `x` (N, 2) in each cell (columns, rows), with `corner` lower left."""
    cells = np.arange(scene.resolution + 1) * scene.dx
    return np.asarray(np.histogram2d(x[:, 0], x[:, 1], bins=(corner[0] + cells, corner[1] + cells))[0])


def extent(filled: npt.NDArray[np.bool_]) -> int:
    """Return the number of cells up to the last filled one, that one included; 0 where none is filled."""
    return int(np.flatnonzero(filled)[-1]) + 1 if filled.any() else 0
