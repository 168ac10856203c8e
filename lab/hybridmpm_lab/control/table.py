"""Means over the sketches of each family, scenario and kind, and the tables of docs/results/control.md."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm.metrics import Estimate
from hybridmpm_lab.control.methods import CONSTANT, Methods
from hybridmpm_lab.control.naturalness import LEAST_SEEDS, TOLERANCE, auc, real_against_real
from hybridmpm_lab.control.runner import MEASURES, rows_of, run_key
from hybridmpm_lab.control.suite import REFERENCE_SEEDS, SETTINGS, Case, cases
from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.harness.store import RowStore

_Floats = npt.NDArray[np.float64]
ALL = "all"
"""Name of the rows over all scenarios of a family."""
Cells = dict[tuple[str, str], str]
"""Texts of a table by line and column."""
PAPER = {
    "water_2d": (0.0908, 0.0802),
    "sand_2d": (0.1151, 0.0924),
    "water_3d": (0.0019, 0.0013),
    "sand_3d": (0.0022, 0.0019),
}
"""Final grid RMSE of arXiv:2505.18926, table control_nrmse: its constant force, its learned controller."""
_SPREADS = ("error", "nrmse", "node_error", "transport", "path_error", "inside")
"""Measures whose standard error a row has."""
_ORIGIN = ("machine", "date", "commit", "command", "solver_version")
_UNIT = {
    "error": "final grid_rmse",
    "path_error": "distance from the path [mm]",
    "transport": "transport [mm]",
}
_COSTS = {
    "inside": "inside",
    "inside_later": "20 frames later",
    "rms_ratio": "force over the least",
    "plan_ms": "planning [ms]",
    "first_frame_ms": "first frame [ms]",
    "total_ms": "total [ms]",
    "slowdown": "slowdown",
}
_IN_2D, _IN_3D = SETTINGS[:2], SETTINGS[2:]
AIMS: tuple[tuple[str, str, str, tuple[str, ...], float], ...] = (
    ("oval", "all", "analytic", _IN_2D, 0.60),
    ("oval", "1", "analytic", _IN_2D, 0.33),
    ("oval", "1", "analytic", _IN_3D, 0.65),
    ("arrow", "all", "analytic", SETTINGS, 0.75),
    ("arrow", "all", "backcast", ("water_2d", "water_3d"), 0.62),
    ("oval", "all", "learned", _IN_2D, 0.60),
    ("arrow", "all", "learned", _IN_2D, 0.60),
)
"""Kind of sketch, number of bodies, method, scenarios, and the largest mean error over that of the constant
force, in the reversed family."""


def judged_by(family: str) -> str:
    """Return the measure that decides in a family.

    It is the error against the truth where there is one; along bent arrows the distance from the drawn path,
    which the constant force misses though its shape arrives; else the transport distance.
    """
    return {"reversed": "error", "bent": "path_error"}.get(family, "transport")


def means(store: RowStore, some: Sequence[Case], methods: Methods) -> list[Row]:
    """Return a row for each family, scenario, kind of sketch and method that has run on any of the cases.

    Where a family has several scenarios, rows of the scenario `all` have the means over all its sketches.
    Each of `MEASURES` is the mean over sketches, `NAME_se` its standard error. `gap` is the mean difference
    from the constant force on the same sketches in what the family is judged by, `gap_se` its paired
    standard error, and `wins` the share of these sketches on which it is negative. `count` of `suite_count`
    sketches were run; those on which the run `failed` are left out of the means. The origin is that of the
    first run, the ingredients are those of all runs.
    """
    natural = {name: _natural(store, name) for name in SETTINGS}
    rows = []
    for (family, scenario, kind), group in _groups(some).items():
        found = rows_of(group, methods, store)
        scenarios = {case.scenario for case in group}
        whole = len([case for case in cases([family], scenarios) if case.kind == kind])
        for name in dict.fromkeys(row["method"] for row in found):
            mine = [row for row in found if row["method"] == name]
            used = {word for row in mine for word in (row["ingredients"] or "").split()}
            runs = [store[key] for case in group if (key := run_key(case, name)) in store]
            rows.append(
                {
                    "scenario": scenario,
                    "family": family,
                    "sketch": kind,
                    "method": name,
                    "count": len(mine),
                    "suite_count": whole,
                    "failed": sum(row["failed"] is not None for row in mine),
                    "threads": 1,
                    **_figures(found, name, judged_by(family)),
                    **_naturalness(runs, natural.get(scenario) if family == "reversed" else None),
                    **{field: mine[0][field] for field in _ORIGIN},
                    "ingredients": " ".join(sorted(used)) or None,
                }
            )
    return rows


def compared_with_aims(rows: Sequence[Row]) -> list[Row]:
    """Return a row for each of `AIMS` and each scenario with runs.

    `measured` is a ratio of mean errors of paired runs, `se` its standard error to first order.
    """
    there = [row for row in rows if row["family"] == "reversed" and row["failed"] is None]
    found = []
    for kind, bodies, method, scenarios, aim in AIMS:
        mine = [row for row in there if row["sketch"] == kind and bodies in ("all", str(row["bodies"]))]
        for scenario in scenarios:
            pairs = _pairs([row for row in mine if row["scenario"] == scenario], method, "error")
            if len(pairs):
                ratio, error = ratio_of_means(pairs)
                row: Row = {"scenario": scenario, "sketch": kind, "bodies": bodies, "method": method}
                row |= {"count": len(pairs), "aim": aim, "measured": significant(ratio, 3)}
                found.append(row | {"se": significant(error, 2), "met": ratio <= aim})
    return found


def ratio_of_means(pairs: _Floats) -> tuple[float, float | None]:
    """Return mean(a) / mean(b) of pairs (K, 2), and its standard error to first order; None for one pair."""
    mine, others = pairs.T
    ratio = float(mine.mean() / others.mean())
    if len(pairs) < 2:
        return ratio, None
    apart = mine - ratio * others
    return ratio, float(apart.std(ddof=1) / np.sqrt(len(pairs)) / others.mean())


def tables(rows: Sequence[Row]) -> str:
    """Return tables in Markdown, of rows of `means`.

    They are results by family, costs, naturalness, and errors beside the paper's.
    """
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(f"{row['family']}, {row['sketch']}s", []).append(row)
    counts = {(row["count"], row["suite_count"]) for row in rows if row["scenario"] != ALL}
    is_whole = all(count == whole for count, whole in counts)
    share = "all sketches" if is_whole else f"a part of the sketches, {min(counts)[0]} a row or more"
    origin = f"{rows[0]['machine']}, {rows[0]['date']}, commit {str(rows[0]['commit'])[:7]}"
    parts = [f"Measured on {share}; {origin}.\n"]
    for title, group in groups.items():
        measure = judged_by(group[0]["family"])
        form = (".3f", 1) if measure == "error" else (".3g", 1000)
        cells = {(row["scenario"], row["method"]): _cell(row, measure, *form) for row in group}
        parts.append(_table(f"{title}: {_UNIT[measure]}", cells))
    costs = {
        (f"{title}, {row['method']}", label): "" if row[name] is None else f"{row[name]:.3g}"
        for title, group in groups.items()
        for row in group
        # The last row is that of all scenarios, or of the only one.
        if row["scenario"] == group[-1]["scenario"] and row["rms_g"] is not None
        for name, label in _COSTS.items()
    }
    judged = [(f"{row['scenario']}, {row['sketch']}s", row) for row in rows if row["naturalness"] is not None]
    natural = {(title, row["method"]): f"{row['naturalness']:.2f}" for title, row in judged}
    natural |= {(title, "real against real"): f"{row['naturalness_of_reals']:.2f}" for title, row in judged}
    parts += [_table("all scenarios", costs), _table("naturalness", natural)]
    return "\n".join(
        part for part in [*parts, _table("reversed: nrmse (ratio)", _beside_paper(rows))] if part
    )


def aims_table(aims: Sequence[Row]) -> str:
    """Return rows of `compared_with_aims` as a table in Markdown."""
    cells: Cells = {}
    for row in aims:
        bodies = ", one body" if row["bodies"] == "1" else ""
        line = f"{row['scenario']}, {row['sketch']}s{bodies}, {row['method']}"
        cells[line, "sketches"] = str(row["count"])
        cells[line, "largest ratio"] = f"{row['aim']:.2f}"
        cells[line, "measured"] = f"{row['measured']}" + ("" if row["se"] is None else f" ± {row['se']}")
        cells[line, ""] = "met" if row["met"] else "missed"
    return _table("aims", cells)


def _beside_paper(rows: Sequence[Row]) -> Cells:
    """Return errors in the reading of the paper's labels, and in brackets ratios to the constant force."""
    mine = [row for row in rows if row["family"] == "reversed" and row["error"] is not None]
    mine = [row for row in mine if row["scenario"] in PAPER]
    base = {(row["scenario"], row["sketch"]): row["error"] for row in mine if row["method"] == CONSTANT}
    cells = {}
    for name in dict.fromkeys(row["scenario"] for row in mine):
        constant, learned = PAPER[name]
        cells["paper, constant", name] = str(constant)
        cells["paper, learned", name] = f"{learned} ({learned / constant:.2f})"
    for row in mine:
        ratio = row["error"] / base[row["scenario"], row["sketch"]]
        cells[f"{row['sketch']}s, {row['method']}", row["scenario"]] = (
            f"{_cell(row, 'nrmse', '.4f')} ({ratio:.2f})"
        )
    return cells


def _table(corner: str, cells: Cells) -> str:
    """Return a table in Markdown of cells by line and column; nothing without cells."""
    lines, columns = (list(dict.fromkeys(key[k] for key in cells)) for k in (0, 1))
    body = [[line, *(cells.get((line, column), "") for column in columns)] for line in lines]
    rows = [[corner, *columns], ["---"] * (len(columns) + 1), *body] if body else []
    return "".join("| " + " | ".join(row) + " |\n" for row in rows)


def _cell(row: Row, measure: str, form: str, scale: float = 1) -> str:
    if row[measure] is None:
        return "failed" if row["failed"] else ""
    text, spread = format(scale * row[measure], form), row.get(f"{measure}_se")
    return text if spread is None else f"{text} ± {format(scale * spread, form)}"


def _groups(some: Sequence[Case]) -> dict[tuple[str, str, str], list[Case]]:
    groups: dict[tuple[str, str, str], list[Case]] = {}
    for case in some:
        groups.setdefault((case.family, case.scenario, case.kind), []).append(case)
    for family, kind in dict.fromkeys((case.family, case.kind) for case in some):
        whole = [case for case in some if (case.family, case.kind) == (family, kind)]
        if len({case.scenario for case in whole}) > 1:
            groups[family, ALL, kind] = whole
    return groups


def _figures(rows: Sequence[Row], name: str, judged: str) -> Row:
    """Return the means of a method, and its differences from the constant force."""
    there = [row for row in rows if row["failed"] is None]
    row: Row = {}
    for measure in MEASURES:
        values = [one[measure] for one in there if one["method"] == name and one[measure] is not None]
        mean = Estimate.of(values) if values else None
        row[measure] = significant(mean.mean if mean else None)
        if measure in _SPREADS:
            row[f"{measure}_se"] = significant(mean.standard_error if mean else None, 2)
    pairs = _pairs(there, name, judged)
    gaps = pairs[:, 0] - pairs[:, 1]
    gap = Estimate.of(gaps.tolist()) if len(gaps) and name != CONSTANT else None
    return row | {
        "gap": significant(gap.mean if gap else None),
        "gap_se": significant(gap.standard_error if gap else None, 2),
        "wins": significant(float(np.mean(gaps < 0))) if gap else None,
    }


def _pairs(rows: Sequence[Row], name: str, measure: str) -> _Floats:
    """Return a measure (K, 2) of a method and of the constant force on the same sketches."""
    by_sketch: dict[tuple[str, int], dict[str, float]] = {}
    for row in rows:
        if row[measure] is not None:
            by_sketch.setdefault((row["scenario"], row["seed"]), {})[row["method"]] = row[measure]
    both = [(one[name], one[CONSTANT]) for one in by_sketch.values() if {name, CONSTANT} <= set(one)]
    return np.array(both, dtype=np.float64).reshape(-1, 2)


def _natural(store: RowStore, scenario: str) -> tuple[list[_Floats], float] | None:
    """Return looks at uncontrolled scenes, and their AUC against each other; None with too few for halves."""
    rows = (store.get(("reference", scenario, seed)) for seed in REFERENCE_SEEDS)
    looks = [np.array(row["looks"]) for row in rows if row is not None]
    return (looks, real_against_real(looks)) if len(looks) >= 2 * LEAST_SEEDS else None


def _naturalness(runs: Sequence[Row], natural: tuple[list[_Floats], float] | None) -> Row:
    looks = [np.array(run["looks"]) for run in runs if run["looks"]]
    is_valid = natural is not None and abs(natural[1] - 0.5) <= TOLERANCE and len(looks) >= LEAST_SEEDS
    found = auc(looks, natural[0]) if natural is not None and is_valid else None
    reals = None if natural is None else natural[1]
    return {"naturalness": significant(found), "naturalness_of_reals": significant(reals)}
