"""The benches of the hybrid: rows, and what must hold of them whatever the machine."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm.bench.hybrid import handoff, hybrid, safeguard, safeguard_chart
from hybridmpm.bench.hybrid.guard_values import PLAIN
from hybridmpm.bench.hybrid.rank_correlations import rank_correlations
from hybridmpm.cli import cli


def ignore(_: int) -> None:
    pass


def test_the_safeguard_is_measured(tmp_path: Path) -> None:
    settings = safeguard.SafeguardSettings(model="zero", scenarios=("sand_2d",), scenes=1, frames=60)
    rows = list(safeguard.measure(settings, ignore))
    assert {row["part"] for row in rows} == {"cost", "point", "correlation", "delay", "false alarms"}
    json.dumps(rows)
    costs = [row for row in rows if row["part"] == "cost"]
    assert all(row["us_per_frame"] > 0 for row in costs)
    alarms = {row["guard"]: row["alarms"] for row in rows if row["part"] == "false alarms"}
    # The plain mean takes what trembles at rest for complex motion.
    assert alarms.pop(PLAIN) > 90
    assert set(alarms.values()) == {0}
    delays = {(row["event"], row["guard"]): row["delay"] for row in rows if row["part"] == "delay"}
    assert delays["bodies on the floor", "cosine"] <= 3
    for event in ("bodies on the floor", *safeguard.DROPS):
        noticed = [delays[event, guard] for guard in ("cosine", "impact") if delays[event, guard] is not None]
        assert min(noticed) <= 5
    pytest.importorskip("matplotlib")
    safeguard_chart.chart(rows, tmp_path / "safeguard.svg")
    assert (tmp_path / "safeguard.png").stat().st_size > 10_000


def test_a_correlation_apart_from_time() -> None:
    draws = np.random.default_rng(0)
    frame, told = np.arange(500.0), draws.normal(size=500)
    # Both grow with time, and have nothing else in common.
    whole, partial = rank_correlations(frame, frame + 50 * draws.normal(size=500), frame + 50 * told)
    assert (whole, partial) == (pytest.approx(0.9, abs=0.1), pytest.approx(0, abs=0.15))
    # The value goes with the error also at equal times.
    whole, partial = rank_correlations(frame, told, frame + 50 * told)
    assert (whole, partial) == (pytest.approx(0.35, abs=0.15), pytest.approx(1, abs=0.1))
    assert rank_correlations(frame, 2 * frame, frame + told)[1] is None
    assert rank_correlations(frame, np.ones(500), told) == (None, None)


# The others are its long twins: a fall takes 3000 frames until all is at rest.
@pytest.mark.parametrize(
    "material",
    ["water", *(pytest.param(name, marks=pytest.mark.long) for name in handoff.MATERIALS if name != "water")],
)
def test_a_warm_handoff_is_gentler_than_a_cold_one(tmp_path: Path, material: str) -> None:
    rows = list(handoff.measure(ignore, [material]))
    assert len(rows) == handoff.COUNT / len(handoff.MATERIALS)
    shock = {(row["material"], row["phase"], row["handoff"]): row for row in rows}
    for phase in handoff.PHASES:
        warm, cold = (shock[material, phase, kind] for kind in ("warm", "cold"))
        for after in handoff.AFTER:
            assert warm[f"grid_{after}"] <= 1.01 * cold[f"grid_{after}"]
        jumps = [abs(one["acceleration"] - one["acceleration_mpm"]) for one in (warm, cold)]
        assert jumps[0] <= jumps[1] + 1e-3
    pytest.importorskip("matplotlib")
    handoff.chart(rows, tmp_path / "handoff.svg")
    assert (tmp_path / "handoff.png").stat().st_size > 10_000


def test_a_rollout_is_followed(tmp_path: Path) -> None:
    settings = hybrid.HybridSettings(model="zero", frames=120)
    rows = list(hybrid.measure(settings, ignore))
    last = {row["method"]: row for row in rows if row["frame"] == 120}
    assert last["hybrid"]["error"] <= 1.1 * last["mpm"]["error"] < last["neural"]["error"]
    assert last["hybrid"]["mode"] == "mpm"
    modes = [row["mode"] for row in rows if row["method"] == "hybrid"]
    assert modes.count("neural") == pytest.approx((1 - last["hybrid"]["mpm_share"]) * 24, abs=1)
    pytest.importorskip("matplotlib")
    hybrid.chart(rows, tmp_path / "hybrid.svg")
    assert (tmp_path / "hybrid.png").stat().st_size > 10_000


def test_the_command_line_measures(tmp_path: Path) -> None:
    target = tmp_path / "rows.json"
    words = ["bench", "hybrid", "--model", "zero", "--frames", "60", "--json", str(target)]
    done = CliRunner().invoke(cli, words, prog_name="hybridmpm")
    assert done.exit_code == 0, done.output
    rows = json.loads(target.read_text())
    assert rows[0]["command"].startswith("hybridmpm bench hybrid --model zero --scenario water_2d")
    assert "network" not in done.output
    assert done.output.count("hybrid") >= 2
