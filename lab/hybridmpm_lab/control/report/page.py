"""The tables of docs/results/control.md, written into it between two marks."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError
from hybridmpm_lab.control.report.aims import PAPER
from hybridmpm_lab.control.report.means import ALL, judged_by
from hybridmpm_lab.harness.rows import Row

BEGIN, END = "<!-- tables of bench control -->", "<!-- end of tables -->"
"""Lines of a page between which the tables stand."""

_UNIT = {
    "error": "final grid_rmse",
    "path_error": "distance from the way [mm]",
    "transport": "transport [mm]",
}
_WHOLE = {
    "inside": "inside",
    "inside_later": "20 frames later",
    "rms_ratio": "force over the least",
    "plan_ms": "planning [ms]",
    "first_frame_ms": "first frame [ms]",
    "total_ms": "total [ms]",
    "slowdown": "slowdown",
}
_TITLES = {"water_2d": "water 2D", "sand_2d": "sand 2D", "water_3d": "water 3D", "sand_3d": "sand 3D"}


def check_page(page: Path) -> None:
    """Raise a ConfigError unless a page has the two marks."""
    _split(page)


def fill_page(page: Path, means: Sequence[Row], aims: Sequence[Row]) -> None:
    """Write the tables of `page_tables` between the marks of a page; raises ConfigError, `ExportError`."""
    before, after = _split(page)
    with replacing(page) as part:
        part.write_text(before + page_tables(means, aims) + after, encoding="utf-8")


def page_tables(means: Sequence[Row], aims: Sequence[Row]) -> str:
    """Return tables in Markdown: origin, results by family, costs, naturalness, aims, and the paper's table.

    Parameters
    ----------
    means : rows of `means`
    aims : rows of `compared_with_aims`
    """
    families = dict.fromkeys((row["family"], row["sketch"]) for row in means)
    parts = [_origin(means), *(_results(_of(means, *one)) for one in families)]
    parts += [_costs(means), _naturalness(means), _aims(aims), _beside_the_paper(means)]
    return "\n".join(part for part in parts if part)


def _split(page: Path) -> tuple[str, str]:
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, UnicodeError) as error:
        raise ConfigError(f"{page} cannot be read: {error}") from error
    before, begin, rest = text.partition(f"{BEGIN}\n")
    _, end, after = rest.partition(f"{END}\n")
    if not begin or not end:
        raise ConfigError(
            f"{page} must hold the lines {BEGIN} and {END}, between which the tables are written"
        )
    return before + begin, end + after


def _of(means: Sequence[Row], family: str, sketch: str) -> list[Row]:
    return [row for row in means if (row["family"], row["sketch"]) == (family, sketch)]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head), *rows]]
    return "\n".join(lines) + "\n"


def _origin(means: Sequence[Row]) -> str:
    counts = {(row["count"], row["suite_count"]) for row in means if row["scenario"] != ALL}
    least = min(count for count, _ in counts)
    first = means[0]
    share = (
        "all sketches" if all(a == b for a, b in counts) else f"a part of the sketches, {least} a row or more"
    )
    return f"Measured on {share}; {first['machine']}, {first['date']}, commit {str(first['commit'])[:7]}.\n"


def _results(rows: Sequence[Row]) -> str:
    family, sketch = rows[0]["family"], rows[0]["sketch"]
    measure = judged_by(family)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    cells = {(row["scenario"], row["method"]): _figure(row, measure) for row in rows}
    body = [
        [scenario, *(cells.get((scenario, method), "") for method in methods)]
        for scenario in dict.fromkeys(row["scenario"] for row in rows)
    ]
    return _table([f"{family}, {sketch}s: {_UNIT[measure]}", *methods], body)


def _figure(row: Row, measure: str) -> str:
    value, spread = row[measure], row[f"{measure}_se"]
    if value is None:
        return "failed" if row["failed"] else ""
    scale, form = (1, ".3f") if measure == "error" else (1000, ".3g")
    text = format(scale * value, form)
    return text if spread is None else f"{text} ± {format(scale * spread, form)}"


def _costs(means: Sequence[Row]) -> str:
    families = dict.fromkeys((row["family"], row["sketch"]) for row in means)
    rows = []
    for family, sketch in families:
        mine = _of(means, family, sketch)
        scenario = mine[-1]["scenario"]  # the last one is that of all scenarios, or of the only one
        for row in mine:
            if row["scenario"] == scenario and row["rms_g"] is not None:
                figures = ["" if row[name] is None else f"{row[name]:.3g}" for name in _WHOLE]
                rows.append([f"{family}, {sketch}s", row["method"], *figures])
    return _table(["all scenarios", "method", *_WHOLE.values()], rows)


def _naturalness(means: Sequence[Row]) -> str:
    judged = [row for row in means if row["naturalness"] is not None]
    methods = list(dict.fromkeys(row["method"] for row in judged))
    rows = []
    for scenario, sketch in dict.fromkeys((row["scenario"], row["sketch"]) for row in judged):
        mine = {
            row["method"]: row for row in judged if (row["scenario"], row["sketch"]) == (scenario, sketch)
        }
        reals = next(iter(mine.values()))["naturalness_of_reals"]
        figures = [f"{mine[name]['naturalness']:.2f}" if name in mine else "" for name in methods]
        rows.append([f"{scenario}, {sketch}s", *figures, f"{reals:.2f}"])
    return _table(["naturalness", *methods, "real against real"], rows) if rows else ""


def _aims(aims: Sequence[Row]) -> str:
    rows = []
    for row in aims:
        spread = "" if row["se"] is None else f" ± {row['se']}"
        case = f"{row['scenario']}, {row['sketch']}s" + (", one body" if row["bodies"] == "1" else "")
        verdict = "met" if row["met"] else "missed"
        rows.append(
            [case, row["method"], str(row["count"]), row["aim"], f"{row['measured']}{spread}", verdict]
        )
    return _table(["reversed", "method", "sketches", "aim", "measured", ""], rows) if rows else ""


def _beside_the_paper(means: Sequence[Row]) -> str:
    there = [row for row in means if row["family"] == "reversed" and row["scenario"] in PAPER]
    by = {(row["scenario"], row["sketch"], row["method"]): row for row in there}
    settings = [name for name in PAPER if any(row["scenario"] == name for row in there)]
    if not settings:
        return ""
    rows = [
        ["paper, constant force", "nrmse", *(f"{PAPER[name][0]}" for name in settings)],
        ["paper, learned", "nrmse", *(f"{PAPER[name][1]}" for name in settings)],
        ["", "ratio", *(f"{PAPER[name][1] / PAPER[name][0]:.2f}" for name in settings)],
    ]
    for sketch, method in dict.fromkeys((row["sketch"], row["method"]) for row in there):
        mine = [by.get((name, sketch, method)) for name in settings]
        base = [by.get((name, sketch, "constant")) for name in settings]
        rows.append([f"{sketch}s, `{method}`", "nrmse", *(_nrmse(row) for row in mine)])
        if method != "constant":
            rows.append(["", "ratio", *(_ratio(row, other) for row, other in zip(mine, base, strict=True))])
    return _table(["", "", *(_TITLES[name] for name in settings)], rows)


def _nrmse(row: Row | None) -> str:
    if row is None or row["nrmse"] is None:
        return ""
    return f"{row['nrmse']:.4f}" + ("" if row["nrmse_se"] is None else f" ± {row['nrmse_se']:.4f}")


def _ratio(row: Row | None, constant: Row | None) -> str:
    if row is None or constant is None or row["error"] is None or constant["error"] is None:
        return ""
    return f"{row['error'] / constant['error']:.2f}"
