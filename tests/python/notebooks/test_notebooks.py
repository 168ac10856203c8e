"""The notebooks of docs/guide/notebooks run as they stand, and show what their files show."""

import json
from pathlib import Path
from typing import Any

import pytest
from tests.python.notebooks import runner

NOTEBOOKS = sorted(runner.FOLDER.glob("*.ipynb"))


def shown(notebook: dict[str, Any]) -> list[list[tuple[str, list[str]]]]:
    """Return for each cell the kinds of its outputs, with their media types."""
    return [
        [(output["output_type"], sorted(output.get("data", {}))) for output in cell.get("outputs", [])]
        for cell in notebook["cells"]
    ]


def test_there_are_three() -> None:
    assert [path.stem for path in NOTEBOOKS] == [
        "first-steps",
        "speed-against-accuracy",
        "steering-by-a-sketch",
    ]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_runs_and_shows_what_its_file_shows(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Times in their texts, and with them the charts, differ from machine to machine."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    stored = json.loads(path.read_text(encoding="utf-8"))
    assert shown(runner.run(path)) == shown(stored)
    assert path.stat().st_size < 600_000


def test_links_lead_somewhere() -> None:
    for path in NOTEBOOKS:
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            text = "".join(cell["source"]) if cell["cell_type"] == "markdown" else ""
            targets = [part.split(")")[0] for part in text.split("](")[1:]]
            assert all((path.parent / target).is_file() for target in targets), (path.name, targets)
