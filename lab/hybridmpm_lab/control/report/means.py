"""Means over the sketches of each family, scenario and kind, with paired standard errors."""

from collections.abc import Sequence

import numpy as np

from hybridmpm.errors import ConfigError
from hybridmpm.metrics import ErrorTable, Estimate
from hybridmpm_lab.control.entrants import CONSTANT, Entrant
from hybridmpm_lab.control.measures import naturalness
from hybridmpm_lab.control.results import Runs
from hybridmpm_lab.control.suite.cases import Case, cases
from hybridmpm_lab.control.trial import MEASURES
from hybridmpm_lab.harness.rows import Row, significant

GAPS = ("error", "transport", "path_error", "inside")
"""Measures whose difference to the constant force is told, with its paired standard error."""
_JUDGED_BY = {"reversed": "error", "bent": "path_error"}
ALL = "all"
"""Stands for all scenarios of a family."""
_ORIGIN = ("machine", "date", "commit", "command")


def means(runs: Runs, some: Sequence[Case], entrants: Sequence[Entrant]) -> list[Row]:
    """Return a row for each family, scenario, kind of sketch and method that has run on any of the cases.

    Where a family has several scenarios, rows of the scenario `ALL` tell the means over the sketches of all.

    Each measure is the mean over sketches, `MEASURE_se` its standard error; `error_gap`, `transport_gap`,
    `path_error_gap` and `inside_gap` are mean differences to the constant force on the same sketches, with
    paired standard errors; `wins` is the share of the sketches on which `judged_by` of the family is smaller
    than for the constant force. `count` of the suite's `suite_count` sketches were run, and the method
    `failed` on some of them, which are left out. Origin is that of the first run.
    """
    judged = dict.fromkeys(case.scenario for case in some if case.family == "reversed")
    reals = {scenario: _reals(runs, scenario) for scenario in judged}
    names = [one.name for one in entrants]
    rows = []
    for (family, scenario, kind), group in _groups(some).items():
        found = runs.rows(group, names)
        table = _table(found)
        head = {"scenario": scenario, "family": family, "sketch": kind}
        names_of_group = {case.scenario for case in group}
        whole = len([case for case in cases([family], names_of_group) if case.kind == kind])
        soundness = reals.get(scenario) if family == "reversed" else None
        for name in dict.fromkeys(row["method"] for row in found):
            mine = [row for row in found if row["method"] == name]
            counts = {"count": len(mine), "suite_count": whole}
            failed = sum(row["failed"] is not None for row in mine)
            rows.append(
                {
                    **head,
                    "method": name,
                    **counts,
                    "failed": failed,
                    "threads": 1,
                    **_figures(table, name),
                    "wins": significant(_share(wins(found, name))),
                    **_naturalness(runs, group, name, soundness),
                    **{field: mine[0][field] for field in _ORIGIN},
                }
            )
    return rows


def _table(rows: Sequence[Row]) -> ErrorTable:
    table = ErrorTable()
    for row in rows:
        if row["failed"] is None:
            figures = {name: row[name] for name in MEASURES if row[name] is not None}
            table.add(row["method"], f"{row['scenario']} {row['seed']}", figures)
    return table


def _groups(some: Sequence[Case]) -> dict[tuple[str, str, str], list[Case]]:
    groups: dict[tuple[str, str, str], list[Case]] = {}
    for case in some:
        groups.setdefault((case.family, case.scenario, case.kind), []).append(case)
    for family, kind in dict.fromkeys((case.family, case.kind) for case in some):
        whole = [case for case in some if (case.family, case.kind) == (family, kind)]
        if len({case.scenario for case in whole}) > 1:
            groups[family, ALL, kind] = whole
    return groups


def _figures(table: ErrorTable, name: str) -> Row:
    row: Row = {}
    for measure in MEASURES:
        mean = _estimate(table, name, measure)
        row[measure] = significant(mean.mean if mean else None)
        row[f"{measure}_se"] = significant(mean.standard_error if mean else None, 2)
    for measure in GAPS:
        gap = None
        if name != CONSTANT and all(_estimate(table, one, measure) for one in (name, CONSTANT)):
            gap = table.difference(name, CONSTANT, measure)
        row[f"{measure}_gap"] = significant(gap.mean if gap else None)
        row[f"{measure}_gap_se"] = significant(gap.standard_error if gap else None, 2)
    return row


def _estimate(table: ErrorTable, name: str, measure: str) -> Estimate | None:
    try:
        return table.estimate(name, measure)
    except ConfigError:
        return None  # no sketch has this measure


def _reals(runs: Runs, scenario: str) -> float | None:
    """Return how well the classifier tells uncontrolled frames apart; None with too few seeds for halves."""
    reference = runs.references(scenario)
    if len(reference) < 2 * naturalness.LEAST_SEEDS:
        return None
    return naturalness.real_against_real(reference)


def _naturalness(runs: Runs, group: Sequence[Case], name: str, reals: float | None) -> Row:
    looks = runs.looks(group, name)
    found = None
    if (
        reals is not None
        and abs(reals - 0.5) <= naturalness.TOLERANCE
        and len(looks) >= naturalness.LEAST_SEEDS
    ):
        found = naturalness.auc(looks, runs.references(group[0].scenario))
    return {"naturalness": significant(found), "naturalness_of_reals": significant(reals)}


def wins(rows: Sequence[Row], name: str) -> list[bool]:
    """Tell for each sketch whether a method is better than the constant force, by `judged_by` of its family.

    Sketches on which one of both has failed, or has not run, are left out. So is a method without a run,
    which has no way, where the way counts.
    """
    both = [(mine, constant, judged_by(mine["family"])) for mine, constant in paired(rows, name)]
    return [
        bool(mine[measure] < constant[measure])
        for mine, constant, measure in both
        if mine[measure] is not None
    ]


def judged_by(family: str) -> str:
    """Return the measure by which a family is judged first.

    That is the error against the truth where there is one, along bent arrows the distance from the drawn way,
    which a shape that is carried straight to the tip misses, and else the transport distance.
    """
    return _JUDGED_BY.get(family, "transport")


def paired(rows: Sequence[Row], name: str) -> list[tuple[Row, Row]]:
    """Return pairs of a method's row and that of the constant force on the same sketch."""
    there = [row for row in rows if row["failed"] is None]
    constant = {_sketch(row): row for row in there if row["method"] == CONSTANT}
    return [
        (row, constant[_sketch(row)]) for row in there if row["method"] == name and _sketch(row) in constant
    ]


def _sketch(row: Row) -> tuple[str, int]:
    return row["scenario"], row["seed"]


def _share(won: Sequence[bool]) -> float | None:
    return float(np.mean(won)) if won else None
