"""`fit_levels`: searches constants of levels, judges them, and puts them into a table."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hybridmpm._core import SOLVER_VERSION
from hybridmpm._support.files import replacing
from hybridmpm.coarse import CoarseTable, FittedLevel, coarse_table
from hybridmpm.errors import ConfigError
from hybridmpm_lab.fitting.cases import Case
from hybridmpm_lab.fitting.judge import fastest, judge, scenarios_of
from hybridmpm_lab.fitting.search import PRICE, search
from hybridmpm_lab.fitting.space import TARGETS, Constants, Target

LARGEST_COMPRESSION = 0.02
"""Compression of matter at rest up to which moduli are lowered: the settled depth then misses as much."""


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Length of the searches."""

    trials: int = 80
    """Number of points that the search of each coarse level tries; with 0 the coarse levels of the table are judged anew."""
    scenes: int = 10
    """Number of training scenes, from seed 0 on."""
    held_out: int = 10
    """Number of scenes that a coarse level is judged on, half as many of each other scenario with its material."""

    def steps(self, targets: Sequence[Target]) -> int:
        """Return how often progress is told."""
        return sum(self.trials + sum(self.judged(one).values()) for one in targets)

    def judged(self, target: Target) -> dict[str, int]:
        """Return the number of held-out scenes by scenario."""
        others = max(2, self.held_out // 2)
        return {name: self.held_out if name == target.scenario else others for name in scenarios_of(target)}


def fit_levels(
    targets: Sequence[Target],
    settings: FitSettings,
    *,
    folder: Path,
    file: Path,
    on_step: Callable[[], object],
) -> CoarseTable:
    """Search the constants of levels, and write them into a table with what held-out scenes say of them.

    The file keeps its coarse levels of the same solver that are not among the targets, and the constants of a target
    that no trial beats on the training scenes. After an interruption the
    same call goes on with the trial at which it stopped.

    Parameters
    ----------
    targets : sequence of Target
    settings : FitSettings
    folder : Path
        Folder of the journals of the searches and of the truths of scenes; made if it is missing.
    file : Path
        File of the table, JSON.
    on_step : callable
        Called after each trial and after each scene that a coarse level was judged on.

    Raises
    ------
    DataError
        A journal or the table is damaged, or a journal is of another search.
    ConfigError
        `settings.trials` is 0, and the table lacks one of the targets.
    ExportError
        A file cannot be written.
    """
    truths = folder / "truths"
    truths.mkdir(parents=True, exist_ok=True)
    cases: dict[str, list[Case]] = {}
    older = coarse_table(file).entries if file.exists() else ()
    entries = {Target(one.material, one.dim, one.name): one for one in older}
    missing = [target.key for target in targets if target not in entries]
    if settings.trials == 0 and missing:
        raise ConfigError(f"{file} has no coarse level {missing[0]} to judge; fit it with at least one trial")
    for target in sorted(targets if settings.trials else (), key=lambda one: one.scenario):
        scenario = target.scenario
        if scenario not in cases:
            # Those of one scenario at a time: in 3D they take half a gigabyte.
            cases = {scenario: [Case.of(scenario, seed, truths) for seed in range(settings.scenes)]}
        known = entries.get(target)
        entries[target] = _searched(target, cases[scenario], settings, folder, on_step, known=known)
    for target in targets:
        table = _table(entries)
        seen = [
            judge(target, table, scenario, scenes=scenes, folder=truths, on_scene=on_step)
            for scenario, scenes in settings.judged(target).items()
        ]
        entries[target] = entries[target].model_copy(update={"held_out": tuple(seen)})
    table = _table(entries)
    with replacing(file) as part:
        part.write_text(json.dumps(table.model_dump(mode="json"), indent=1) + "\n", encoding="utf-8")
    return table


def _searched(
    target: Target,
    cases: Sequence[Case],
    settings: FitSettings,
    folder: Path,
    on_step: Callable[[], object],
    *,
    known: FittedLevel | None,
) -> FittedLevel:
    journal = folder / f"{target.key}.jsonl"
    older = None if known is None else Constants.of(known)
    found = search(target, cases, settings.trials, journal, on_step, known=older)
    best = found.constants
    return FittedLevel(
        material=target.material,
        dim=target.dim,
        name=target.name,
        r_p=target.r_p,
        particles_per_cell=_rounded(best.particles_per_cell),
        modulus=_rounded(best.modulus),
        cfl=_rounded(best.cfl),
        affine_share=_rounded(best.affine_share),
        relaxation=_rounded(best.relaxation),
        seeds=tuple(range(settings.scenes)),
        trials=found.trials,
        fastest=_rounded(fastest(target)),
        held_out=(),
    )


def _table(entries: Mapping[Target, FittedLevel]) -> CoarseTable:
    return CoarseTable(
        solver_version=SOLVER_VERSION,
        price=PRICE,
        largest_compression=LARGEST_COMPRESSION,
        entries=tuple(entries[target] for target in TARGETS if target in entries),
    )


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
