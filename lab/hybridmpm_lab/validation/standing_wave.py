"""Period of a standing wave of small amplitude in a box, compared with linear theory.

The lowest sideways mode of water of depth h between frictionless walls a distance L apart has k = pi / L and

    omega^2 = g k tanh(k h)    (Lamb, Hydrodynamics, article 228).

The water starts at rest, with the surface a cosine. The centroid then swings horizontally about the middle of
the box, and crosses it twice in a period.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridmpm._support.charts import COLOURS, panels
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Polygon, Scene, Walls, Water
from hybridmpm_lab.validation.case import Case, Check, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_ERROR = 0.05
"""Largest relative error of the period [-]."""

_LOW = 0.125
"""Position of the lower walls [m]."""
_LENGTH = 0.75
"""Distance L between the walls [m]."""
_AMPLITUDE = 0.02
"""Amplitude of the surface at the start [m]."""
_G = 9.81
_WAVE_NUMBER = np.pi / _LENGTH


@dataclass(frozen=True, kw_only=True)
class Wave:
    """One wave; arrays (F,) have an entry for each frame."""

    depth: float
    """Depth h of the water [m]."""
    time: Floats
    """Time [s]."""
    centroid: Floats
    """Horizontal distance of the centroid from the middle of the box [m]."""

    @property
    def exact_period(self) -> float:
        """Period by linear theory [s]."""
        return exact_period(self.depth)

    @property
    def period(self) -> float:
        """Period [s], twice the mean time between crossings of the middle, by a line through their times."""
        x, t = self.centroid, self.time
        before = np.flatnonzero(np.sign(x[:-1]) != np.sign(x[1:]))
        crossings = t[before] + (t[1] - t[0]) * x[before] / (x[before] - x[before + 1])
        return float(2 * np.polyfit(np.arange(len(crossings), dtype=np.float64), crossings, 1)[0])


@dataclass(frozen=True, kw_only=True)
class StandingWaveResult:
    """Waves on water of several depths."""

    waves: tuple[Wave, ...]

    @property
    def checks(self) -> tuple[Check, ...]:
        """Relative errors of the periods."""
        return tuple(
            Check.at_most(
                f"period, {wave.depth:g} m deep, relative error",
                wave.period / wave.exact_period - 1,
                MAX_ERROR,
            )
            for wave in self.waves
        )


def exact_period(depth: float) -> float:
    """Return the period 2 pi / omega [s] of the lowest mode on water of a depth [m]."""
    return float(2 * np.pi / np.sqrt(_G * _WAVE_NUMBER * np.tanh(_WAVE_NUMBER * depth)))


def run(
    depths: tuple[float, ...] = (0.2, 0.4), *, resolution: int = 64, periods: float = 3.0
) -> StandingWaveResult:
    """Simulate waves on water of these depths [m] for a number of periods."""
    return StandingWaveResult(waves=tuple(_wave(depth, resolution, periods) for depth in depths))


def _wave(depth: float, resolution: int, periods: float) -> Wave:
    along = np.linspace(_LOW, _LOW + _LENGTH, 200)
    surface = _LOW + depth + _AMPLITUDE * np.cos(_WAVE_NUMBER * (along - _LOW))
    outline = [(_LOW + _LENGTH, _LOW), *zip(along[::-1], surface[::-1], strict=True), (_LOW, _LOW)]
    vertices = tuple((float(x), float(y)) for x, y in outline)
    walls = Walls(lower=(_LOW, _LOW), upper=(_LOW + _LENGTH, 1 - _LOW))
    water = Polygon(material=Water(), vertices=vertices)
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(water,)))
    frame_dt = solver.scene.frame_dt
    x = solver.rollout(int(np.ceil(periods * exact_period(depth) / frame_dt)))[:, :, 0]
    return Wave(
        depth=depth,
        time=np.arange(len(x), dtype=np.float64) * frame_dt,
        centroid=x.mean(axis=1, dtype=np.float64) - (_LOW + _LENGTH / 2),
    )


def draw(result: StandingWaveResult) -> "Figure":
    """Draw the centroid over time, with the undamped wave of linear theory."""
    figure, (row,) = panels(len(result.waves))
    for axes, wave in zip(row, result.waves, strict=True):
        axes.plot(wave.time, wave.centroid * 1e3, color=COLOURS[0], label="centroid")
        exact = wave.centroid[0] * np.cos(2 * np.pi * wave.time / wave.exact_period)
        axes.plot(wave.time, exact * 1e3, "--", color="black", linewidth=1, label="linear theory")
        axes.set(title=f"{wave.depth:g} m deep", xlabel="time [s]", ylabel="centroid [mm]")
    figure.legend(*row[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


CASE = Case(
    name="standing_wave",
    title="Standing wave",
    text=(
        "Water between frictionless walls 0.75 m apart starts at rest with a surface that is a cosine of "
        "2 cm. Linear theory gives omega² = g k tanh(k h) with k = pi / L. The horizontal centroid "
        "follows the lowest mode; the period is twice the mean time between its crossings of the middle, "
        "over three periods."
    ),
    run=run,
    draw=draw,
)
