"""Hybrids on many scenes: who simulated which share of the frames, and the error against MPM's.

Beside the hybrid with its network run the same hybrid with free fall in the network's place, hybrids whose
network is spoilt on purpose, and MPM with as few particles, in two jitters.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, scenarios
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.hybrid.shortcuts import TOLERANCE
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.load import as_stepper, model_for
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.stepper import Stepper
from hybridmpm.planner.calibrating.impact import first_impact
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator
from hybridmpm_lab.compare.accuracy.conventions import AT, EVERY, FIRST_SEED
from hybridmpm_lab.compare.hybrid.corruptions import CORRUPTIONS, Corrupted
from hybridmpm_lab.compare.hybrid.scene_means import FREE_FALL, HYBRID, KEY, MPM, means, promises
from hybridmpm_lab.harness.grid import TrueGrids
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.harness.timing import Clock

NETWORK, JITTER = "network", "mpm-other-jitter"
MAIN = (HYBRID, FREE_FALL, MPM, JITTER)
"""Methods that run unless others are asked for."""
THRESHOLDS = {f"cosine-{tenth / 10}": tenth / 10 for tenth in range(10)}
"""Thresholds r_c of hybrids that only the cosine guards besides `non-finite` and `outside`, by name."""
METHODS = (*MAIN, NETWORK, *THRESHOLDS, *CORRUPTIONS)
"""All methods: a hybrid with its network, with free fall in its place, MPM twice, the network alone, hybrids
with the cosine alone, and hybrids whose network is spoilt."""
CALM_SHARE = 0.95
"""Share of the truth's particles that have to be calm for contact to be over."""
_STRIDE = 4
"""Frames over which the truth's accelerations are taken."""

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class ScenesSettings:
    """What is measured."""

    model: str | None = None
    """Name of the network, or "zero" for free fall; None takes the first that serves each scenario."""
    scenarios: tuple[str, ...] = scenarios.NAMES
    """Scenarios of the scenes."""
    first: int = FIRST_SEED
    """Seed of the first scene of each scenario."""
    scenes: int = 20
    """Number of scenes of each scenario."""
    promised: int = 0
    """Number of scenes of each scenario that promises are made from; in those beyond `scenes` only the hybrid
    and MPM run, with all particles carried along."""
    frames: int = 400
    """Number of frames of each scene."""
    methods: tuple[str, ...] = MAIN
    """Some of `METHODS`."""
    carried: tuple[bool, ...] = (True,)
    """Whether all particles are carried along; both may be measured."""

    def shared(self) -> Row:
        """Return what runs must share to stand in one table."""
        return {"model": self.model, "frames": self.frames}

    def asked_for(self) -> list[tuple[str, int, str, bool]]:
        """Return the runs, by the values of their `KEY`."""
        everything = [(method, carry) for method in self.methods for carry in self.carried]
        promised = [(HYBRID, True), (MPM, True)]
        return [
            (scenario, self.first + number, method, carry)
            for scenario in self.scenarios
            for number in range(max(self.scenes, self.promised))
            for method, carry in (everything if number < self.scenes else promised)
        ]


@dataclass(frozen=True, kw_only=True)
class _Truth:
    """What the truth of a scene tells."""

    impact: int
    """Frame of the first impact."""
    calm: int
    """Frame from which on 95 % of the particles are calm, or the last frame."""
    kinetic_energy: float
    """At the last frame [J]."""
    fall_energy: float
    """Potential energy that has been lost up to the last frame [J]."""
    grids: TrueGrids

    @classmethod
    def of(cls, scene: Scene, frames: int) -> "_Truth":
        """Simulate the truth, with all particles and the ground truth's substeps."""
        solver = MpmSolver(scene, substeps="reference")
        impact = first_impact(solver, frames)
        solver.reset()
        start = solver.diagnostics()
        states, calm, before = [solver.positions], frames, solver.velocities
        for frame in range(_STRIDE, frames + 1, _STRIDE):
            for one in range(frame - _STRIDE + 1, frame + 1):
                solver.advance(1)
                if one % EVERY == 0:
                    states.append(solver.positions)
            now = solver.velocities
            pushes = np.linalg.norm(now - before, axis=1) / (_STRIDE * scene.frame_dt)
            if frame > impact + EVERY and calm == frames and np.mean(pushes < TOLERANCE) > CALM_SHARE:
                calm = frame
            before = now
        end = solver.diagnostics()
        return cls(
            impact=impact,
            calm=calm,
            kinetic_energy=end.kinetic_energy,
            fall_energy=start.potential_energy - end.potential_energy,
            grids=TrueGrids(np.array(states), solver.mass, scene.resolution),
        )


def measure(
    settings: ScenesSettings, runs: RowStore, origin: Provenance, on_progress: Progress
) -> Iterator[Row]:
    """Run what is missing, adding it to the runs one by one, and yield all rows; `on_progress` counts runs.

    Rows of the part `run` are the single runs. `error` is the mean `grid_rmse` against the truth from the
    first impact on, `error_40` that 40 frames after it, and `nrmse` the mean `grid_nrmse` over the same
    frames as `error`. `network`, `free_fall`, `rest` and `mpm` are shares of all frames. `contact` is the
    share of the frames in contact in which the network was evaluated: from the first impact until 95 % of the
    truth's particles are calm. `kinetic` is the kinetic energy at the end over the energy of the fall,
    `kinetic_true` that of the truth. Rows of the part `mean` are means over the first `scenes` of a scenario,
    rows of the part `promise` tell what holds in 90 % of all; see `scene_means`.
    """
    runs_asked_for = settings.asked_for()
    for scenario in settings.scenarios:
        mine_by_seed: dict[int, list[tuple[str, int, str, bool]]] = {}
        for key in runs_asked_for:
            if key[0] == scenario:
                mine_by_seed.setdefault(key[1], []).append(key)
        for seed, mine in mine_by_seed.items():
            missing = [key for key in mine if key not in runs]
            if missing:
                scene = scenarios.get(scenario, seed)
                truth = _Truth.of(scene, settings.frames)
                network = as_stepper(model_for(settings.model, scenario), scene)
                for key in missing:
                    made = _run(scene, truth, network, key[2], show_all=key[3], frames=settings.frames)
                    runs.add(key, origin.stamped({"part": "run", **dict(zip(KEY, key, strict=True)), **made}))
            on_progress(len(mine))
    rows = [runs[key] for key in runs_asked_for]
    yield from rows
    judged = [row for row in rows if row["seed"] < settings.first + settings.scenes]
    for row in (*means(judged), *promises(rows)):
        yield origin.stamped(row)


def _run(scene: Scene, truth: _Truth, network: Stepper, method: str, *, show_all: bool, frames: int) -> Row:
    simulator = _simulator(scene, network, method, show_all=show_all)
    errors, normalised, answered, seconds = [], [], [], list[float]()
    for row in range(1, frames // EVERY + 1):
        try:
            with Clock(seconds):
                simulator.advance(EVERY)
        except SimulationError:
            break
        errors.append(truth.grids.rmse(row, np.clip(simulator.positions, 0, 1), simulator.mass))
        normalised.append(errors[-1] * truth.grids.nrmse_over_rmse(row))
        if isinstance(simulator, HybridSimulator):
            answered.append(simulator.step_counts)
    whole = len(errors) == frames // EVERY
    counted = slice(max(truth.impact // EVERY, 1) - 1, None)
    later = errors[counted]
    found: Row = {
        "frames": frames,
        "impact": truth.impact,
        "calm": truth.calm,
        "error": significant(float(np.mean(later))) if whole and later else None,
        "nrmse": significant(float(np.mean(normalised[counted]))) if whole and later else None,
        **{f"error_{at}": _at(errors, truth.impact + at) for at in AT},
        "kinetic": significant(simulator.diagnostics().kinetic_energy / truth.fall_energy) if whole else None,
        "kinetic_true": significant(truth.kinetic_energy / truth.fall_energy),
        "ms_per_frame": significant(1e3 * sum(seconds) / max(len(seconds) * EVERY, 1)),
        "network": None,
        "free_fall": None,
        "rest": None,
        "mpm": None,
        "contact": None,
    }
    if answered and whole:
        last = answered[-1]
        first, end = answered[max(truth.impact // EVERY, 1) - 1], answered[truth.calm // EVERY - 1]
        touching = max((truth.calm // EVERY - max(truth.impact // EVERY, 1)) * EVERY, EVERY)
        shares = {
            "network": last.network / frames,
            "free_fall": last.free_fall / frames,
            "rest": last.rest / frames,
            "mpm": 1 - (last.network + last.free_fall + last.rest) / frames,
            "contact": (end.network - first.network) / touching,
        }
        found |= {name: significant(share) for name, share in shares.items()}
    return found


def _at(errors: Sequence[float], frame: int) -> float | None:
    """Return the error at the compared state that is nearest to a frame; None after the last."""
    row = round(frame / EVERY) - 1
    return significant(errors[row]) if row < len(errors) else None


def _simulator(scene: Scene, network: Stepper, method: str, *, show_all: bool) -> Simulator:
    if method in (MPM, JITTER):
        other = metrics.other_jitter(scene) if method == JITTER else scene
        return MpmSolver(other, r_p=network.r_p, show_all=show_all)
    if method == NETWORK:
        return NeuralPhysics(scene, network, show_all=show_all)
    if method == FREE_FALL:
        network = FreeFall(scene.frame_dt, r_p=network.r_p, r_t=network.r_t)
    elif method in THRESHOLDS:
        sound = ("non-finite", "outside")
        return HybridSimulator(scene, network, r_c=THRESHOLDS[method], guards=sound, show_all=show_all)
    elif method != HYBRID:
        network = Corrupted(network, CORRUPTIONS[method], scene)
    return HybridSimulator(scene, network, show_all=show_all)
