"""Water of depth h between walls a distance L apart starts at rest with a surface that is a cosine.

The lowest sideways mode is ω² = g k tanh(k h), k = π / L (Lamb, Hydrodynamics, article 228). The period is
twice the mean time between the crossings of the middle by the centroid.
"""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Polygon, Scene, Walls, Water
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, times

_MAX_ERROR = 0.05  # largest relative error of the period [-]
_LOW = 0.125  # position of the lower walls [m]
_LENGTH = 0.75  # distance L between the walls [m]
_AMPLITUDE = 0.02  # amplitude of the surface at the start [m]
_G = 9.81
_WAVE_NUMBER = np.pi / _LENGTH


def run(depths: tuple[float, ...] = (0.2, 0.4), *, resolution: int = 64, periods: float = 3.0) -> Result:
    """Simulate waves on water of these depths [m] for a number of periods."""
    checks, panels = [], []
    for depth in depths:
        exact = float(2 * np.pi / np.sqrt(_G * _WAVE_NUMBER * np.tanh(_WAVE_NUMBER * depth)))
        scene = _scene(depth, resolution)
        x = MpmSolver(scene).rollout(int(np.ceil(periods * exact / scene.frame_dt)))[:, :, 0]
        t, centroid = times(scene, len(x)), x.mean(axis=1, dtype=np.float64) - (_LOW + _LENGTH / 2)
        error = _period(t, centroid) / exact - 1
        checks.append(Check.at_most(f"period, {depth:g} m deep, relative error", error, _MAX_ERROR))
        curves = (
            Curve(t, centroid * 1e3, "centroid", 0),
            Curve(t, centroid[0] * 1e3 * np.cos(2 * np.pi * t / exact), "linear theory", style="--"),
        )
        panels.append(Panel(f"{depth:g} m deep", "time [s]", "centroid [mm]", curves))
    return Result(checks, panels)


def _scene(depth: float, resolution: int) -> Scene:
    along = np.linspace(_LOW, _LOW + _LENGTH, 200)
    surface = _LOW + depth + _AMPLITUDE * np.cos(_WAVE_NUMBER * (along - _LOW))
    outline = [(_LOW + _LENGTH, _LOW), *zip(along[::-1], surface[::-1], strict=True), (_LOW, _LOW)]
    water = Polygon(material=Water(), vertices=tuple((float(x), float(y)) for x, y in outline))
    walls = Walls(lower=(_LOW, _LOW), upper=(_LOW + _LENGTH, 1 - _LOW))
    return Scene(dim=2, resolution=resolution, walls=walls, bodies=(water,))


def _period(t: Floats, x: Floats) -> float:
    """Return twice the mean time between crossings of x = 0 [s], by a line through their times."""
    before = np.flatnonzero(np.sign(x[:-1]) != np.sign(x[1:]))
    crossings = t[before] + (t[1] - t[0]) * x[before] / (x[before] - x[before + 1])
    return float(2 * np.polyfit(np.arange(len(crossings), dtype=np.float64), crossings, 1)[0])
