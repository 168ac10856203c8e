"""Speed of pages that play in Chromium, beside the native solver on one thread."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from hybridmpm import MpmSolver, Scene, play, scenarios
from hybridmpm_lab.harness.browser import launched
from hybridmpm_lab.harness.command import Measurement, measured, scenarios_setting, setting
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns
from hybridmpm_service.site import scene_of

_RUN_UP = 120  # frames before the measurement: most bodies have hit the floor by then
_FRAMES = 20  # of one timing
_DAM = "dam-in-space"
_COUNT_PICTURES = """() => {
  const put = pen.putImageData.bind(pen);
  window.pictures = 0;
  pen.putImageData = (...given) => { window.pictures += 1; put(...given); };
}"""
_PLAY = """async (seconds) => {
  const [began, pictures, frame] = [performance.now(), window.pictures, state.frame];
  play();
  await new Promise((done) => setTimeout(done, 1000 * seconds));
  const took = (performance.now() - began) / 1000;
  pause();
  return [(window.pictures - pictures) / took, ((state.frame - frame) * frameDt) / took];
}"""
_ADVANCE = """async (frames) => (await ask("advance", { frames, hand: null, wanted: "speed" })).took / 1000"""


@dataclass(frozen=True, kw_only=True)
class PlayingSettings:
    """Scenes in mid-splash, and the settings of the measurement."""

    scenario: tuple[str, ...] = scenarios_setting(("water_2d", "sand_2d", "water_3d", "sand_3d"))
    coarse: tuple[str, ...] = setting(("1/16",), "Coarse level of the gallery's dam in space.", str)
    seconds: int = setting(10, "Seconds for which a page plays.", low=1, high=600)
    repeats: int = setting(15, "Number of timings of each.", low=1, high=1000)

    @property
    def scenes(self) -> list[tuple[str, Scene, str | None]]:
        """Names, scenes and coarse levels."""
        alone = [(name, scenarios.get(name, 3), None) for name in self.scenario]
        return [*alone, *((_DAM, scene_of(_DAM), level) for level in self.coarse)]

    @property
    def steps(self) -> int:
        """Number of rows."""
        return len(self.scenario) + len(self.coarse)


def measure(settings: PlayingSettings, on_progress: Progress) -> Iterator[Row]:
    """Time frames of page and native solver by turns, then let the page play; yield a row for each scene.

    Raises
    ------
    ConfigError
        There is no Chromium.
    """
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = launched(playwright)
        for name, scene, level in settings.scenes:
            file = Path(folder) / f"{name}.html"
            solver = MpmSolver(scene, coarse=level)
            solver.advance(_RUN_UP)
            play(solver, file)
            page = browser.new_page(reduced_motion="reduce", viewport={"width": 900, "height": 700})
            page.goto(file.as_uri())
            page.wait_for_function("() => document.body.dataset.ready === 'true'")
            yield {
                "scene": name,
                "coarse": level,
                **_timed(solver, page, settings),
                "bytes": file.stat().st_size,
            }
            page.close()
            on_progress(1)
        browser.close()


def page_calls(solver: MpmSolver, page: Page, frames: int) -> list[TimedCall]:
    """Return calls that advance a solver, and the page that plays it, from the same state."""
    start = solver.snapshot()
    return [
        TimedCall(prepare=partial(solver.restore, start), call=partial(solver.advance, frames)),
        TimedCall(
            prepare=partial(page.evaluate, "async () => await ask('reset', { wanted: 'speed' })"),
            call=lambda: float(page.evaluate(_ADVANCE, frames)),
        ),
    ]


def _timed(solver: MpmSolver, page: Page, settings: PlayingSettings) -> Row:
    times = seconds_by_turns(page_calls(solver, page, _FRAMES), settings.repeats)
    native, mine = (1e3 * float(np.percentile(each, 25)) / _FRAMES for each in times)
    page.evaluate("async () => await advance(0)")
    page.evaluate(_COUNT_PICTURES)
    page.select_option("#speed", "0.25" if solver.coarse else "1")
    pictures, share = page.evaluate(_PLAY, settings.seconds)
    return {
        "particles": solver.particle_count,
        "native_ms_per_frame": round(native, 3),
        "page_ms_per_frame": round(mine, 3),
        "ratio": round(mine / native, 2),
        "pictures_per_second": round(pictures, 1),
        "share_of_real_time": round(share, 3),
    }


playing = Measurement(
    name="playing",
    settings=PlayingSettings,
    measure=measured(measure),
    columns=(
        "scene", "coarse", "particles", "native_ms_per_frame", "page_ms_per_frame", "ratio",
        "pictures_per_second", "share_of_real_time", "bytes",
    ),
    summary="""Time pages that play in Chromium beside the native solver on one thread, in mid-splash.

    Pages then play in real time, in coarse mode at a quarter of it: pictures a second, and the share of real
    time that was reached.""",
).command()  # fmt: skip
