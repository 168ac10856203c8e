"""Results are stale when a file that their benchmark needs has changed since, and only then."""

import json
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm.bench.report import stale
from hybridmpm.cli import cli


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a repository with a needed file, one that is not, and results of its first commit."""
    for variable in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"):
        monkeypatch.delenv(variable, raising=False)
    git(tmp_path, "init", "-q")
    for name in ("needed.py", "other.py"):
        (tmp_path / name).write_text("1\n")
    commit(tmp_path)
    row = {"commit": git(tmp_path, "rev-parse", "HEAD") + "-dirty"}
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "mine.json").write_text(json.dumps([row, row]))
    monkeypatch.setattr(stale, "sources", lambda _module: {tmp_path / "needed.py"})
    return tmp_path


def git(folder: Path, *arguments: str) -> str:
    run = subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True, text=True)
    return run.stdout.strip()


def commit(folder: Path) -> None:
    git(folder, "add", ".")
    git(folder, "-c", "user.name=n", "-c", "user.email=e", "commit", "-qm", "m")


def invoke(folder: Path) -> tuple[int, str]:
    result = CliRunner().invoke(cli, ["bench", "--stale", "--results", str(folder)])
    return result.exit_code, result.output


def test_a_change_makes_results_stale(checkout: Path) -> None:
    folder = checkout / "results"
    assert invoke(folder) == (0, "all 1 results are those of the present code\n")
    (checkout / "other.py").write_text("2\n")
    assert stale.results(folder)[0].changed == ()
    (checkout / "needed.py").write_text("2\n")
    code, text = invoke(folder)
    assert code == 0
    assert text.startswith("mine.json: since ")
    assert text.endswith(" changed needed.py\n")
    commit(checkout)
    assert stale.results(folder)[0].changed == ("needed.py",)


def test_what_a_benchmark_needs() -> None:
    names = {path.name for path in stale.sources("hybridmpm.bench.accuracy.downsampling")}
    assert {"downsampling.py", "timing.py", "solver.py", "grid.py", "scenarios.py", "recording.py"} < names
    assert any(name.startswith("_native") for name in names)
    assert names.isdisjoint({"__init__.py", "provenance.py", "charts.py", "doctor.py", "follow.py"})
    assert "graph_network.py" in {path.name for path in stale.sources("hybridmpm.bench.sweep.sweep")}
    assert stale.sources("hybridmpm.bench.nothing") == set()


def test_bad_input_is_named(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    file = checkout / "results" / "mine.json"
    file.write_text(json.dumps([{"commit": "0" * 40}]))
    code, text = invoke(file.parent)
    assert code == 2
    assert "run this in a checkout with its history" in text
    file.write_text("[{}]")
    code, text = invoke(file.parent)
    assert code == 2
    assert "mine.json is damaged, or a row of it names no commit" in text
    code, text = invoke(checkout / "absent")
    assert code == 2
    assert "there is no folder" in text
    outside = tmp_path_factory.mktemp("outside")
    code, text = invoke(outside)
    assert code == 2
    assert "run this in a checkout" in text


def test_without_a_command_there_is_help() -> None:
    result = CliRunner().invoke(cli, ["bench"])
    assert result.exit_code == 0
    assert "--stale" in result.output
