"""Pictures of a run of the service that is computed again: its sketches over the particles that they led."""

import numpy as np
import numpy.typing as npt

from hybridmpm.control.sketch.render import render
from hybridmpm.export.ink import with_sketch
from hybridmpm.recording import Recording
from hybridmpm.render import view_of
from hybridmpm.replaying import Run


class RunFilm:
    """Draws states of a run, as a `hybridmpm.render.View` does, each with the sketches that lead there.

    Parameters
    ----------
    run : Run
        At the last frame of the recording.
    recording : Recording
    width : int in [64, 4096]
        Width of the pictures [pixels].
    """

    def __init__(self, run: Run, recording: Recording, width: int) -> None:
        self._scene, self._frame_dt = recording.scene, recording.scene.frame_dt
        self._view = view_of(recording.scene, recording.types, width, recording.spacing)
        self._led = [
            (one.first, one.last, render(sketch, recording.scene.size))
            for one in run.led
            for sketch in one.sketches
        ]

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
        for first, last, raster in self._led:
            if first <= frame < last:
                picture = with_sketch(picture, raster, self._scene)
        return picture
