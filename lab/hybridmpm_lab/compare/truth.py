"""The truth of a scene, and the errors of other simulations of it."""

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, scenarios
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_impact
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator
from hybridmpm_lab.harness.rows import AT, EVERY, FIRST_SEED

_CROWD = 100
"""Number of test scenes of which the one with the most particles is timed."""
_CALM, _CALM_SHARE = 0.5, 0.95
"""Acceleration below which a particle is calm [m/s^2], and the share of calm particles of a scene at rest."""
_MEANS = ("grid_nrmse", "grid_node_error", "kinetic_energy", "centroid", "max_density")
MEASURES = (
    "error",
    *(f"error_{at}" for at in AT),
    "grid_nrmse",
    "grid_node_error",
    "transport",
    "kinetic_energy",
    "centroid",
    "max_density",
    "density_error",
)
"""Names of all errors; see `errors`."""
SHARES = ("mpm_share", "network", "free_fall", "rest", "contact")
"""Shares of the frames; see `shares`."""
_Counts = dict[str, int]
_Floats = npt.NDArray[np.float32]


def reference_scene(scenario: str) -> Scene:
    """Return the scene for latencies: of a hundred test scenes that with the most particles."""
    scenes = [scenarios.get(scenario, seed) for seed in range(FIRST_SEED, FIRST_SEED + _CROWD)]
    return max(scenes, key=lambda scene: len(scene.sample().x))


@dataclass(frozen=True, kw_only=True)
class Truth:
    """MPM with all particles at the ground truth's substeps, from the frame on from which errors count."""

    impact: int
    """Frame of the first impact."""
    start: int
    """Frame from which errors count: the first impact, or the end of a warm-up where that is later."""
    calm: int
    """Frame from which on 95 % of the particles are calm, or the last frame."""
    states: Recording
    """Every tenth state after `start`."""

    @classmethod
    def of(
        cls,
        scene: Scene,
        *,
        warm_up: int = 0,
        span: int = 200,
        until: int | None = None,
        threads: int = 1,
    ) -> "Truth":
        """Simulate a scene for `span` frames from the start, or up to the frame `until` where given."""
        solver = MpmSolver(scene, substeps="reference", threads=threads)
        impact = first_impact(solver, LONGEST_FALL)
        start = max(impact, warm_up)
        solver.advance(start - impact)
        run = record(solver, span if until is None else (until - start) // EVERY * EVERY, every=EVERY)
        pushes = np.diff(run.velocities, axis=0) / (EVERY * scene.frame_dt)
        calm = np.mean(np.linalg.norm(pushes, axis=2) < _CALM, axis=1) > _CALM_SHARE
        ends = run.frames[1:][calm & (run.frames[1:] > impact + EVERY)]
        return cls(
            impact=impact,
            start=start,
            calm=int(ends[0]) if len(ends) else int(run.frames[-1]),
            states=dataclasses.replace(
                run, frames=run.frames[1:], positions=run.positions[1:], velocities=run.velocities[1:]
            ),
        )

    @cached_property
    def _masses(self) -> _Floats:
        """Normalised grid masses (F, K) of the states, for many comparisons."""
        return np.stack([self._normalised(x, self.states.mass) for x in self.states.positions])

    @cached_property
    def _norms(self) -> _Floats:
        return np.asarray(np.linalg.norm(self._masses, axis=1))

    def rmse(self, row: int, x: _Floats, mass: _Floats) -> float:
        """Return the `grid_rmse` of particles (n, D), (n,) against the state `row`, in single precision."""
        apart = self._normalised(x, mass) - self._masses[row]
        return float(np.sqrt(np.dot(apart, apart)) / self._norms[row])

    def nrmse_over_rmse(self, row: int) -> float:
        """Return by what a `grid_rmse` against the state `row` has to be multiplied for the `grid_nrmse`."""
        true = self._masses[row]
        return float(self._norms[row] / (np.sqrt(true.size) * true.max()))

    def _normalised(self, x: _Floats, mass: _Floats) -> _Floats:
        nodes = metrics.grid_mass(x, mass, self.states.scene.resolution).ravel()
        return np.asarray(nodes / np.float32(nodes.sum(dtype=np.float64)))

    def still(self) -> Recording:
        """Return the initial state, held at rest."""
        x = self.states.scene.sample().x
        held = np.broadcast_to(x, (len(self.states.frames), *x.shape)).astype(np.float32)
        return dataclasses.replace(self.states, positions=held, velocities=np.zeros_like(held))

    def rollout(self, simulator: Simulator) -> tuple[Recording, list[_Counts]]:
        """Simulate the frames of the truth, and return their states; raises `SimulationError`.

        The counts are the numbers of frames so far that MPM did not simulate, by their source, at the start
        and at each state.
        """
        simulator.advance(self.start - simulator.frame)
        counts, positions, velocities = [_counts(simulator)], [], []
        for frame in self.states.frames.tolist():
            simulator.advance(frame - simulator.frame)
            positions.append(simulator.positions)
            velocities.append(simulator.velocities)
            counts.append(_counts(simulator))
        run = Recording(
            scene=simulator.scene,
            ids=simulator.ids,
            types=simulator.materials,
            mass=simulator.mass,
            frames=self.states.frames,
            positions=np.array(positions),
            velocities=np.array(velocities),
        )
        return run, counts


def shares(truth: Truth, counts: list[_Counts], *, is_whole: bool) -> dict[str, float]:
    """Return the shares of the frames by their source.

    `mpm_share`, `network`, `free_fall` and `rest` are shares of the counted frames, or of all frames where
    `is_whole`. `contact` is the share of the frames in contact that the network simulated: those from the
    start until the truth is calm.
    """
    first = dict.fromkeys(counts[0], 0) if is_whole else counts[0]
    frames = int(truth.states.frames[-1]) - (0 if is_whole else truth.start)
    found = {name: (counts[-1][name] - first[name]) / frames for name in first}
    in_contact = max((truth.calm - truth.start) // EVERY, 1)
    touching = counts[in_contact]["network"] - counts[0]["network"]
    return {"mpm_share": 1 - sum(found.values()), **found, "contact": touching / (in_contact * EVERY)}


def errors(run: Recording, truth: Truth) -> dict[str, float]:
    """Return those of `MEASURES` whose frames are there.

    `error` is the mean of `grid_rmse` over the states, `error_40` that of the state 40 frames after the
    start. `transport` is the distance of transport [m] by an assignment of 300 clusters, `density_error` the
    relative error of the 99th percentile of the density at the particles: means over the frames of `AT`. All
    others are means over the states of the errors of `metrics.compare`.
    """
    true = truth.states
    measured, rows = metrics.compare(run, true), _rows(true)
    moved = [
        metrics.transport_distance(run.positions[row], run.mass, true.positions[row], true.mass)
        for row in rows.values()
    ]
    at = list(rows.values())
    dense, right = (densities(one.scene, one.positions[at], one.mass, one.types) for one in (run, true))
    return {
        **{name: float(measured[name].mean()) for name in _MEANS},
        "error": float(measured["grid_rmse"].mean()),
        **{f"error_{frame}": float(measured["grid_rmse"][row]) for frame, row in rows.items()},
        "transport": float(np.mean(moved)),
        "density_error": float(np.mean(np.abs(dense / right - 1))),
    }


def grid_errors(run: Recording, truth: Truth) -> dict[str, float]:
    """Return `error`, its readings at the frames of `AT`, and `grid_nrmse` of `errors`, which are quick."""
    true = truth.states
    inside = np.clip(run.positions, 0, 1)
    rmse = np.array([truth.rmse(row, x, run.mass) for row, x in enumerate(inside)])
    scales = np.array([truth.nrmse_over_rmse(row) for row in range(len(rmse))])
    at = {f"error_{frame}": float(rmse[row]) for frame, row in _rows(true).items()}
    return {"error": float(rmse.mean()), "grid_nrmse": float((rmse * scales).mean())} | at


def _rows(true: Recording) -> dict[int, int]:
    """Return the rows of the frames of `AT` that are there."""
    return {frame: frame // EVERY - 1 for frame in AT if frame // EVERY <= len(true.frames)}


def _counts(simulator: Simulator) -> _Counts:
    if isinstance(simulator, HybridSimulator):
        steps = simulator.step_counts
        return {"network": steps.network, "free_fall": steps.free_fall, "rest": steps.rest}
    by_network = 0
    if isinstance(simulator, NeuralPhysics):
        by_network = sum(max(0, simulator.frame - decision.frame) for decision in simulator.log)
    return {"network": by_network, "free_fall": 0, "rest": 0}


def densities(
    scene: Scene, x: _Floats, mass: _Floats, types: npt.NDArray[np.integer]
) -> npt.NDArray[np.float64]:
    """Return the 99th percentile of the density of states x (..., N, D), over that at rest [-]."""
    rest = {material.type_id: material.density for material in scene.materials}
    volumes = mass / np.array([rest[kind] for kind in types.tolist()])
    return metrics.density_percentile(x, volumes, scene.resolution)
