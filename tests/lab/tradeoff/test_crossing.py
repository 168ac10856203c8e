"""Networks against MPM of equal error at other resolutions and stiffnesses: cases, refusals and the table."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import scenarios
from hybridmpm.errors import ConfigError
from hybridmpm.physics.model import NeuralModel
from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED
from hybridmpm_lab.compare.crossing.cases import MANY, Case, CrossingSettings, cases
from hybridmpm_lab.compare.crossing.entrants import Enlarged, entrants

SETTINGS = CrossingSettings()


def test_cases_change_one_thing_each() -> None:
    found = cases(SETTINGS)
    assert len(found) == 2 * (4 + 3) + 2 * (3 + 3)
    for case in found:
        assert case.finer == 1 or case.compression is None
    plain = scenarios.get("water_2d", FIRST_SEED)
    fine = Case(scenario="water_2d", resolution=256).scene(FIRST_SEED)
    assert len(fine.sample().x) == pytest.approx(4 * len(plain.sample().x), rel=0.02)
    assert fine.bodies == plain.bodies
    stiff = Case(scenario="water_2d", resolution=128, compression=0.001)
    scene = stiff.scene(FIRST_SEED)
    material = scene.bodies[0].material
    compressed = material.density * scene.potential_drop / material.stiffness(scene.potential_drop)
    assert compressed == pytest.approx(0.001)
    assert stiff.stiffer(scene) == pytest.approx(13.34, abs=0.01)
    sand = Case(scenario="sand_3d", resolution=64, compression=0.001)
    assert sand.scene(FIRST_SEED).bodies[0].material.youngs_modulus == pytest.approx(14e6)
    assert sand.stiffer(sand.scene(FIRST_SEED)) == pytest.approx(14)


def test_networks_keep_the_spacing_that_they_know() -> None:
    finest = Case(scenario="water_2d", resolution=512)
    found = entrants(finest, SETTINGS, particles=170_000)
    assert found["neural fluids_2d"].r_p == pytest.approx(1 / 8 / 16)
    # Of so many only plain MPM simulates all, and coarse levels go on to as few as at the scenario's resolution.
    assert {name for name, one in found.items() if one.r_p > 0.5} == {"mpm 1"}
    assert {"coarse unfitted 1/1024", "coarse unfitted 1/2048"} < set(found)
    fewer = entrants(Case(scenario="water_2d", resolution=64), SETTINGS, particles=700)
    assert fewer["hybrid fluids_2d"].r_p == pytest.approx(1 / 2)
    assert MANY == 100_000
    with pytest.raises(ConfigError, match="no method matches mpm 1/3; there are mpm 1, mpm"):
        entrants(finest, CrossingSettings(patterns=("mpm 1/3",)), particles=170_000)


def test_an_enlarged_network_has_the_neighbours_of_its_training() -> None:
    model = NeuralModel.load("fluids_2d")
    scene = scenarios.get("water_2d", FIRST_SEED)
    side = np.arange(0.3, 0.6, 2**1.5 / 256, dtype=np.float32)
    x = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    history = np.repeat(x[None], 6, axis=0)
    types = np.full(len(x), 5, dtype=np.int64)
    known = np.tile(np.array(scene.gravity, np.float32), (len(x), 1))
    walls = np.array([[0.1, 0.1], [0.9, 0.9]], dtype=np.float32)
    moved = model.step(history, types, known, walls)
    half = Enlarged(model, 2.0).step(history / 2, types, known / 2, walls / 2)
    assert half == pytest.approx(moved / 2, abs=1e-6)


@pytest.mark.needs("ot", "metrics")
def test_runs_gather_and_networks_are_held_against_equal_errors(tmp_path: Path) -> None:
    runs, file, chart = tmp_path / "runs.jsonl", tmp_path / "rows.json", tmp_path / "chart.svg"
    names = ("mpm 1", "coarse 1/16", "coarse 1/32", "neural *")
    options = [
        "--scenario",
        "water_2d",
        "--resolution",
        "64",
        "--resolution",
        "128",
        "--compression",
        "0.005",
    ]
    options += ["--scenes", "1", "--span", "40", "--timed", "40", "--passes", "1"]
    options += [text for name in names for text in ("--entrant", name)]
    command = ["crossing", *options, "--runs", str(runs), "--json", str(file)]
    pytest.importorskip("matplotlib")
    result = CliRunner().invoke(cli, [*command, "--chart", str(chart)])
    assert result.exit_code == 0, result.output
    assert chart.with_suffix(".png").stat().st_size > 10_000
    rows = json.loads(file.read_text())
    kept = runs.read_text()
    assert CliRunner().invoke(cli, command).exit_code == 0
    assert runs.read_text() == kept
    assert json.loads(file.read_text()) == rows
    # Three cases of four methods, and the latency of the network with as many particles as cells ask for.
    assert len(rows) == 3 * 4 + 1
    for row in rows:
        assert row["error"] is None or row["error"] < 1
        assert row["as_good"] is None or row["method"] == "neural"
        assert row["error_se"] is None
    learned = [row for row in rows if row["method"] == "neural"]
    keys = ("resolution", "compression", "variant", "refused")
    assert [tuple(row[key] for key in keys) for row in learned] == [
        (64, None, None, True),
        (64, None, "latency alone", True),
        (128, None, None, False),
        (128, 0.005, None, True),
    ]
    for row in learned:
        others = [one for one in rows if all(one[key] == row[key] for key in ("resolution", "compression"))]
        level = next(one for one in others if f"{one['method']} {one['label']}" == row["as_good"])
        assert row["as_good_ms"] == level["ms_per_frame"]
        assert row["times_slower"] == pytest.approx(row["ms_per_frame"] / row["as_good_ms"], rel=1e-3)
        bar = learned[2]["error"] if row["variant"] else row["error"]
        assert level["error"] <= bar


def test_cases_that_do_not_exist_are_named() -> None:
    result = CliRunner().invoke(
        cli, ["crossing", "--scenario", "water_3d", "--resolution", "512", "--only", "errors"]
    )
    assert result.exit_code == 2
    assert "no scenario of water_3d has scenes of these resolutions" in result.output
    result = CliRunner().invoke(cli, ["crossing", "--only", "table"])
    assert result.exit_code == 2
    assert "--runs" in result.output
