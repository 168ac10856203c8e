"""docs/results/validation/failures.md names tests that exist."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_every_test_that_the_table_names_exists() -> None:
    text = (ROOT / "docs/results/validation/failures.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w/.]+)::(\w+)`", text)
    assert len(named) > 20
    for file, test in named:
        assert re.search(rf"\b(?:def|fn) {test}\b", (ROOT / file).read_text(encoding="utf-8")), (file, test)


def test_the_table_names_every_test_of_a_failure() -> None:
    text = (ROOT / "docs/results/validation/failures.md").read_text(encoding="utf-8")
    tests = {
        name
        for file in (ROOT / "tests/python/failures").glob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert {name for name in tests if name not in text} <= {
        "test_obstacles_of_two_cells_are_not_warned_of",
        "test_scenarios_have_no_thin_obstacle",
    }
