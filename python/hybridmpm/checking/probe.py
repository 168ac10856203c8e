"""A probe: frames on a copy of a simulator, for the substeps and the time of a frame."""

import time
from dataclasses import dataclass

from hybridmpm.checking.openings import emitted
from hybridmpm.mpm import MpmSolver
from hybridmpm.mpm.cost import frame_cost
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator

_SECONDS = 0.25
"""Time after which a probe ends [s], once it has enough frames."""
_FRAMES = 12
"""Largest number of timed frames of a probe."""
_FILL_SECONDS = 0.25
"""Time for which emitters may fill a scene towards the middle of its run before frames are timed [s]."""
_LONG = 5_000_000
"""Particles times substeps above which a frame is too long to be probed whole: it takes 0.1 s or more."""
_SHORT_SUBSTEPS = 4


@dataclass(frozen=True)
class Probe:
    """Substeps and time of the first frames of a simulator."""

    seconds: float
    """Time of a frame [s]; where emitters bring particles, of one in the middle of the run."""
    substeps: int | None
    """Substeps of MPM's latest frame; None where MPM made none."""
    bound: str | None
    """Bound that limits the shortest of them."""


def probe_scene(scene: Scene) -> Probe:
    """Probe MPM on a scene; of long frames some substeps.

    Raises
    ------
    SceneError
        The scene cannot be filled with particles.
    SimulationError
        A frame failed.
    """
    cost = frame_cost(scene)
    if cost.particle_substeps < _LONG:
        return probe(MpmSolver(scene))
    share = min(1.0, _SHORT_SUBSTEPS / cost.substeps)
    short = scene.model_copy(update={"frame_dt": scene.frame_dt * share})
    found = probe(MpmSolver(short))
    substeps = round((found.substeps or 1) / share)
    return Probe(found.seconds * substeps / (found.substeps or 1), substeps, found.bound)


def probe(simulator: Simulator) -> Probe:
    """Advance a copy by some frames; the simulator itself does not change.

    A network needs frames of MPM before its first step, and takes steps of `r_t` frames. So those frames are
    simulated first, and whole steps are timed.

    Raises
    ------
    SimulationError
        A frame failed.
    """
    twin = simulator.copy()
    stride = twin.r_t
    pace = stride if stride == 1 else 7 * stride
    twin.advance(pace)
    growth = _grown(twin)
    report = twin.last_frame
    times: list[float] = []
    while len(times) < max(1, _FRAMES // stride) and sum(times) < _SECONDS * (1 if len(times) >= 3 else 3):
        begin = time.perf_counter()
        twin.advance(stride)
        times.append(time.perf_counter() - begin)
        report = twin.last_frame or report
    return Probe(
        seconds=growth * sorted(times)[len(times) // 2] / stride,
        substeps=None if report is None else report.substeps,
        bound=None if report is None else report.bound,
    )


def _grown(simulator: Simulator) -> float:
    """Let emitters fill a scene for a while; return the factor to the particle count in mid-run."""
    scene = simulator.scene
    if not scene.emitters:
        return 1.0

    def nominal(frame: int) -> float:
        return sum(emitted(scene, index, frame) for index in range(len(scene.emitters)))

    first, before = simulator.frame, simulator.particle_count
    middle, end = scene.frames // 2, time.perf_counter() + _FILL_SECONDS
    while simulator.frame < middle and time.perf_counter() < end:
        simulator.advance()
    count, added = simulator.particle_count, nominal(simulator.frame) - nominal(first)
    # Sinks and blocked emitters are assumed to go on alike.
    kept = min(1.0, max(0.0, (count - before) / added)) if added > 0 else 1.0
    later = count + kept * max(0.0, nominal(middle) - nominal(simulator.frame))
    return max(1.0, min(later, scene.max_particles) / max(count, 1))
