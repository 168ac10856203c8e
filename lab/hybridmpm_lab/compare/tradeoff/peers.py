"""Solvers of others on the scenes of the chart: their errors, and simulations of them that can be timed."""

from collections.abc import Sequence

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.recording import Recording
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.accuracy.conventions import EVERY
from hybridmpm_lab.speed.baselines.process import Worker

_PRECISE = "serial"
"""Setting whose errors are taken; the others add in another order and are as precise."""


def can_simulate(scene: Scene) -> bool:
    """Tell whether the plain solvers of others take a scene: one material, and no obstacles."""
    return not scene.obstacles and len(scene.materials) == 1


def reference_substeps(scene: Scene) -> int:
    """Return the ground truth's substeps of a frame, at which peers run."""
    solver = MpmSolver(scene, substeps="reference")
    solver.advance(1)
    report = solver.last_frame
    return report.substeps if report else 1


def peer_states(package: str, truth: Recording, start: int, span: int) -> Recording:
    """Simulate a scene by a peer, and return every tenth of the `span` states after frame `start`.

    Peers give positions alone, so velocities are differences of the last two frames.
    """
    scene = truth.scene
    frames = np.arange(start + EVERY, start + span + 1, EVERY)
    positions, velocities = [], []
    with Worker(package) as worker:
        worker.call("start")
        worker.call("make", _PRECISE, _described(scene), reference_substeps(scene))
        now = 0
        for frame in frames.tolist():
            worker.call("advance", _PRECISE, frame - 1 - now)
            before = worker.call("positions", _PRECISE)
            worker.call("advance", _PRECISE, 1)
            positions.append(worker.call("positions", _PRECISE))
            velocities.append((positions[-1] - before) / scene.frame_dt)
            now = frame
    particles = scene.sample()
    return Recording(
        scene=scene,
        ids=np.arange(len(particles.x), dtype=np.uint64),
        types=particles.types,
        mass=particles.mass,
        frames=frames,
        positions=np.clip(np.array(positions, dtype=np.float32), 0, 1),
        velocities=np.array(velocities, dtype=np.float32),
    )


class PeerTiming:
    """A peer at one setting, at a state of ours, with a clock of its own: nobody looks at its particles.

    Parameters
    ----------
    worker : Worker
        Process of the peer, started, which has taken the state.
    setting : str
        One of the peer's settings.
    scene : Scene
    """

    def __init__(self, worker: Worker, setting: str, scene: Scene, substeps: int) -> None:
        self._worker, self._setting = worker, setting
        worker.call("make", setting, _described(scene), substeps)

    def restore(self) -> None:
        """Go back to the state."""
        self._worker.call("restore", self._setting)

    def advance(self, frames: int) -> Sequence[float]:
        """Go on, and return the mean time of a frame [s], once for each frame."""
        return [float(self._worker.call("advance", self._setting, frames)) / frames] * frames


def _described(scene: Scene) -> dict[str, object]:
    return scene.model_dump(mode="json", exclude_none=True)
