"""The stability limit: the default step keeps its distance, and the sweep says what it found."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import ConfigError, _native
from hybridmpm_lab.commands import cli
from hybridmpm_lab.stability import stability
from hybridmpm_lab.stability.stability import Case

MARGIN = 1.5
FIELDS = {
    "method", "material", "dim", "stress", "level", "outcome", "signalled",
    "machine", "date", "commit", "command", "solver_version", "ingredients",
}  # fmt: skip


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("material", stability.MATERIALS)
@pytest.mark.parametrize("stress", stability.CRITICAL)
def test_the_default_step_is_far_below_the_limit(material: str, stress: str, dim: int) -> None:
    level = MARGIN * stability.material(material).default_cfl
    assert stability.run(Case(material, dim, stress, level)) == ("survived", None)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("material", stability.MATERIALS)
@pytest.mark.parametrize("stress", stability.STRESSES)
def test_the_default_step_is_survived(material: str, stress: str, dim: int) -> None:
    level = stability.material(material).default_cfl
    assert stability.run(Case(material, dim, stress, level)) == ("survived", None)


def test_rows_table_and_chart(tmp_path: Path) -> None:
    rows_file, picture = tmp_path / "rows.json", tmp_path / "map.svg"
    command = ["stability", "--level", "1.2", "--level", "0.4"]
    result = CliRunner().invoke(cli, [*command, "--json", str(rows_file), "--chart", str(picture)])
    assert result.exit_code == 0, result.output
    rows = json.loads(rows_file.read_text())
    assert len(rows) == 2 * len(stability.STRESSES) * len(stability.MATERIALS) * 2
    assert {frozenset(row) for row in rows} == {frozenset(FIELDS)}
    assert {row["method"] for row in rows} == {"mpm"}
    assert rows[0]["command"] == "python -m hybridmpm_lab stability --level 1.2 --level 0.4"
    for row in rows:
        if row["level"] == 1.2:
            assert row["signalled"] == "StepSizeError"
        else:
            assert (row["outcome"] == "failed") == (row["signalled"] is not None)
    water = {row["level"]: row["outcome"] for row in rows if _key(row) == ("water", 2, "alone")}
    assert water == {0.4: "survived", 1.2: "failed"}
    assert "water    2D  alone            .F" in result.stdout
    assert "water 2D is stable up to CFL 0.4, 0.89 times the default" in result.stdout
    assert picture.read_text().count("water 2D") > 0
    assert picture.with_suffix(".png").stat().st_size > 10_000


def _key(row: dict[str, Any]) -> tuple[str, int, str]:
    return row["material"], row["dim"], row["stress"]


def test_a_folder_that_does_not_exist_is_named_before_anything_runs(tmp_path: Path) -> None:
    for option in ("--json", "--chart"):
        result = CliRunner().invoke(cli, ["stability", option, str(tmp_path / "no" / "file")])
        assert result.exit_code == 2
        assert f"{option}: the folder {tmp_path / 'no'} does not exist" in result.output


def test_limits_stop_at_the_first_level_that_does_not_survive() -> None:
    outcomes = {0.2: "survived", 0.3: "degraded", 0.4: "survived"}
    rows = [
        {"material": "sand", "dim": 2, "stress": stress, "level": level, "outcome": outcome}
        for stress in stability.CRITICAL
        for level, outcome in outcomes.items()
    ]
    assert stability.limits(rows) == {("sand", 2): 0.2}
    hopeless = [dict(row, outcome="failed") for row in rows]
    assert stability.limits(hopeless) == {("sand", 2): 0.0}


def test_the_signal_speed_is_that_of_the_core() -> None:
    water = _native.Material.water(density=1000.0, bulk_modulus=8000.0)
    assert [water.signal_speed(dim) for dim in (2, 3)] == pytest.approx([4.0, np.sqrt(24.0)])
    with pytest.raises(ConfigError, match="dim must be 2 or 3, got 4"):
        water.signal_speed(4)
