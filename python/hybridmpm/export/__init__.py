"""Writing a recording to a file; the suffix of the file's name decides the format.

| suffix | content |
|---|---|
| .npz | every recorded state as arrays |
| .gif, .mp4 | a film; .mp4 needs the extra `video` |
| .png | a picture of the last state, or of several states side by side (`strip`) |
| .ply, .vtp | the last state as a cloud of points with velocity and type |
| .obj, .glb | in 3D, the surfaces of the last state as meshes of triangles; they need the extra `surfaces` |
| .usdc | the particles of all states as points of Universal Scene Description; it needs the extra `usd` |

With `Style(surface=True)` a .ply is a surface, too. A .png, .ply, .vtp, .obj or .glb name with `%d` or e.g.
`%04d` in it gives a numbered series instead: one file for each recorded state, numbered by frame. A file
appears under its name only once it is complete.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hybridmpm._support.files import replacing
from hybridmpm.errors import ExportError
from hybridmpm.export import arrays, clouds, pictures, stages, surfaces
from hybridmpm.export.clouds import Cloud
from hybridmpm.export.surfaces import Surface, Surfaces
from hybridmpm.recording import Recording, checked_recording
from hybridmpm.render import View, view_of

__all__ = [
    "GEOMETRY",
    "SUFFIXES",
    "Cloud",
    "Style",
    "Surface",
    "Surfaces",
    "check_target",
    "needs_history",
    "save",
]

SUFFIXES = (".gif", ".glb", ".mp4", ".npz", ".obj", ".ply", ".png", ".usdc", ".vtp")
_CLOUDS = {".ply": clouds.write_ply, ".vtp": clouds.write_vtp}
_SURFACES = {".glb": surfaces.write_glb, ".obj": surfaces.write_obj, ".ply": surfaces.write_ply}
GEOMETRY = (".glb", ".obj", ".ply", ".usdc", ".vtp")
"""Suffixes of files with points or surfaces, which are no pictures."""
_SINGLE = (*(suffix for suffix in GEOMETRY if suffix != ".usdc"), ".png")
_NUMBER = re.compile(r"%(0\d{1,2})?d")

WriteState = Callable[[Path, Recording, int], None]
"""Writes the state of one row of a recording to a file."""
Progress = Callable[[int, int], object]
"""Called with the number of parts done and the number of all parts."""


@dataclass(frozen=True, kw_only=True)
class Style:
    """Look of pictures and films.

    Raises
    ------
    ExportError
        `speed`, `fps` or `strip` is out of range.
    """

    width: int = 640
    """Width of a picture [pixels], 64 to 4096."""
    speed: float = 1.0
    """Simulated seconds in a second of film, 0.01 to 10."""
    fps: int = 50
    """Pictures in a second of film, 1 to 50."""
    strip: int = 1
    """Number of states side by side in a .png, 1 to 12, evenly spread over the recording."""
    surface: bool = False
    """Whether a .ply has the surface in place of the points."""

    def __post_init__(self) -> None:
        if not 0.01 <= self.speed <= 10.0:
            raise ExportError(f"speed must be in [0.01, 10], got {self.speed}")
        if not 1 <= self.fps <= 50:
            raise ExportError(f"fps must be in [1, 50], got {self.fps}")
        if not 1 <= self.strip <= 12:
            raise ExportError(f"strip must be in [1, 12], got {self.strip}")


def check_target(path: Path, style: Style | None = None, *, dim: int | None = None) -> None:
    """Refuse a file that `save` could not write, before time is spent on a simulation.

    Parameters
    ----------
    path : path
        File, whose suffix decides the format.
    style : Style, optional
        Look that the file will have.
    dim : int, optional
        Dimension of the scene, 2 or 3, where it is known.

    Raises
    ------
    ExportError
        The suffix is unknown, the folder does not exist or cannot be written to, the format allows no
        numbered series, a package for the format is not installed, or a surface is asked for in 2D.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        plays = "; hybridmpm.play(scene, path) writes pages that play" if suffix == ".html" else ""
        raise ExportError(f"output files end in {', '.join(SUFFIXES)}; got {path.name!r}{plays}")
    if not path.parent.is_dir():
        raise ExportError(f"the folder {path.parent} does not exist")
    if path.is_dir():
        raise ExportError(f"cannot write {path}: it is a folder")
    if not os.access(path.parent, os.W_OK):
        raise ExportError(f"cannot write {path}: nothing may be written into the folder {path.parent}")
    if _NUMBER.search(path.name) and suffix not in _SINGLE:
        advice = f"a {suffix} has all states in one file, so leave out the %d"
        raise ExportError(f"a numbered series is for {', '.join(_SINGLE)}; got {path.name!r}; {advice}")
    if suffix == ".mp4":
        pictures.require_encoder()
    if suffix == ".usdc":
        stages.require_usd()
    if _is_surface(suffix, style or Style()):
        surfaces.require_meshing()
        if dim is not None:
            surfaces.check_dim(dim)


def _is_surface(suffix: str, style: Style) -> bool:
    return suffix in _SURFACES and (suffix not in _CLOUDS or style.surface)


def needs_history(path: Path, style: Style) -> bool:
    """Return whether `save` needs more states than the last for this file."""
    strip = path.suffix.lower() == ".png" and style.strip > 1
    return (
        strip or path.suffix.lower() in {".gif", ".mp4", ".npz", ".usdc"} or bool(_NUMBER.search(path.name))
    )


def save(
    path: str | Path,
    recording: Recording,
    style: Style | None = None,
    *,
    view: View | None = None,
    on_progress: Progress | None = None,
) -> list[Path]:
    """Write a recording to a file, or to a numbered series of files, and return their paths.

    Parameters
    ----------
    path : path
        File, whose suffix decides the format.
    recording : Recording
    style : Style, optional
        Look of pictures and films.
    view : View, optional
        What draws pictures, in place of `view_of` with the width of the style.
    on_progress : callable, optional
        Called with the number of parts done and the number of all parts.

    Raises
    ------
    ExportError
        `check_target` refuses the path, or writing failed. An older file of that name then stays.
    """
    path, style = Path(path), style or Style()
    check_target(path, style, dim=checked_recording(recording).scene.dim)
    progress = on_progress or (lambda _done, _total: None)
    suffix = path.suffix.lower()
    if suffix in {".gif", ".mp4"}:
        write_film = pictures.write_gif if suffix == ".gif" else pictures.write_mp4
        with replacing(path) as part:
            pace = pictures.Pace(style.speed, style.fps)
            write_film(part, recording, view or _view(recording, style), pace, progress)
        return [path]
    if suffix in {".npz", ".usdc"}:
        with replacing(path) as part:
            (arrays.write_npz if suffix == ".npz" else stages.write_usd)(part, recording)
        return [path]
    if suffix == ".png":
        return _save_pictures(path, recording, style, view or _view(recording, style), progress)
    if _is_surface(suffix, style):
        write = partial(_SURFACES[suffix], surfaces=Surfaces(recording))
        return _save_states(path, recording, write, progress)
    return _save_states(path, recording, _CLOUDS[suffix], progress)


def _view(recording: Recording, style: Style) -> View:
    return view_of(recording.scene, recording.types, style.width, recording.spacing)


def _save_pictures(
    path: Path, recording: Recording, style: Style, view: View, progress: Progress
) -> list[Path]:
    """Write the last state, several states side by side, or each state to a file of its own."""
    if style.strip > 1 and not _NUMBER.search(path.name):
        with replacing(path) as part:
            pictures.write_strip(part, recording, view, style.strip)
        return [path]
    return _save_states(path, recording, partial(pictures.write_png, view=view), progress)


def _save_states(path: Path, recording: Recording, write: WriteState, progress: Progress) -> list[Path]:
    """Write the last state, or each state to a file of its own."""
    if not _NUMBER.search(path.name):
        with replacing(path) as part:
            write(part, recording, len(recording.frames) - 1)
        return [path]
    files = []
    for row, frame in enumerate(recording.frames.tolist()):
        file = path.with_name(_numbered(path.name, frame))
        with replacing(file) as part:
            write(part, recording, row)
        files.append(file)
        progress(row + 1, len(recording.frames))
    return files


def _numbered(name: str, frame: int) -> str:
    """Return the name with the frame in place of `%d` or `%04d`; other percent signs stay."""
    return _NUMBER.sub(lambda match: match.group() % frame, name)
