"""The rows of the benchmark of downsampling are complete, and its bounds bound."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare.coarse import ladders


def test_rows_and_chart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ratios = {"1": 1.0, "1/4": 1 / 4, "1/16": 1 / 16}
    monkeypatch.setattr(ladders, "RATIOS", ratios)
    file, chart = tmp_path / "rows.json", tmp_path / "chart.svg"
    arguments = ["--scenario", "water_2d", "--scenes", "2", "--frames", "40", "--repeats", "1"]
    result = CliRunner().invoke(cli, ["coarse", *arguments, "--json", str(file), "--chart", str(chart)])
    assert result.exit_code == 0, result.output
    rows = {(row["method"], row["label"]): row for row in json.loads(file.read_text())}
    assert set(rows) == {("jitter", None), ("still", None), ("mpm", "1")} | {
        (method, label) for method in ("merged", "mpm", "carried", "fitted") for label in ("1/4", "1/16")
    }
    for (method, label), row in rows.items():
        assert (row["scenario"], row["scenes"]) == ("water_2d", 2)
        assert row["r_p"] == (None if label is None else round(ratios[label], 4))
        assert (row["ms_per_frame"] is None) == (method in {"jitter", "still", "merged"})
        for measure in ("error", "error_40", "grid_nrmse", "grid_nrmse_40", "grid_node_error",
                        "grid_node_error_40", "kinetic_energy", "mechanical_energy", "centroid",
                        "max_density", "transport"):  # fmt: skip
            assert row[measure] >= row[f"{measure}_se"] >= 0
        assert (row["minus_mpm"] is None) == (method not in {"carried", "fitted"})
        assert (row["minus_carried"] is None) == (method != "fitted")
    ceiling = rows["still", None]
    assert all(row["error"] <= ceiling["error"] for key, row in rows.items() if key != ("mpm", "1/16"))
    assert all(row["kinetic_energy"] < ceiling["kinetic_energy"] for row in rows.values() if row != ceiling)
    for label in ("1/4", "1/16"):
        few, carried, fitted = (rows[method, label] for method in ("mpm", "carried", "fitted"))
        floor = rows["merged", label]
        assert floor["error"] < few["error"]
        # Merging moves no matter far.
        assert floor["centroid"] < 1e-5
        assert floor["transport"] < 0.5 * few["transport"]
        assert few["particles"] == carried["particles"] == fitted["particles"]
        assert carried["error"] < 0.8 * few["error"]
        assert carried["minus_mpm"] == pytest.approx(carried["error"] - few["error"], rel=1e-3)
        assert fitted["minus_carried"] == pytest.approx(fitted["error"] - carried["error"], abs=1e-3)
        assert carried["ms_shown"] > few["ms_shown"]
        assert fitted["density"] < 1.3
        assert fitted["redone"] == 0
    assert rows["mpm", "1/16"]["resolution"] == 45
    assert rows["carried", "1/16"]["resolution"] == 45
    options = "--scenario water_2d --scenes 2 --frames 40 --repeats 1"
    assert rows["mpm", "1"]["command"] == f"python -m hybridmpm_lab coarse {options}"
    assert "fitted" in result.stdout
    assert "held still" in chart.read_text()
    assert chart.with_suffix(".png").stat().st_size > 10_000
