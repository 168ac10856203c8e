"""Cost of the sums of forces on walls and obstacles."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from hybridmpm import MpmSolver, scenarios
from hybridmpm_lab.harness.command import Measurement, measured, scenarios_setting, setting
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns

_RUN_UP = 60  # frames before the measurement: most bodies have hit the floor by then
_FRAMES = 4  # of one timing


@dataclass(frozen=True, kw_only=True)
class ForcesSettings:
    """Scenes in mid-splash, and the settings of the measurement."""

    scenario: tuple[str, ...] = scenarios_setting(
        ("water_2d", "sand_2d", "water_ramps_2d", "water_3d", "sand_3d")
    )
    repeats: int = setting(1500, "Number of timings of each.", low=1, high=100_000)

    @property
    def steps(self) -> int:
        """Number of rows."""
        return len(self.scenario)


def measure(settings: ForcesSettings, on_progress: Progress) -> Iterator[Row]:
    """Time the same frames with and without sums of forces, by turns; yield a row for each scene."""
    for name in settings.scenario:
        without = MpmSolver(scenarios.get(name, 7), substeps="reference")
        without.advance(_RUN_UP)
        summing = without.copy()
        summing.keep_forces()
        start = without.snapshot()
        calls = [
            TimedCall(prepare=partial(solver.restore, start), call=partial(solver.advance, _FRAMES))
            for solver in (without, summing)
        ]
        times = seconds_by_turns(calls, settings.repeats)
        before, after = (1e3 * float(np.percentile(each, 25)) / _FRAMES for each in times)
        yield {
            "scene": name,
            "particles": without.particle_count,
            "ms_per_frame": round(before, 4),
            "with_forces": round(after, 4),
            "cost": round(after / before - 1, 4),
        }
        on_progress(1)


forces = Measurement(
    name="forces",
    settings=ForcesSettings,
    measure=measured(measure),
    columns=("scene", "particles", "ms_per_frame", "with_forces", "cost"),
    summary="Time frames with and without the sums of forces on walls and obstacles, by turns.",
).command()
