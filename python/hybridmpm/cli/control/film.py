"""Pictures of a run with a sketch: the sketch over the particles, and a caption with the simulator."""

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from hybridmpm.cli.control.run import ControlRun
from hybridmpm.control.sketch.render import render
from hybridmpm.export.ink import Picture, with_sketch
from hybridmpm.render import view_of

_COLOURS = {"mpm": (255, 209, 102), "neural": (88, 185, 255)}
"""Colours of MPM and network, as on the page."""
_TEXT, _SHADE = (232, 238, 246), (10, 15, 22)
_LINES = 24
"""Lines of text that a picture is high."""


class ControlFilm:
    """Draws states of a run, as a `hybridmpm.render.View` does.

    The sketch is visible from the frame at which it was drawn to the last frame that it leads.
    In 3D it lies on a small front view in a corner.

    Parameters
    ----------
    run : ControlRun
    width : int in [64, 4096]
        Width of the pictures [pixels].
    """

    def __init__(self, run: ControlRun, width: int) -> None:
        recording = run.recording
        self._run, self._scene = run, recording.scene
        self._view = view_of(recording.scene, recording.types, width, recording.spacing)
        self._rasters: dict[int, Picture] = {}
        self._by = run.simulated_by
        self._frame_dt = recording.scene.frame_dt

    def draw(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        time: float = 0.0,
        rigid: npt.NDArray[np.float64] | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Draw particles at `x` (N, D) [m] with velocities `v` (N, D) [m/s]; see `View.draw`."""
        picture = self._view.draw(x, v, time, rigid)
        frame = round(time / self._frame_dt)
        if self._run.first <= frame <= self._run.last:
            picture = with_sketch(picture, self._raster(self._run.number_at(frame)), self._scene)
        return self._with_caption(picture, frame)

    def _raster(self, number: int) -> Picture:
        """Return the picture of the sketch of a number among those that are followed in turn."""
        if number not in self._rasters:
            self._rasters[number] = render(self._run.sketches[number], self._scene.size)
        return self._rasters[number]

    def _with_caption(self, picture: Picture, frame: int) -> Picture:
        line = picture.shape[0] / _LINES
        font = ImageFont.load_default(size=max(8.0, 0.75 * line))
        # Frame 0 is the initial state; its caption names the simulator of frame 1.
        by = self._by[max(frame, 1) - 1]
        led = self._run.first < frame <= self._run.last
        name = self._run.name(by)
        text = f"{name}, led by the sketch" if led else name
        image = Image.fromarray(picture)
        pen = ImageDraw.Draw(image)
        left, top = 1.4 * line, 1.4 * line
        wide = max(pen.textlength(part, font) for part in (text, f"frame {frame}"))
        pen.rounded_rectangle(
            (left - 0.4 * line, top - 0.3 * line, left + 1.6 * line + wide, top + 2.2 * line),
            0.5 * line,
            _SHADE,
        )
        middle = top + 0.5 * line
        dot = 0.3 * line
        pen.ellipse((left, middle - dot, left + 2 * dot, middle + dot), _COLOURS[by])
        pen.text((left + line, middle), text, _TEXT, font, anchor="lm")
        pen.text((left + line, middle + 1.05 * line), f"frame {frame}", _TEXT, font, anchor="lm")
        return np.asarray(image)
