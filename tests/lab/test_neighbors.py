"""The benchmark of the radius graph: its rows are complete and true, whatever the machine's speed."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import ConfigError, SimulationError, radius_graph
from hybridmpm_lab.commands import cli
from hybridmpm_lab.speed import neighbors
from hybridmpm_lab.speed.baselines.loading import check_peer


def test_rows_beside_the_peer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("scipy", reason="needs SciPy: pip install 'hybridmpm[bench]'")
    monkeypatch.setattr(neighbors, "MAX_PEER_PARTICLES", 1000)
    file, chart = tmp_path / "rows.json", tmp_path / "chart.svg"
    arguments = ["--particles", "1000", "--particles", "8000", "--threads", "1", "--threads", "2"]
    command = ["neighbors", *arguments, "--repeats", "1", "--peer", "scipy"]
    result = CliRunner().invoke(cli, [*command, "--json", str(file), "--chart", str(chart)])
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    cases = [(row["dim"], row["particles"], row["threads"]) for row in rows]
    assert cases == [
        (2, 1024, 1), (2, 1024, 2), (3, 1000, 1), (3, 1000, 2),
        (2, 7921, 1), (2, 7921, 2), (3, 8000, 1), (3, 8000, 2),
    ]  # fmt: skip
    for row in rows:
        assert set(row) == {
            "dim", "particles", "radius", "edges", "threads", "ms", "ms_reused", "peer",
            "peer_ms", "ratio", "machine", "date", "commit", "command", "solver_version", "ingredients",
        }  # fmt: skip
        assert f"{row['ms']}" in result.stdout
        if row["particles"] > 2000:
            assert row["peer"] is row["peer_ms"] is row["ratio"] is None
        else:
            assert row["peer"].startswith("scipy 1.")
            assert row["ratio"] == pytest.approx(row["peer_ms"] / row["ms"], rel=0.01, abs=0.005)
    assert "SciPy" in chart.read_text()
    assert chart.with_suffix(".png").stat().st_size > 10_000


@pytest.mark.parametrize(("dim", "fewest", "most"), [(2, 17, 20), (3, 26, 32)])
def test_clouds_have_the_neighbours_of_a_simulation(dim: int, fewest: int, most: int) -> None:
    x, radius = neighbors.cloud(dim, 100_000)
    assert fewest < len(radius_graph(x, radius).senders) / len(x) < most


def test_a_peer_that_finds_other_pairs_is_refused() -> None:
    graph = radius_graph(np.array([[0, 0], [1, 0], [2, 0]], np.float32), 1.5)
    pairs = np.array([[1, 0], [1, 2]])
    neighbors._require_same_edges(graph.receivers, graph.senders, pairs)
    with pytest.raises(SimulationError, match="found 1 pairs that are not our 2"):
        neighbors._require_same_edges(graph.receivers, graph.senders, pairs[:1])


def test_a_missing_peer_is_named_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)
    result = CliRunner().invoke(cli, ["neighbors", "--peer", "scipy"])
    assert result.exit_code == 2
    assert "pip install 'hybridmpm[bench]'" in result.output
    with pytest.raises(ConfigError, match="must be scipy"):
        check_peer("other", known=(neighbors.PEER,))
