"""Means over the sketches of each family, scenario and kind, their tables, and their chart."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
import numpy.typing as npt

from hybridmpm.cli.progress import progress
from hybridmpm_lab.control.measures import LEAST_SEEDS, recognised
from hybridmpm_lab.control.methods import CONSTANT, FILLED, NAMES, ORACLE, Methods
from hybridmpm_lab.control.runner import (
    MEASURES,
    ControlSettings,
    count_missing,
    rows_of,
    run_key,
    run_missing,
    run_store,
)
from hybridmpm_lab.control.suite import Case, cases
from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.command import Measurement, runs_option
from hybridmpm_lab.harness.provenance import ORIGIN, Provenance
from hybridmpm_lab.harness.rows import Row, RowStore, mean_fields, significant

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
_UNIT = {
    "error": "final grid_rmse",
    "path_error": "distance from the path [mm]",
    "transport": "transport [mm]",
}
_LABELS = {
    "error": "final grid_rmse",
    "path_error": "distance from the path [m]",
    "transport": "transport distance [m]",
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
    rows = []
    for (family, scenario, kind), group in _groups(some).items():
        found = rows_of(group, methods, store)
        scenarios = {case.scenario for case in group}
        whole = len([case for case in cases([family], scenarios) if case.kind == kind])
        for name in dict.fromkeys(row["method"] for row in found):
            mine = [row for row in found if row["method"] == name]
            used = {word for row in mine for word in (row["ingredients"] or "").split()}
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
                    "naturalness": None if scenario == ALL else _naturalness(store, group, name),
                    **{field: mine[0][field] for field in ORIGIN},
                    "ingredients": " ".join(sorted(used)) or None,
                }
            )
    return rows


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
    parts += [_table("all scenarios", costs), _table("naturalness", natural)]
    return "\n".join(
        part for part in [*parts, _table("reversed: nrmse (ratio)", _beside_paper(rows))] if part
    )


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
        found = mean_fields(measure, (one[measure] for one in there if one["method"] == name), 2)
        row |= found if measure in _SPREADS else {measure: found[measure]}
    pairs = _pairs(there, name, judged)
    gaps = (pairs[:, 0] - pairs[:, 1]).tolist() if name != CONSTANT else []
    wins = significant(float(np.mean(np.array(gaps) < 0))) if gaps else None
    return row | mean_fields("gap", gaps, 2) | {"wins": wins}


def _pairs(rows: Sequence[Row], name: str, measure: str) -> _Floats:
    """Return a measure (K, 2) of a method and of the constant force on the same sketches."""
    by_sketch: dict[tuple[str, int], dict[str, float]] = {}
    for row in rows:
        if row[measure] is not None:
            by_sketch.setdefault((row["scenario"], row["seed"]), {})[row["method"]] = row[measure]
    both = [(one[name], one[CONSTANT]) for one in by_sketch.values() if {name, CONSTANT} <= set(one)]
    return np.array(both, dtype=np.float64).reshape(-1, 2)


def _naturalness(store: RowStore, group: Sequence[Case], name: str) -> float | None:
    """Return the share of a method's frames that are told from the oracle's; None with too few seeds."""
    led, true = [], []
    for case in group:
        found, oracle = (store.get(run_key(case, method)) for method in (name, ORACLE))
        if found and oracle and found["looks"] and oracle["looks"]:
            led.append(np.array(found["looks"]))
            true.append(np.array(oracle["looks"]))
    return significant(recognised(led, true)) if name != ORACLE and len(led) >= LEAST_SEEDS else None


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw a panel for each family and kind of sketch, as SVG and PNG; raises as `charts` does.

    Small points are the means of single scenarios, large ones those of all sketches. A dotted line is the
    perfectly filled sketch in the reversed family. The error is that of `judged_by`.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["family"], row["sketch"]), []).append(row)
    methods = dict.fromkeys(row["method"] for row in rows if row["method"] != FILLED)
    ordered = sorted(methods, key=lambda name: NAMES.index(name) if name in NAMES else len(NAMES))
    columns = min(3, len(groups))
    figure, axes = charts.panels(columns, -(-len(groups) // columns), width=4.2, height=3.3)
    for panel in axes.flat[len(groups) :]:
        panel.set_visible(False)
    for ((family, kind), group), panel in zip(groups.items(), axes.flat, strict=False):
        measure = judged_by(family)
        for index, method in enumerate(ordered):
            _draw(panel, [row for row in group if row["method"] == method], measure, index)
        panel.set(
            xscale="log", title=f"{family}, {kind}s", xlabel="planning time [ms]", ylabel=_LABELS[measure]
        )
        charts.plain_log_ticks(panel.xaxis)
        if measure == "error":
            for row in [row for row in group if row["method"] == FILLED][-1:]:
                panel.axhline(row[measure], color="#333333", linestyle=":", label="sketch perfectly filled")
            panel.set(ylim=(0, 1.05 * panel.get_ylim()[1]))
        else:
            panel.set(yscale="log")
            charts.plain_log_ticks(panel.yaxis)
    entries = charts.entries(axes)
    columns = min(3, axes.shape[1])
    figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=columns, fontsize=8)
    charts.save(figure, file)


def _draw(panel: Any, rows: Sequence[Row], measure: str, index: int) -> None:
    """Draw one method; colour and marker follow from its index."""
    points = [row for row in rows if row[measure] is not None and row["plan_ms"] is not None]
    colours, markers = charts.COLOURS, charts.MARKERS
    colour = colours[index % len(colours)]
    marker = markers[(index + index // len(colours)) % len(markers)]
    for row in points:
        look: Row = {"markersize": 4, "alpha": 0.45}
        if row["scenario"] == ALL or len(points) == 1:
            look = {"markersize": 9, "zorder": 3, "label": row["method"]}
        at = [row["plan_ms"]], [row[measure]], [row[f"{measure}_se"] or 0.0]
        panel.errorbar(*at, color=colour, marker=marker, linestyle="", **look)


def _measure(settings: ControlSettings, origin: Provenance, runs_file: Path | None) -> list[Row]:
    store = run_store(runs_file)
    with progress("Measuring", count_missing(settings, store)) as bar:
        run_missing(settings, store, origin, bar.update)
    return means(store, settings.cases, settings.methods)


control = Measurement(
    name="control",
    settings=ControlSettings,
    measure=_measure,
    draw=chart,
    show=lambda rows: click.echo(tables(rows)),
    options=(runs_option,),
    summary="""Compare methods of control on a fixed suite of sketches.

    The families are: states that are led back to where they came from (reversed), free ovals, bent arrows,
    ovals behind obstacles, fluid in pieces that is to be gathered, ovals and arrows as a hand draws them,
    shapes, and three goals in turn.
    With --runs an interrupted command is resumed.
    """,
).command()
