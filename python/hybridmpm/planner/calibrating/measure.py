"""Times of some candidates on training scenes of two sizes, and the calibration that they become."""

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np

from hybridmpm import _core, scenarios
from hybridmpm._support.machine import cpu_model
from hybridmpm.coarse import CoarseSimulator, fastest_impact
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.fit import Sample, fitted_line, fitted_work
from hybridmpm.planner.calibrating.impact import first_frame
from hybridmpm.planner.calibration import VERSION, MachineTimes, MaterialTimes, NetworkTimes, Ratio
from hybridmpm.planner.candidates import Candidate, candidates, solvers
from hybridmpm.planner.cost import filled_cells
from hybridmpm.scene import Scene

CLASSES: tuple[tuple[Literal["water", "sand"], Literal[2, 3]], ...] = (
    ("water", 2),
    ("sand", 2),
    ("water", 3),
    ("sand", 3),
)
"""Material and dimension of each scenario that is timed."""
_SEEDS = range(40)
"""Training seeds, of which the scenes with most and with fewest particles are timed."""
_MEASURED = (
    "mpm 1", "mpm 1/4", "mpm 1/16", "mpm 1/64",
    "coarse unfitted 1/4", "coarse unfitted 1/8", "coarse unfitted 1/64",
    "coarse 1/4", "coarse 1/8", "coarse 1/16", "coarse 1/32", "coarse 1/64",
)  # fmt: skip
_HYBRID_BASE = "coarse unfitted 1/8"
"""Method that the times of hybrids are compared with: MPM with as many particles, all shown."""
_PIECE = 8
"""Frames of a piece: two upsamplings, and one or two steps of each shipped network."""
_SPAN, _TURN, _PASSES = 160, 5 * _PIECE, 2

_OBSTRUCTED = 3
"""Number of scenes with obstacles of each material in 2D, from fewest obstacles to most."""

COUNT = 2 * len(CLASSES) + 2 * _OBSTRUCTED
"""Number of scenes: those of two sizes of each scenario, and those with obstacles."""


def measure(date: str, on_progress: Callable[[int], object]) -> MachineTimes:
    """Time candidates by turns, and fit what each kind of work takes; `on_progress` counts scenes.

    Parameters
    ----------
    date : str
        Date of the measurement, ISO 8601.
    on_progress : callable
    """
    materials: list[MaterialTimes] = []
    ratios: list[Ratio] = []
    by_network: dict[tuple[str, Literal[2, 3]], list[Sample]] = {}
    for kind, dim in CLASSES:
        scenario = f"{kind}_{dim}d"
        timed, speeds = [], []
        for scene in _scenes(scenario):
            timed.append({one.name: one for one in _timed(scene, _all_of(scenario))})
            speeds.append(_speed(scene))
            on_progress(1)
        samples = [one[name] for one in timed for name in _MEASURED]
        if dim == 2:
            for scene in _obstructed(f"{kind}_ramps_2d"):
                samples += _timed(scene, [solvers()[name] for name in _MEASURED])
                on_progress(1)
        work = fitted_work(samples)
        if dim == 3:  # no scenario in 3D has obstacles
            in_2d = next((one for one in materials if one.material == kind), None)
            if in_2d is not None:
                work |= {name: getattr(in_2d, name) for name in work if "obstacle" in name}
        materials.append(MaterialTimes(material=kind, dim=dim, speed=float(np.median(speeds)), **work))
        for one in (sample for scene_samples in timed for sample in scene_samples.values()):
            if one.name.startswith("neural"):
                by_network.setdefault((one.name.removeprefix("neural "), dim), []).append(one)
        ratios += _ratios(kind, dim, timed)
    return MachineTimes(
        version=VERSION,
        solver_version=_core.SOLVER_VERSION,
        machine=cpu_model(),
        date=date,
        materials=tuple(materials),
        networks=tuple(_network(*key, samples) for key, samples in by_network.items()),
        ratios=tuple(ratios),
    )


def _network(model: str, dim: Literal[2, 3], samples: Sequence[Sample]) -> NetworkTimes:
    frame, particle = fitted_line([one.particles for one in samples], [one.microseconds for one in samples])
    return NetworkTimes(model=model, dim=dim, frame=frame, particle=particle)


def _scenes(scenario: str) -> tuple[Scene, Scene]:
    """Return the training scenes with fewest and with most particles."""
    drawn = [scenarios.get(scenario, seed) for seed in _SEEDS]
    drawn.sort(key=lambda scene: sum(body.measure for body in scene.bodies))
    return drawn[0], drawn[-1]


def _obstructed(scenario: str) -> list[Scene]:
    """Return three training scenes, with fewest, more and most obstacles."""
    drawn = [scenarios.get(scenario, seed) for seed in _SEEDS]
    drawn.sort(key=lambda scene: len(scene.obstacles))
    return [drawn[round(place)] for place in np.linspace(0, len(drawn) - 1, _OBSTRUCTED)]


def _all_of(scenario: str) -> list[Candidate]:
    """Return the solvers that are timed, and what is learned for a scenario."""
    known = candidates(scenario)
    learned = [one for one in known.values() if one.variant in ("alone", "default guards")]
    return [*(known[name] for name in _MEASURED), *learned]


def _timed(scene: Scene, chosen: Sequence[Candidate]) -> Iterator[Sample]:
    """Time candidates by turns over the frames after the first impact."""
    start = first_frame(scene, 0)
    seconds: list[list[list[float]]] = [[] for _ in chosen]
    substeps: list[list[int]] = [[] for _ in chosen]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # coarse levels and obstacles are none of the user's here
        simulators = [one.make(scene) for one in chosen]
        for simulator in simulators:
            simulator.advance(max(start, 5 * 8))
        states = [simulator.snapshot() for simulator in simulators]
        for _ in range(_PASSES):
            for simulator, state, mine in zip(simulators, states, seconds, strict=True):
                simulator.restore(state)
                mine.append([])
            for _ in range(0, _SPAN, _TURN):
                for simulator, mine, cuts in zip(simulators, seconds, substeps, strict=True):
                    mine[-1] += _frames(simulator, cuts)
    for candidate, simulator, mine, cuts in zip(chosen, simulators, seconds, substeps, strict=True):
        yield _sample(candidate, simulator, mine, cuts)


def _frames(simulator: CoarseSimulator, substeps: list[int]) -> list[float]:
    spent = []
    for _ in range(_TURN):
        began = time.process_time()  # other processes add less to it
        simulator.advance(1)
        _ = simulator.positions
        spent.append(time.process_time() - began)
        report = simulator.last_frame
        substeps.append(report.substeps if report else 0)
    return spent


def _sample(
    candidate: Candidate, simulator: CoarseSimulator, seconds: list[list[float]], substeps: list[int]
) -> Sample:
    scene = simulator.scene
    resolution = simulator.resolution if isinstance(simulator, MpmSolver) else scene.resolution
    frames = np.min(seconds, axis=0)  # what disturbs a machine only ever adds time
    return Sample(
        name=candidate.name,
        particles=len(simulator.coarse_positions),
        shown=simulator.particle_count,
        substeps=float(np.median(substeps)),
        cells=filled_cells(scene, len(scene.sample().x), resolution),
        obstacles=len(scene.obstacles),
        show_all=candidate.show_all,
        microseconds=1e6 * float(np.median(frames.reshape(-1, _PIECE).mean(axis=1))),
    )


def _speed(scene: Scene) -> float:
    """Return the largest speed of particles in mid-splash over that of matter that falls onto the floor."""
    known = solvers()["coarse 1/16"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        simulator = known.make(scene)
        simulator.advance(first_frame(scene, 0))
    speeds = []
    for _ in range(0, _SPAN, _PIECE):
        simulator.advance(_PIECE)
        speeds.append(float(simulator.diagnostics().max_speed))
    return float(np.median(speeds)) / fastest_impact(scene)


def _ratios(
    kind: Literal["water", "sand"], dim: Literal[2, 3], timed: Sequence[dict[str, Sample]]
) -> Iterator[Ratio]:
    """Yield the time of each hybrid over that of its base, as means of the scenes."""
    for name in (name for name in timed[0] if name.startswith("hybrid")):
        quotients = [one[name].microseconds / one[_HYBRID_BASE].microseconds for one in timed]
        yield Ratio(material=kind, dim=dim, name=name, base=_HYBRID_BASE, ratio=float(np.mean(quotients)))
