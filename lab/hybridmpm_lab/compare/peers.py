"""Solvers of others on the scenes of the comparison: their states, and pieces of them that can be timed."""

import dataclasses
from collections.abc import Iterator
from functools import partial

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.recording import Recording
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.truth import Truth
from hybridmpm_lab.harness.timing import TimedCall
from hybridmpm_lab.speed.baselines import Baseline, baseline_process

_PRECISE = "serial"
"""Setting whose errors are taken; the others add in another order and are as precise."""


def states(package: str, truth: Truth) -> Recording:
    """Simulate a scene by a peer, and return the states at the truth's frames.

    Peers give positions alone, so velocities are differences of two frames.
    """
    scene, positions, velocities = truth.states.scene, [], []
    with baseline_process(package) as baseline:
        baseline.start(scene, _substeps(scene))
        now = 0
        for frame in truth.states.frames.tolist():
            baseline.advance(_PRECISE, frame - 1 - now)
            before = baseline.positions(_PRECISE)
            baseline.advance(_PRECISE, 1)
            positions.append(baseline.positions(_PRECISE))
            velocities.append((positions[-1] - before) / scene.frame_dt)
            now = frame
    return dataclasses.replace(
        truth.states,
        positions=np.clip(np.array(positions, dtype=np.float32), 0, 1),
        velocities=np.array(velocities, dtype=np.float32),
    )


def pieces(
    baseline: Baseline, scene: Scene, start: int, span: int, frames: int
) -> Iterator[tuple[int, list[TimedCall]]]:
    """Yield the threads of each setting of a peer, and its pieces by its own clock."""
    solver, substeps = MpmSolver(scene, substeps="reference"), _substeps(scene)
    solver.advance(start)
    state = (solver.positions, solver.velocities, solver.affine, solver.volume_ratio)
    _, ways = baseline.start(scene, substeps, state)
    for setting, threads in ways.items():
        calls = [
            TimedCall(
                prepare=partial(baseline.restore, setting, frame + 1),
                call=partial(_piece, baseline, setting, frames),
            )
            for frame in range(0, span - frames, max(span // 3, 1))
        ]
        yield threads, calls


def _piece(baseline: Baseline, setting: str, frames: int) -> float:
    return baseline.advance(setting, frames) / frames


def _substeps(scene: Scene) -> int:
    """Return the ground truth's substeps of a frame, at which peers run."""
    solver = MpmSolver(scene, substeps="reference")
    solver.advance(1)
    report = solver.last_frame
    return report.substeps if report else 1
