"""Where explicit steps stop being stable: each material at fixed CFL numbers, in cases chosen to hurt."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hybridmpm import _core
from hybridmpm._support import charts
from hybridmpm.errors import SimulationError
from hybridmpm.scene import Elastic, Sand, Water
from hybridmpm_lab.harness.rows import Progress, Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Outcome = Literal["survived", "degraded", "failed"]

LEVELS: tuple[float, ...] = tuple(round(0.2 + 0.025 * i, 3) for i in range(41))
"""CFL numbers of the map: dt times the material's signal speed over dx."""
MATERIALS = ("water", "sand", "elastic")
STRESSES: dict[str, str] = {
    "splash": "a column that slides over the floor, collapses and hits a wall",
    "alone": "single particles, free and at walls, with J in [0.9, 1.1]",
    "alone, deformed": "the same with J in [0.5, 2]",
}
"""Cases by name: what is done to the material."""
CRITICAL = ("splash", "alone")
"""Cases in which a material has to survive 1.5 times its default CFL number."""

_GRAVITY = 9.81
_WALL_LOW, _WALL_HIGH = 0.1, 0.9
_RESOLUTION = {2: 40, 3: 20}
_SPLASH_SECONDS = 0.6
_ALONE_STEPS = 2000
_LOOKS = 60
"""Number of looks at energy and speed in a run."""
_FIRST_LOOKS = 10
"""Number of looks that count as the start of the run."""
_GROWTH = 1.05
"""Largest energy over that at the start that physics can explain."""
_TOO_FAST = 2.0
"""Largest speed over that of free fall that physics can explain."""
_COLOURS: dict[Outcome, str] = {"survived": "#dbe9f1", "degraded": "#e3a857", "failed": "#7f1d1d"}
"""Colours of the outcomes from light to dark, so that a grey print says the same."""


@dataclass(frozen=True)
class Case:
    """One cell of the map."""

    material: str
    """Name in `MATERIALS`."""
    dim: int
    """Dimension, 2 or 3."""
    stress: str
    """Name in `STRESSES`."""
    level: float
    """CFL number."""


def material(name: str) -> _core.Material:
    """Return the reference material of a name in `MATERIALS`."""
    reference: dict[str, Water | Sand | Elastic] = {"water": Water(), "sand": Sand(), "elastic": Elastic()}
    return reference[name].to_native(1.0)


def cases(levels: Sequence[float] = LEVELS) -> list[Case]:
    """Return all cells of the map."""
    return [
        Case(material, dim, stress, level)
        for stress in STRESSES
        for material in MATERIALS
        for dim in (2, 3)
        for level in levels
    ]


def measure(todo: Sequence[Case], on_progress: Progress) -> Iterator[Row]:
    """Run each case and yield its row; `on_progress` counts cases.

    `signalled` names the error that a user meets: `StepSizeError` where such a step is refused, or else the
    error that ended the run; None where the user meets no error.
    """
    for case in todo:
        outcome, error = run(case)
        refused = case.level > material(case.material).cfl_limit
        yield {
            "method": "mpm",
            **dataclasses.asdict(case),
            "outcome": outcome,
            "signalled": "StepSizeError" if refused else error,
        }
        on_progress(1)


def run(case: Case) -> tuple[Outcome, str | None]:
    """Run a case to its end or to an error, and return the outcome and the error's name, None without one."""
    made_of = material(case.material)
    dx = 1.0 / _RESOLUTION[case.dim]
    # One substep a frame, so that the CFL number is exactly the one asked for.
    frame_dt = case.level * dx / made_of.signal_speed(case.dim)
    if case.stress == "splash":
        solver, fastest = _splash(made_of, case.dim, frame_dt)
        steps = int(_SPLASH_SECONDS / frame_dt)
    else:
        spread = 1.1 if case.stress == "alone" else 2.0
        solver, fastest = _alone(made_of, case.dim, frame_dt, spread), made_of.sound_speed
        steps = _ALONE_STEPS
    energies = [_energy(solver)]
    outcome: Outcome = "survived"
    for look in range(_LOOKS):
        try:
            solver.advance(math.ceil(steps / _LOOKS))
        except SimulationError as error:
            return "failed", type(error).__name__
        energies.append(_energy(solver))
        # Symplectic Euler lets the energy of an oscillation swing: the first swings are the measure.
        grown = energies[-1] > _GROWTH * max(energies[:_FIRST_LOOKS]) if look >= _FIRST_LOOKS else False
        if grown or solver.diagnostics().max_speed > _TOO_FAST * fastest:
            outcome = "degraded"
    return outcome, None


def limits(rows: Sequence[Row]) -> dict[tuple[str, int], float]:
    """Return the largest level up to which all cases of `CRITICAL` survived, by material and dimension.

    The limit is 0 where no level survived.
    """
    best: dict[tuple[str, int], float] = {}
    for key in dict.fromkeys((row["material"], row["dim"]) for row in rows):
        mine = [row for row in rows if (row["material"], row["dim"]) == key and row["stress"] in CRITICAL]
        broken = min((row["level"] for row in mine if row["outcome"] != "survived"), default=np.inf)
        best[key] = max((row["level"] for row in mine if row["level"] < broken), default=0.0)
    return best


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the map as SVG and PNG: one panel per stress, one line of cells per material and dimension."""
    stresses = list(dict.fromkeys(row["stress"] for row in rows))
    levels = sorted({row["level"] for row in rows})
    lines = list(dict.fromkeys((row["material"], row["dim"]) for row in rows))
    step = levels[1] - levels[0] if len(levels) > 1 else 0.05
    figure, axes = charts.panels(len(stresses), width=4.2, height=2.9)
    for axis, stress in zip(axes[0], stresses, strict=True):
        for row in (row for row in rows if row["stress"] == stress):
            place = lines.index((row["material"], row["dim"]))
            colour = _COLOURS[row["outcome"]]
            axis.bar(row["level"], 0.9, step * 0.92, bottom=place - 0.45, color=colour)
        for place, (name, _) in enumerate(lines):
            for cfl, style in ((material(name).default_cfl, "-"), (material(name).cfl_limit, ":")):
                axis.plot([cfl, cfl], [place - 0.45, place + 0.45], style, color="black", linewidth=1.6)
        axis.set(title=stress, xlabel="CFL number", xlim=(levels[0] - step, levels[-1] + step))
        axis.set_yticks(range(len(lines)), [f"{material} {dim}D" for material, dim in lines])
        axis.invert_yaxis()
        axis.grid(visible=False)
    _legend(figure)
    charts.save(figure, file)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - an extra
    from matplotlib.patches import Patch  # noqa: PLC0415

    keys: list[Any] = [Patch(color=colour, label=name) for name, colour in _COLOURS.items()]
    keys.append(Line2D([], [], color="black", label="default"))
    keys.append(Line2D([], [], color="black", linestyle=":", label="refused above"))
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))


def _splash(material: _core.Material, dim: int, frame_dt: float) -> tuple[_core.Solver, float]:
    """Return a column that is thrown along the floor against a wall, and the largest speed of its fall."""
    dx = 1.0 / _RESOLUTION[dim]
    side = {2: 0.25, 3: 0.2}[dim]
    axis = np.arange(_WALL_LOW + dx / 4, _WALL_LOW + side, dx / 2)
    x = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    x += np.random.default_rng(0).uniform(-0.1, 0.1, x.shape) * dx
    x[:, 0] += side
    velocity = np.array([2.0, 0.0, 0.5][:dim])
    solver = _solver(material, x, velocity, frame_dt, gravity=_GRAVITY)
    return solver, float(np.sqrt(velocity @ velocity + 2 * _GRAVITY * side))


def _alone(material: _core.Material, dim: int, frame_dt: float, spread: float) -> _core.Solver:
    """Return particles too far apart to feel each other, compressed or stretched, half of them at walls."""
    rng = np.random.default_rng(1)
    dx = 1.0 / _RESOLUTION[dim]
    places = np.arange(_WALL_LOW, _WALL_HIGH, 5 * dx)
    x = np.stack(np.meshgrid(*[places] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    x += rng.uniform(0.0, dx, x.shape)
    ratio = np.exp(rng.uniform(-np.log(spread), np.log(spread), len(x)))
    return _solver(material, x, np.zeros(dim), frame_dt, volume_ratio=ratio.astype(np.float32))


def _solver(
    material: _core.Material, x: Any, v: Any, frame_dt: float, *, gravity: float = 0.0, **more: Any
) -> _core.Solver:
    count, dim = x.shape
    volume = np.full(count, (0.5 / _RESOLUTION[dim]) ** dim, np.float32)
    return _core.Solver(
        resolution=_RESOLUTION[dim],
        frame_dt=frame_dt,
        gravity=[0.0, -gravity, 0.0][:dim],
        wall_lower=[_WALL_LOW] * dim,
        wall_upper=[_WALL_HIGH] * dim,
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
    height = totals.centroid[1] - _WALL_LOW
    # Without gravity the potential is zero.
    potential = totals.potential_energy * height / totals.centroid[1]
    return totals.kinetic_energy + totals.elastic_energy + potential
