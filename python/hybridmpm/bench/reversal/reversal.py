"""Reversed cases of control, on seeds that nothing was tuned on: error by cap, and the paper's smoothing."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hybridmpm._support import charts
from hybridmpm.bench.report.rows import Progress, Row, significant
from hybridmpm.control import Oracle, ReversedCase, follow, reversed_from_seed
from hybridmpm.control.reversal import STARTS, Start, step_cosines
from hybridmpm.data.splits import FIRST_TEST
from hybridmpm.metrics import Estimate

SCENARIOS = ("water_2d", "sand_2d", "water_3d", "sand_3d")
"""The paper's four settings."""
CAPS = (7.5, 15.0, 30.0, 60.0, 120.0)
"""Largest forces on a particle [g]."""
CAP = 30.0
"""The cap at which both starts, the smoothed forces and the cosines are measured [g]."""
GOOD = 0.15
"""Grid RMSE within which the true end counts as reached."""
_EVERY = 3
"""Frames from one row of cosines to the next."""


@dataclass(frozen=True, kw_only=True)
class ReversalSettings:
    """What to measure."""

    scenarios: tuple[str, ...] = SCENARIOS
    seeds: int = 24
    """Number of seeds of each scenario, from 1.1 * 10^6 on."""
    frames: int = 100
    """Frames of control."""

    @property
    def count(self) -> int:
        """Number of controlled runs."""
        return len(self.scenarios) * self.seeds * (len(STARTS) + len(CAPS) - 1)


@dataclass(frozen=True)
class _Run:
    seed: int
    error: float
    peak: float
    rms: float
    more: dict[str, float]


def measure(settings: ReversalSettings, on_progress: Progress) -> Iterator[Row]:
    """Make the cases, and yield two kinds of rows, told by `part`.

    "error": for each scenario, start and cap the mean grid RMSE between the end and the true end with its
    standard error, the largest and its seed, the share of seeds within `GOOD`, mean peak and rms of the force
    [g]; at 30 g also the error of the smoothed forces, which are played back, that of no force, and the
    seconds of a case. "cosine": the mean cosine between the forces of a frame and the next, before and after
    smoothing, with live starts. `on_progress` counts runs.
    """
    for scenario in settings.scenarios:
        runs: dict[tuple[Start, float], list[_Run]] = {}
        cosines = []
        for seed in range(FIRST_TEST, FIRST_TEST + settings.seeds):
            for start in STARTS:
                began = time.perf_counter()
                case = reversed_from_seed(
                    scenario, seed, frames=settings.frames, start=start, kind="oval", cap=CAP
                )
                seconds = time.perf_counter() - began
                on_progress(1)
                runs.setdefault((start, CAP), []).append(_made(case, seed, seconds))
                if start == "live":
                    cosines.append([step_cosines(f).mean(axis=1) for f in _forces(case)])
                    for cap in CAPS:
                        if cap != CAP:
                            runs.setdefault((start, cap), []).append(_led(case, seed, cap))
                            on_progress(1)
        for start, cap in sorted(runs):
            yield {
                "part": "error",
                "scenario": scenario,
                "start": start,
                "cap": cap,
                **_row(runs[start, cap]),
            }
        yield from _cosine_rows(scenario, np.mean(cosines, axis=0))


def _forces(case: ReversedCase) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    return case.forces, case.smoothed_forces


def _made(case: ReversedCase, seed: int, seconds: float) -> _Run:
    smoothed = case.simulator().rollout(case.frames, case.smoothed_forces)[-1]
    unforced = case.simulator().rollout(case.frames)[-1]
    before, after = (float(step_cosines(forces).mean()) for forces in _forces(case))
    more = {
        "error_smoothed": case.error(smoothed),
        "error_unforced": case.error(unforced),
        "cosine": before,
        "cosine_smoothed": after,
        "seconds": seconds,
    }
    return _Run(seed, case.error(case.positions[-1]), case.peak, case.rms, more)


def _led(case: ReversedCase, seed: int, cap: float) -> _Run:
    result = follow(case.simulator(), case.sketch, Oracle(case), frames=case.frames, cap=cap).run()
    return _Run(seed, case.error(result.positions[-1]), result.reached.peak, result.reached.rms, {})


def _row(runs: Sequence[_Run]) -> Row:
    errors = Estimate.of([run.error for run in runs])
    worst = max(runs, key=lambda run: run.error)
    row = {
        "seeds": len(runs),
        "error": errors.mean,
        "error_se": errors.standard_error,
        "share_good": float(np.mean([run.error <= GOOD for run in runs])),
        "worst": worst.error,
        "peak": float(np.mean([run.peak for run in runs])),
        "rms": float(np.mean([run.rms for run in runs])),
        **{key: float(np.mean([run.more[key] for run in runs])) for key in worst.more},
    }
    return {key: significant(value) for key, value in row.items()} | {"worst_seed": worst.seed}


def _cosine_rows(scenario: str, cosines: npt.NDArray[np.float64]) -> Iterator[Row]:
    before, after = cosines
    for frame in range(0, len(before), _EVERY):
        yield {
            "part": "cosine",
            "scenario": scenario,
            "start": "live",
            "frame": frame,
            "before": significant(float(before[frame])),
            "after": significant(float(after[frame])),
        }


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the step-wise cosine before and after smoothing, and the error against the cap; SVG and PNG."""
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    figure, axes = charts.panels(len(names), 2, width=3.1, height=2.6)
    for column, name in enumerate(names):
        cosines = [row for row in rows if row["part"] == "cosine" and row["scenario"] == name]
        panel = axes[0][column]
        frames = [row["frame"] for row in cosines]
        for index, key in enumerate(("before", "after")):
            values = [row[key] for row in cosines]
            panel.plot(frames, values, color=charts.COLOURS[index], label=f"{key} smoothing")
        panel.set(title=name, xlabel="frame of control", ylim=(None, 1.0))
        errors = [
            row
            for row in rows
            if row["part"] == "error" and row["scenario"] == name and row["start"] == "live"
        ]
        panel = axes[1][column]
        panel.errorbar(
            [row["cap"] for row in errors],
            [row["error"] for row in errors],
            [row["error_se"] or 0.0 for row in errors],
            marker=charts.MARKERS[2],
            color=charts.COLOURS[2],
        )
        panel.axhline(GOOD, color="0.5", linestyle="--", linewidth=1)
        panel.set(xscale="log", xlabel="cap [g]", ylim=(0, None))
        charts.plain_log_ticks(panel.xaxis)
    axes[0][0].set_ylabel("mean cosine between\nforces of successive frames")
    axes[1][0].set_ylabel("error at the end (grid RMSE)")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    charts.save(figure, file)
