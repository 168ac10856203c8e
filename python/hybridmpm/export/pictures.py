"""Pictures and GIF films, written by Pillow, and MP4 films, written by imageio-ffmpeg."""

import importlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import GifImagePlugin, Image

from hybridmpm.errors import ExportError
from hybridmpm.recording import Recording
from hybridmpm.render import View, side_by_side


class Pace(NamedTuple):
    """Pace of a film."""

    speed: float
    """Simulated seconds in a second of film."""
    fps: int
    """Pictures in a second of film. Delays in a GIF are whole hundredths of a second; browsers slow down
    below two."""


Progress = Callable[[int, int], object]


def write_png(path: Path, recording: Recording, row: int, view: View) -> None:
    """Write a picture of state `row`."""
    Image.fromarray(_draw(view, recording, row)).save(path, optimize=True)


def write_strip(path: Path, recording: Recording, view: View, count: int) -> None:
    """Write `count` states side by side, evenly spread from first to last."""
    rows = np.linspace(0, len(recording.frames) - 1, count).round().astype(int)
    pictures = [_draw(view, recording, row) for row in rows]
    Image.fromarray(side_by_side(pictures)).save(path, optimize=True)


def write_gif(path: Path, recording: Recording, view: View, pace: Pace, progress: Progress) -> None:
    """Write a film that repeats without end.

    Each picture is written before the next one is drawn; Pillow would keep them all until the last.
    """
    before: npt.NDArray[np.uint8] | None = None
    with path.open("wb") as file:
        for picture in _film(recording, view, pace, progress):
            if before is None:
                corner, changed = (0, 0), picture
                head, _ = GifImagePlugin.getheader(_with_palette(picture), info={"loop": 0})
                file.writelines(head)
            else:
                corner, changed = _changed(before, picture)
            image = _with_palette(changed)
            file.writelines(
                GifImagePlugin.getdata(
                    image, corner, duration=round(1000 / pace.fps), include_color_table=True
                )
            )
            before = picture
        file.write(b";")


def _with_palette(picture: npt.NDArray[np.uint8]) -> Image.Image:
    return Image.fromarray(picture).quantize(256, dither=Image.Dither.NONE)


def _changed(
    before: npt.NDArray[np.uint8], after: npt.NDArray[np.uint8]
) -> tuple[tuple[int, int], npt.NDArray[np.uint8]]:
    """Return the part of a picture that has changed, and its corner (x, y); a pixel where nothing has."""
    differs = (before != after).any(axis=2)
    rows, columns = (np.flatnonzero(differs.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return (0, 0), after[:1, :1]
    part = after[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return (int(columns[0]), int(rows[0])), np.ascontiguousarray(part)


def write_mp4(path: Path, recording: Recording, view: View, pace: Pace, progress: Progress) -> None:
    """Write an H.264 film; raises `ExportError` where the encoder fails."""
    encoder = require_encoder()
    pictures = _film(recording, view, pace, progress)
    first = next(pictures)
    size = (first.shape[1], first.shape[0])
    # Views have even sizes, so blocks of 2 pixels fit without scaling the picture.
    sink = encoder.write_frames(
        str(path), size, fps=pace.fps, quality=8, macro_block_size=2, ffmpeg_log_level="error"
    )
    sink.send(None)
    try:
        sink.send(first.tobytes())
        for picture in pictures:
            sink.send(picture.tobytes())
    finally:
        sink.close()
    if not path.exists():
        raise ExportError("the MP4 encoder wrote no file")


def require_encoder() -> ModuleType:
    """Return the module imageio-ffmpeg, or raise an `ExportError` with the command that installs it."""
    try:
        return importlib.import_module("imageio_ffmpeg")
    except ImportError:
        raise ExportError(
            "MP4 needs imageio-ffmpeg; install it with: pip install 'hybridmpm[video]', or write a .gif"
        ) from None


def _film(
    recording: Recording, view: View, pace: Pace, progress: Progress
) -> Iterator[npt.NDArray[np.uint8]]:
    """Yield the pictures of a film; each shows the state nearest to its time."""
    frames = recording.frames - recording.frames[0]
    frames_per_picture = pace.speed / (pace.fps * recording.scene.frame_dt)
    wanted = np.arange(0.0, frames[-1] + 1e-9, frames_per_picture)
    right = np.clip(np.searchsorted(frames, wanted), 1, max(1, len(frames) - 1))
    right = np.minimum(right, len(frames) - 1)
    left = np.maximum(right - 1, 0)
    rows = np.where(wanted - frames[left] < frames[right] - wanted, left, right)
    for done, row in enumerate(rows.tolist(), start=1):
        yield _draw(view, recording, row)
        progress(done, len(rows))


def _draw(view: View, recording: Recording, row: int) -> npt.NDArray[np.uint8]:
    return recording.picture(view, row)
