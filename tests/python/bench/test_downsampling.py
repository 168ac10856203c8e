"""The rows of the benchmark of downsampling are complete, and its bounds bound."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm.bench.accuracy import downsampling
from hybridmpm.cli import cli

pytest.importorskip("ot", reason="needs POT: pip install 'hybridmpm[bench]'")


def test_rows_and_chart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(downsampling, "RATIOS", {"1": 1.0, "1/4": 1 / 4, "1/16": 1 / 16})
    file, chart = tmp_path / "rows.json", tmp_path / "chart.svg"
    arguments = ["--scenario", "water_2d", "--scenes", "2", "--frames", "40", "--repeats", "1", "--carry"]
    result = CliRunner().invoke(
        cli, ["bench", "downsampling", *arguments, "--json", str(file), "--chart", str(chart)]
    )
    assert result.exit_code == 0, result.output
    rows = {(row["method"], row["label"]): row for row in json.loads(file.read_text())}
    assert set(rows) == {("jitter", None), ("still", None)} | {
        (method, label) for method in ("mpm", "merged", "upsampled") for label in downsampling.RATIOS
    } | {("carried", "1/4"), ("carried", "1/16")}
    for (method, label), row in rows.items():
        assert (row["scenario"], row["scenes"]) == ("water_2d", 2)
        assert row["r_p"] == (None if label is None else round(downsampling.RATIOS[label], 4))
        assert (row["ms_per_frame"] is None) == (method in {"merged", "still"})
        for measure in ("grid_rmse", "grid_nrmse", "grid_node_error", "sinkhorn"):
            assert row[f"{measure}_40"] >= 0
            assert row[f"{measure}_40_se"] >= 0
        assert {"max_density_mean", "kinetic_energy_mean", "centroid_mean", "neighbours_mean"} < set(row)
        assert (row["grid_rmse_mean_difference"] is None) == ((method, label) == ("mpm", "1"))
    assert rows["merged", "1"]["grid_rmse_mean"] == 0
    ceiling = rows["still", None]["grid_rmse_mean"]
    assert all(row["grid_rmse_mean"] <= ceiling for row in rows.values())
    merged = [rows["merged", label] for label in downsampling.RATIOS]
    assert [row["particles"] for row in merged] == sorted((r["particles"] for r in merged), reverse=True)
    assert [row["grid_rmse_mean"] for row in merged] == sorted(row["grid_rmse_mean"] for row in merged)
    assert rows["mpm", "1/16"]["resolution"] == 45
    assert rows["carried", "1/16"]["resolution"] == 45
    assert rows["carried", "1/16"]["grid_rmse_mean"] < 0.8 * rows["mpm", "1/16"]["grid_rmse_mean"]
    assert rows["carried", "1/16"]["particles"] == rows["jitter", None]["particles"]
    assert rows["upsampled", "1/16"]["particles"] == rows["jitter", None]["particles"]
    options = "--scenario water_2d --scenes 2 --scenes-3d 3 --frames 40 --repeats 1"
    assert rows["mpm", "1"]["command"] == f"hybridmpm bench downsampling --carry {options}"
    assert "upsampled" in result.stdout
    assert "held still" in chart.read_text()
    assert chart.with_suffix(".png").stat().st_size > 10_000
