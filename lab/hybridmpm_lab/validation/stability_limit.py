"""Each material runs at fixed CFL numbers, in three cases chosen to hurt, until it no longer survives.

The CFL number is dt times the signal speed sqrt((D lambda + 2 mu) / density) over dx.
"""

import math
from typing import Any

import numpy as np

from hybridmpm import _core
from hybridmpm.errors import SimulationError
from hybridmpm.scene import Elastic, Liquid, Sand, Water
from hybridmpm_lab.validation.case import Check, Curve, Panel, Result

MARGIN = 1.5
"""Least limit over the default CFL number."""
MATERIALS: dict[str, _core.Material] = {
    one.kind: one.to_native(1.0) for one in (Water(), Sand(), Elastic(), Liquid(viscosity=1e3))
}
STRESSES = ("splash", "alone", "alone, deformed")
"""Cases by name; the last is not judged."""

_LEVELS = tuple(round(0.2 + 0.025 * i, 3) for i in range(41))  # CFL numbers of the full run
_GRAVITY = 9.81
_LOW, _HIGH = 0.1, 0.9  # places of the walls [m]
_RESOLUTION = {2: 40, 3: 20}
_LOOKS, _FIRST_LOOKS = 60, 10
"""Number of measurements of energy and speed in a run, and of those that count as its start."""


def run(levels: tuple[float, ...] = _LEVELS) -> Result:
    """Find the limit of each material in both dimensions, among increasing CFL numbers."""
    settings = [(name, dim) for name in MATERIALS for dim in (2, 3)]
    reached = {stress: [_limit(*setting, stress, levels) for setting in settings] for stress in STRESSES}
    checks = []
    for k, (name, dim) in enumerate(settings):
        limit, default = min(reached[stress][k] for stress in STRESSES[:2]), MATERIALS[name].default_cfl
        checks += [
            Check.between(f"{name} {dim}D, limit / default", limit / default, (MARGIN, math.inf)),
            Check.reported(f"{name} {dim}D, limit", limit, f"default {default:.3g}"),
            Check.reported(f"{name} {dim}D, limit with J in [0.5, 2]", reached[STRESSES[2]][k], ""),
        ]
    lines = np.arange(len(settings))
    curves = [
        Curve(limit, lines, f"{stress}: limit", k, "o") for k, (stress, limit) in enumerate(reached.items())
    ]
    for label, kind, marker in (("default", "default_cfl", "|"), ("refused above", "cfl_limit", "x")):
        cfl = [getattr(MATERIALS[name], kind) for name, _ in settings]
        curves.append(Curve(cfl, lines, label, style="o", options={"marker": marker, "markersize": 9}))
    names = {"yticks": lines, "yticklabels": [f"{name} {dim}D" for name, dim in settings]}
    return Result(checks, [Panel("Stable steps", "CFL number", "", curves, names | {"xlim": (0, 1.25)})])


def _limit(name: str, dim: int, stress: str, levels: tuple[float, ...]) -> float:
    """Return the last of the levels before the first that is not survived, 0 where none is."""
    best = 0.0
    for level in levels:
        if outcome(name, dim, stress, level) != "survived":
            break
        best = level
    return best


def outcome(name: str, dim: int, stress: str, level: float) -> str:
    """Run a material under a stress at a CFL number; return "survived", "degraded" or the error's name.

    Degraded is a run whose energy or speed grows beyond what physics can explain.
    """
    material, dx = MATERIALS[name], 1.0 / _RESOLUTION[dim]
    # One substep a frame, so that the CFL number is exactly the wanted one.
    frame_dt = level * dx / material.signal_speed(dim)
    if stress == "splash":
        solver, fastest = _splash(material, dim, frame_dt)
        steps = int(0.6 / frame_dt)
    else:
        solver = _alone(material, dim, frame_dt, spread=1.1 if stress == "alone" else 2.0)
        steps, fastest = 2000, material.sound_speed
    energies = [_energy(solver)]
    found = "survived"
    for look in range(_LOOKS):
        try:
            solver.advance(math.ceil(steps / _LOOKS))
        except SimulationError as error:
            return type(error).__name__
        energies.append(_energy(solver))
        # The energy of an oscillation swings under symplectic Euler: the first swings are the measure.
        grown = look >= _FIRST_LOOKS and energies[-1] > 1.05 * max(energies[:_FIRST_LOOKS])
        if grown or solver.diagnostics().max_speed > 3 * fastest:
            found = "degraded"
    return found


def _splash(material: _core.Material, dim: int, frame_dt: float) -> tuple[_core.Solver, float]:
    """Return a column that is thrown along the floor against a wall, and the largest speed of its fall."""
    dx, side = 1.0 / _RESOLUTION[dim], {2: 0.25, 3: 0.2}[dim]
    x = _lattice(np.arange(_LOW + dx / 4, _LOW + side, dx / 2), dim)
    x += np.random.default_rng(0).uniform(-0.1, 0.1, x.shape) * dx
    x[:, 0] += side
    velocity = np.array([2.0, 0.0, 0.5][:dim])
    solver = _solver(material, x, velocity, frame_dt, gravity=_GRAVITY)
    return solver, float(np.sqrt(velocity @ velocity + 2 * _GRAVITY * side))


def _alone(material: _core.Material, dim: int, frame_dt: float, *, spread: float) -> _core.Solver:
    """Return particles too far apart to interact, compressed or stretched, half of them at walls."""
    rng, dx = np.random.default_rng(1), 1.0 / _RESOLUTION[dim]
    x = _lattice(np.arange(_LOW, _HIGH, 5 * dx), dim)
    x += rng.uniform(0.0, dx, x.shape)
    ratio = np.exp(rng.uniform(-np.log(spread), np.log(spread), len(x)))
    return _solver(material, x, np.zeros(dim), frame_dt, volume_ratio=ratio.astype(np.float32))


def _lattice(places: Any, dim: int) -> Any:
    return np.stack(np.meshgrid(*[places] * dim, indexing="ij"), axis=-1).reshape(-1, dim)


def _solver(
    material: _core.Material, x: Any, v: Any, frame_dt: float, *, gravity: float = 0.0, **more: Any
) -> _core.Solver:
    count, dim = x.shape
    volume = np.full(count, (0.5 / _RESOLUTION[dim]) ** dim, np.float32)
    return _core.Solver(
        resolution=_RESOLUTION[dim],
        frame_dt=frame_dt,
        gravity=[0.0, -gravity, 0.0][:dim],
        wall_lower=[_LOW] * dim,
        wall_upper=[_HIGH] * dim,
        materials=[material],
        x=x.astype(np.float32),
        v=np.broadcast_to(v, x.shape).astype(np.float32),
        material=np.zeros(count, np.uint8),
        mass=volume * np.float32(material.density),
        volume=volume,
        substeps=1,
        allow_unstable=True,
        **more,
    )


def _energy(solver: _core.Solver) -> float:
    """Return the total energy above that of all particles at rest on the floor [J]."""
    totals = solver.diagnostics()
    height = totals.centroid[1]
    return totals.kinetic_energy + totals.elastic_energy + totals.potential_energy * (height - _LOW) / height
