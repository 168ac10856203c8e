"""Work on a copy of a session's simulator: following a sketch to its end, and recording frames."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from hybridmpm import export, recording
from hybridmpm.control import ControlledTrajectory, Following, Guidance, Sketch, prepare
from hybridmpm.simulator import Simulator
from hybridmpm.stream_frames import Frame, Population
from hybridmpm_service.sessions.planning import Check

Report: TypeAlias = Callable[[int, int], object]
"""Called with the number of parts done and that of all parts."""


def traced(
    twin: Simulator,
    check: Check,
    sketch: Sketch,
    *,
    most: int,
    on_frame: Report = lambda _done, _total: None,
    **settings: Any,
) -> tuple[Guidance, ControlledTrajectory]:
    """Let a copy of a simulator follow a sketch to the end.

    Parameters
    ----------
    twin : Simulator
        In the state that the sketch was drawn on.
    check : callable
        Raises where the work is to end early.
    sketch : Arrow or Ellipse
    most : int
        Largest number of frames if none is given, `hold` included.
    on_frame : callable
        Called at the start and after each frame.
    **settings
        The others of `hybridmpm.control.prepare`.

    Raises
    ------
    ConfigError, SketchError, SimulationError
        As `hybridmpm.control.prepare`; a frame failed.
    """
    guidance = prepare(twin, sketch, most=most, on_frame=check, **settings)
    following = Following(twin, guidance)
    total = guidance.frames + guidance.hold
    on_frame(0, total)
    for done, _ in enumerate(following, start=1):
        check()
        on_frame(done, total)
    return guidance, following.result


def recorded(
    twin: Simulator,
    check: Check,
    file: Path,
    style: export.Style,
    *,
    frames: int,
    every: int,
    on_part: Report,
) -> None:
    """Compute frames with a copy of a simulator, and write them to a file in the format of its suffix.

    Parameters
    ----------
    twin : Simulator
    check : callable
        Raises where the work is to end early.
    file : Path
    style : Style
        Look of films and pictures.
    frames, every : int
        As in `hybridmpm.recording.record`.
    on_part : callable
        Called after some frames, and again after some pictures.

    Raises
    ------
    ConfigError, SimulationError
        As `hybridmpm.recording.record`.
    ExportError
        The file cannot be written.
    """
    done = 0

    def note(more: int) -> None:
        nonlocal done
        check()
        done += more
        on_part(done, frames)

    def drawn(pictures: int, total: int) -> None:
        check()
        on_part(frames + pictures, frames + total)

    on_part(0, frames)
    states = recording.record(twin, frames, every=every, on_progress=note)
    export.save(file, states, style, on_progress=drawn)


def frame_of(twin: Simulator) -> Frame:
    """Return the present state of a steered copy, as a frame for viewers."""
    scene = twin.scene
    population = Population(ids=twin.ids.astype(np.uint32), types=twin.materials) if scene.is_open else None
    return Frame(
        number=twin.frame,
        time=twin.time,
        solver_ms=0.0,
        steered=True,
        positions=twin.positions,
        population=population,
    )
