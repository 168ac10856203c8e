"""Running one method on one trial: how it is made, driven and listened to."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.decisions import Decision
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.hybrid.guards import GUARDS
from hybridmpm.metrics import other_jitter
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import as_stepper
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.simulator import Simulator
from hybridmpm_lab.stability.outcome import Look, Run, look
from hybridmpm_lab.stability.stresses.trial import MODELS, Method, Trial

EVERY = 4
"""Frames between two looks."""
LEVEL = "1/16"
"""CoarseLevel of few particles that carry all others."""
_SAFE_CFL = 0.25
"""CFL number of the truth where the ground truth's own substeps do not hold."""


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """What a method made of a trial."""

    run: Run | None
    """None where it did not come to its end."""
    signals: tuple[str, ...]
    """Errors, warnings and alarms that a user meets, by name, each once."""
    refused: bool = False
    """Whether it was refused before any frame."""


def attempt(trial: Trial, method: Method) -> Attempt:
    """Run a method on a trial to its end, to an error or to a refusal."""
    heard: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            simulator = _made(trial, method)
        except (ConfigError, SimulationError) as error:
            return Attempt(run=None, signals=(type(error).__name__,), refused=True)
        run = None
        try:
            run = _driven(trial, simulator, lambda: _made(trial, method))
        except SimulationError as error:
            if simulator.frame == 0:
                return Attempt(run=None, signals=(type(error).__name__,), refused=True)
            heard.append(type(error).__name__)
    heard += [one.category.__name__ for one in caught if issubclass(one.category, UserWarning)]
    heard += [f"{one.reason} alarm" for one in simulator.log if _is_alarm(one)]
    return Attempt(run=run, signals=tuple(dict.fromkeys(heard)))


def truth(trial: Trial, *, shift: int = 0) -> Run | None:
    """Run MPM with all particles, at the ground truth's substeps and a stiffness that is safe.

    Where those do not hold, at a CFL number far below the limit; None where that fails, too. `shift` gives
    the particles another jitter.
    """
    scene = other_jitter(trial.safe or trial.scene, shift)
    plain = replace(trial, resume_at=None)
    for settings in ({"substeps": "reference"}, {"cfl": _SAFE_CFL}):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return _driven(plain, MpmSolver(scene, **settings), None)
            except (ConfigError, SimulationError):
                continue
    return None


def _is_alarm(decision: Decision) -> bool:
    return decision.mode == "mpm" and decision.reason in (*GUARDS, "unsound")


def _made(trial: Trial, method: Method) -> Simulator:
    settings: dict[str, Any] = dict(trial.mpm)
    if method == "mpm":
        return MpmSolver(trial.scene, **settings)
    if method == "coarse":
        by_step = {"cfl", "substeps"} & set(settings)
        settings |= {"r_p": 1 / 16, "show_all": True} if by_step else {"coarse": LEVEL}
        return MpmSolver(trial.scene, **settings)
    network = as_stepper(MODELS[trial.scene.dim], trial.scene)
    if method == "neural":
        return NeuralPhysics(trial.scene, network)
    if trial.spoil is not None:
        network = trial.spoil(network, trial.scene)
    return HybridSimulator(trial.scene, network)


def _driven(trial: Trial, simulator: Simulator, make: Callable[[], Simulator] | None) -> Run:
    """Advance to the end of a trial, and look at the state every few frames."""
    if trial.hand_over_every is not None and isinstance(simulator, HybridSimulator):
        return _by_turns(simulator, trial)
    looks, work, passed = [look(simulator, 0.0)], 0.0, 0.0
    works = trial.force is not None or any(one.motion for one in trial.scene.obstacles)
    twin: Simulator | None = None
    for frame in range(trial.frames):
        if frame == trial.resume_at and make is not None:
            twin = make()
            twin.restore(simulator.snapshot())
        force = None if trial.force is None else trial.force(simulator)
        before = simulator.positions
        simulator.advance(1, force)
        if twin is not None:
            twin.advance(1, force)
        if works:
            work += _work(simulator, before, force)
        if (frame + 1) % EVERY == 0:
            looks.append(look(simulator, work))
            passed = max(passed, _passed(trial, simulator))
            if not looks[-1].finite:
                break
    return _ended(looks, simulator, passed, same=twin is None or _same(simulator, twin))


def _by_turns(simulator: HybridSimulator, trial: Trial) -> Run:
    """Let network and MPM take turns by a script."""
    stride = (trial.hand_over_every or 1) * simulator.r_t
    first = 6 * simulator.r_t
    turns = range(first, trial.frames, stride)
    log = [
        Decision(frame=at, mode="mpm" if turn % 2 else "neural", value=None, reason="appointed", noticed=at)
        for turn, at in enumerate(turns)
    ]
    looks = [look(simulator, 0.0)]
    simulator.replay(log, trial.frames, lambda now: looks.append(look(now, 0.0)))
    return _ended(looks, simulator, 0.0, same=True)


def _ended(looks: list[Look], simulator: Simulator, passed: float, *, same: bool) -> Run:
    mass = float(simulator.mass.sum(dtype=np.float64))
    return Run(looks=tuple(looks), mass=mass, passed=passed, same=same)


def _work(simulator: Simulator, before: npt.NDArray[np.float32], force: npt.ArrayLike | None) -> float:
    """Return the work of a force, constant over a frame, and of moving obstacles [J]."""
    report = simulator.last_frame
    work = 0.0 if report is None else report.obstacle_work
    if force is not None:
        moved = simulator.positions.astype(np.float64) - before
        work += float(simulator.mass @ (moved * np.asarray(force)).sum(axis=1))
    return work


def _passed(trial: Trial, simulator: Simulator) -> float:
    return 0.0 if trial.passed is None else float(trial.passed(simulator.positions).mean())


def _same(one: Simulator, two: Simulator) -> bool:
    pairs = ((one.positions, two.positions), (one.velocities, two.velocities))
    return all(np.array_equal(a, b) for a, b in pairs)
