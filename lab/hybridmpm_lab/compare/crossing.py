"""Networks beside the quickest MPM of equal error, over resolution and stiffness."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hybridmpm import scenarios
from hybridmpm._support import charts
from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import models
from hybridmpm.planner.candidates import Candidate, solvers
from hybridmpm.scene import Scene, Water
from hybridmpm_lab.compare import comparison, methods
from hybridmpm_lab.compare.comparison import Case, ComparisonSettings, seeds
from hybridmpm_lab.compare.methods import LEARNED, Method
from hybridmpm_lab.harness.chart import legend
from hybridmpm_lab.harness.rows import FIRST_SEED, Row, significant
from hybridmpm_lab.harness.settings import setting
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.harness.table import row_name

SCENARIOS = ("water_2d", "sand_2d", "water_3d", "sand_3d")
"""Scenarios of one material without obstacles."""
RESOLUTIONS = {2: (64, 128, 256, 512), 3: (32, 64, 128)}
"""Cells per metre by dimension."""
COMPRESSIONS = (0.014, 0.005, 0.001)
"""Compression of water by its own weight, at most [-]. Sand is as much stiffer than its own as water of this
compression is than water of the first."""
MANY = 100_000
"""Number of particles above which a case has one scene only."""
_REFERENCE_STEP = 0.02
"""Time in which the ground truth advances by a substep, for each metre of a cell's width [s/m]."""
_LEAST = 60
"""Particles that a further coarse mode simulates at least."""
_STIFFEST = 64
"""Largest factor by which material may be softened where it is stiffer than the scenario's."""
_TITLES = {"resolution": "cells per metre", "compression": "compression by its own weight"}


@dataclass(frozen=True, kw_only=True)
class CrossingSettings(ComparisonSettings):
    """Settings of the crossing."""

    scenario: tuple[str, ...] = setting(SCENARIOS, "Scenario of the scenes.", SCENARIOS)
    resolution: tuple[int, ...] = setting((), "Cells per metre; if absent, all that are known.", int)
    compression: tuple[float, ...] = setting(COMPRESSIONS, "Compression of water by its own weight.", float)
    scenes: int = setting(3, "Number of held-out scenes of each case.", low=1, high=1000)


@dataclass(frozen=True, kw_only=True)
class Variation:
    """A scenario at one resolution and stiffness."""

    scenario: str
    """Scenario of the scenes."""
    resolution: int
    """Cells per metre."""
    compression: float | None = None
    """Compression by its own weight; None for the scenario's own material."""

    @property
    def finer(self) -> float:
        """Resolution over that of the scenario [-]."""
        return self.resolution / scenarios.get(self.scenario, FIRST_SEED).resolution

    @property
    def is_trained(self) -> bool:
        """Whether the networks were trained on this spacing and material."""
        return self.finer == 1 and self.compression is None

    def scene(self, seed: int) -> Scene:
        """Return a scene: the same bodies as in the scenario, as many particles as the cells need."""
        plain = scenarios.get(self.scenario, seed)
        most = max(plain.max_particles, round(plain.max_particles * self.finer**plain.dim))
        fine = plain.model_copy(update={"resolution": self.resolution, "max_particles": most})
        return fine if self.compression is None else _stiffer(fine, self.compression)

    def stiffer(self) -> float:
        """Return the modulus of the material over that of the scenario's [-]."""
        scene = self.scene(FIRST_SEED)
        material = scene.bodies[0].material
        if self.compression is None:
            return 1.0
        if isinstance(material, Water):
            return material.stiffness(scene.potential_drop) / Water().stiffness(scene.potential_drop)
        return COMPRESSIONS[0] / self.compression


def cases(settings: CrossingSettings) -> list[Case]:
    """Return each resolution with the scenario's material, and each stiffness at the scenario's resolution.

    Raises
    ------
    ConfigError
        No scenario has scenes of the resolutions that are given.
    """
    found: list[Variation] = []
    for name in settings.scenario:
        plain = scenarios.get(name, FIRST_SEED)
        wanted = [one for one in RESOLUTIONS[plain.dim] if one in (settings.resolution or (one,))]
        found += [Variation(scenario=name, resolution=one) for one in wanted]
        if plain.resolution in wanted:
            stiff = partial(Variation, scenario=name, resolution=plain.resolution)
            found += [stiff(compression=one) for one in settings.compression]
    if not found:
        raise ConfigError(f"no scenario of {', '.join(settings.scenario)} has scenes of these resolutions")
    return [_case(one, settings) for one in found]


def _case(one: Variation, settings: CrossingSettings) -> Case:
    particles = len(one.scene(FIRST_SEED).sample().x)
    by_rule = (
        math.floor(scenarios.get(one.scenario, FIRST_SEED).frame_dt * one.resolution / _REFERENCE_STEP) + 1
    )
    return Case(
        head={**dataclasses.asdict(one), "particles": particles},
        scene=one.scene,
        timed=partial(one.scene, FIRST_SEED),
        methods=methods.matching(_methods(one, particles), settings.method),
        seeds=seeds(1 if particles > MANY else settings.scenes),
        warm_up=methods.warm_up(one.scenario),
        span=settings.span,
        # The ground truth's rule depends on cells alone; the speed of waves on the root of stiffness.
        substeps=math.ceil(by_rule * max(1.0, one.stiffer()) ** 0.5),
        is_full=False,
        threads=settings.threads,
    )


def _methods(one: Variation, particles: int) -> Iterator[Method]:
    """Yield the methods of a case.

    Of more than `MANY` particles, methods that simulate at least half of them are left out, but for plain
    MPM: they take as long, and no network errs as little.
    """
    for candidate in solvers().values():
        if particles <= MANY or candidate.name == "mpm 1" or candidate.r_p <= 0.5:
            yield methods.of_candidate(candidate)
    if one.compression is not None:
        label = f"softer 1/{_STIFFEST}"
        soft = Candidate(method="mpm", label=label, variant="softer", r_p=1.0, softer=1 / _STIFFEST)
        yield methods.of_candidate(soft)
    divisor = 128
    while particles / divisor >= _LEAST and one.finer > 1:
        given = {"r_p": 1 / divisor, "show_all": True}
        label = f"unfitted 1/{divisor}"
        coarse = Candidate(method="coarse", label=label, variant="plain", r_p=1 / divisor, settings=given)
        yield methods.of_candidate(coarse)
        divisor *= 2
    dim = scenarios.get(one.scenario, FIRST_SEED).dim
    for name in methods.serving(one.scenario):
        r_p = min(1.0, models()[name].r_p / one.finer**dim)
        yield methods.rescaled("neural", name, r_p)
        yield methods.rescaled("hybrid", name, r_p)


def _stiffer(scene: Scene, compression: float) -> Scene:
    bodies = []
    for body in scene.bodies:
        material = body.material
        if isinstance(material, Water):
            material = material.model_copy(update={"bulk_modulus": None, "max_compression": compression})
        else:
            material = material.softened(COMPRESSIONS[0] / compression, scene.potential_drop)
        bodies.append(body.model_copy(update={"material": material}))
    return scene.model_copy(update={"bodies": tuple(bodies)})


def table(found: Sequence[Case], store: RowStore) -> list[Row]:
    """Return the rows of `comparison.table`, and how much slower networks are than MPM of equal error.

    `refused` is whether the library refuses the case, `times_slower` the method's time over `equal_mpm_ms`.
    """
    rows = comparison.table(found, store)
    for row in rows:
        is_learned = row["method"] in LEARNED
        is_measured = is_learned and row["equal_mpm_ms"] and row["ms_per_frame"]
        row["refused"] = is_learned and not _is_trained(row)
        row["times_slower"] = significant(row["ms_per_frame"] / row["equal_mpm_ms"]) if is_measured else None
    return rows


def _is_trained(row: Row) -> bool:
    one = Variation(scenario=row["scenario"], resolution=row["resolution"], compression=row["compression"])
    return one.is_trained


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw a column for each scenario, over resolution and over stiffness; raises as `charts` does.

    A line is a learned method; its height is its time over that of the quickest MPM that errs no more. Below
    one it pays. Points of cases that the library refuses are hollow.
    """
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    figure, axes = charts.panels(len(names), len(_TITLES), width=3.9, height=3.3)
    learned = [row for row in rows if row["method"] in LEARNED and row["times_slower"]]
    looks = dict(
        zip(
            dict.fromkeys(row_name(row) for row in learned),
            zip(charts.COLOURS, charts.MARKERS, strict=True),
            strict=False,
        )
    )
    for column, name in enumerate(names):
        for panel, axis in zip(axes[:, column], _TITLES, strict=True):
            is_stiffness = axis == "compression"
            mine = [
                row
                for row in learned
                if row["scenario"] == name and (row["compression"] is not None) == is_stiffness
            ]
            _panel(panel, mine, axis, looks)
        axes[0, column].set_title(name)
    for row in axes:
        row[0].set_ylabel("times slower than MPM of equal error")
    legend(figure, axes)
    charts.save(figure, file)


def _panel(panel: Any, rows: Sequence[Row], axis: str, looks: dict[str, tuple[str, str]]) -> None:
    panel.axhline(1.0, color="#303030", lw=1.2, linestyle="--", label="equal error, equal time")
    for name, (colour, marker) in looks.items():
        mine = sorted((row for row in rows if row_name(row) == name), key=lambda row: float(row[axis]))
        points = [(row[axis], row["times_slower"]) for row in mine]
        if points:
            panel.plot(
                *zip(*points, strict=True), color=colour, lw=1, label=name, marker=marker, markerfacecolor="w"
            )
        if known := [point for point, row in zip(points, mine, strict=True) if not row["refused"]]:
            panel.plot(*zip(*known, strict=True), color=colour, marker=marker, linestyle="none")
    panel.set(xscale="log", yscale="log", xlabel=_TITLES[axis])
    ticks = sorted({row[axis] for row in rows})
    panel.set_xticks(ticks, [f"{100 * one:g} %" if axis == "compression" else f"{one}" for one in ticks])
    panel.minorticks_off()
    charts.plain_log_ticks(panel.yaxis)
    if axis == "compression":
        panel.invert_xaxis()
