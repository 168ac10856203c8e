"""The tables of docs/results/control.md: written between its marks, from the rows of the results."""

import json
from pathlib import Path
from typing import Any

import pytest

from hybridmpm import ConfigError
from hybridmpm_lab.control.report.page import BEGIN, END, check_page, fill_page, page_tables
from hybridmpm_lab.control.trial import MEASURES

DOCS = Path(__file__).parents[4] / "docs"
RESULTS = DOCS / "results" / "control.json"


def row(scenario: str, method: str, **figures: Any) -> dict[str, Any]:
    blank = dict.fromkeys(MEASURES) | {f"{name}_se": None for name in MEASURES}
    head = {"family": "reversed", "scenario": scenario, "sketch": "oval", "method": method, "failed": 0}
    counts = {"count": 2, "suite_count": 50, "naturalness": None, "naturalness_of_reals": None}
    return head | counts | blank | {"machine": "m", "date": "2026-01-01", "commit": "0123456789"} | figures


MEANS = [
    row("water_2d", "constant", error=1.2, error_se=0.02, nrmse=0.2, rms_g=1.0, plan_ms=800.0, slowdown=1.1),
    row("water_2d", "analytic", error=0.6, error_se=0.05, nrmse=0.1, rms_g=2.0, plan_ms=20.0, slowdown=1.2),
]
AIM = {
    "scenario": "water_2d", "sketch": "oval", "bodies": "1", "method": "analytic", "count": 2,
    "aim": "ratio 0.33", "measured": 0.336, "se": 0.03, "met": False,
}  # fmt: skip


def test_tables_hold_figures_costs_aims_and_the_papers_ratio() -> None:
    text = page_tables(MEANS, [AIM])
    assert "Measured on a part of the sketches, 2 a row or more; m, 2026-01-01, commit 0123456." in text
    assert "| water_2d | 1.200 ± 0.020 | 0.600 ± 0.050 |" in text
    assert "| reversed, ovals | analytic |  |  |  | 20 |  |  | 1.2 |" in text
    assert "| water_2d, ovals, one body | analytic | 2 | ratio 0.33 | 0.336 ± 0.03 | missed |" in text
    assert "| paper, constant force | nrmse | 0.0908 |" in text
    assert "|  | ratio | 0.88 |" in text
    assert "| ovals, `analytic` | nrmse | 0.1000 |\n|  | ratio | 0.50 |" in text


def test_what_stands_between_the_marks_is_replaced_and_nothing_else(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    for _ in range(2):
        fill_page(page, MEANS, [])
    assert page.read_text() == f"before\n{BEGIN}\n{page_tables(MEANS, [])}{END}\nafter\n"


@pytest.mark.parametrize("text", ["", f"{BEGIN}\n", f"{END}\n{BEGIN}\n"])
def test_a_page_without_marks_is_refused(tmp_path: Path, text: str) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(ConfigError, match="must hold the lines"):
        check_page(page)


def test_the_page_of_the_documentation_holds_the_tables_of_the_committed_results() -> None:
    page = DOCS / "control-bench.md"
    check_page(page)
    shown = page.read_text(encoding="utf-8").partition(f"{BEGIN}\n")[2].partition(f"{END}\n")[0]
    rows = json.loads(RESULTS.read_text()) if RESULTS.exists() else []
    # Aims are not among the rows of the results; all other tables follow from them.
    expected = page_tables(rows, []).split("\n\n") if rows else []
    assert [table for table in expected if table.strip() not in shown] == []
