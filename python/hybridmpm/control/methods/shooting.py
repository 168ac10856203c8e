"""Shooting: plans are tried on a coarse simulation, and the best is taken."""

import dataclasses
import time

import numpy as np

from hybridmpm.coarse.clustering import balanced_clusters
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.goal import Goal, goal_of
from hybridmpm.control.goal.ways import Ways
from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.analytic import arrival
from hybridmpm.control.methods.cma_es import minimise
from hybridmpm.control.methods.method import Task
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.simulator import Simulator

_RATIO = 1 / 12
"""Ratio of the coarse particles to those of the scene; a trial of 100 frames takes about 12 ms."""
_BUDGET = 2.0
"""Time of the search if none is given [s]."""
_SCALE = 0.05
"""First standard deviation of the lengths that are searched [m]."""
_LATEST = 0.5
"""Smallest share of the frames in which the goal is reached."""
_TIMING = 0.15
"""First standard deviation of that share."""


class Shooting:
    """Searches for a plan that a coarse simulation carries out better than the analytic one.

    Searched are a shift of the goal, a bow of all ways to a side, and the share of the frames in which the
    goal is to be reached, by CMA-ES. The measure is the share of the mass outside of the goal when the frames
    are over, plus the root mean square distance of the particles from their places. The analytic plan is the
    first trial. The search takes the time of `Task.budget`; how many trials fit depends on the machine. At
    the end the best plan and the analytic one are tried on the simulator itself, which takes as long as their
    frames, and the better one is taken.
    """

    name = "shooting"

    def plan(self, simulator: Simulator, task: Task) -> Tracked:
        """Return the law of the best plan.

        Raises
        ------
        ConfigError
            The scene has emitters or sinks, or is too coarse to be coarsened.
        """
        if simulator.scene.is_open:
            raise ConfigError(
                "shooting needs a scene without emitters and sinks: use the method analytic for this one"
            )
        end = time.perf_counter() + (_BUDGET if task.budget is None else task.budget)
        level = _Level(simulator, task)
        dim = simulator.dim
        scale = np.append(np.full(2 * dim, _SCALE), _TIMING)
        best = minimise(level.miss, scale, go_on=lambda _: time.perf_counter() < end, seed=task.seed).x
        laws = [
            _planned(task, task.goal.ways, numbers, level.arrival) for numbers in (np.zeros_like(best), best)
        ]
        # The coarse level is not the simulator: both plans are tried on that, and as it is deterministic, the result
        # is never worse than the analytic plan.
        return min(laws, key=lambda law: _miss(simulator, task, law))


class _Level:
    """A coarse simulation of the present state, on which plans are tried."""

    def __init__(self, simulator: Simulator, task: Task) -> None:
        scene = simulator.scene
        ratio = _RATIO * simulator.r_p
        self._solver = MpmSolver(scene, r_p=ratio)
        x = np.empty((self._solver.particle_count, scene.dim))
        v = np.empty_like(x)
        fine = simulator.positions.astype(np.float64), simulator.velocities.astype(np.float64)
        for kind in np.unique(self._solver.materials):
            rows = np.flatnonzero(self._solver.materials == kind)
            members = np.flatnonzero(simulator.materials == kind)
            labels = balanced_clusters(fine[0][members], len(rows), seed=task.seed)
            sizes = np.bincount(labels)[:, None]
            for whole, merged in zip(fine, (x, v), strict=True):
                sums = [np.bincount(labels, column) for column in whole[members].T]
                merged[rows] = np.stack(sums, axis=1) / sizes
        self._solver.prescribe(x, v, simulator.frame)
        self.arrival = arrival(task)
        """Share of the frames in which the analytic plan reaches the goal."""
        goal = goal_of(task.goal.sketch, Cloud.of(self._solver), scene, fill=task.fill)
        self._task = dataclasses.replace(task, goal=goal)

    def miss(self, numbers: Floats) -> float:
        """Return how far a plan misses the goal; infinite where it fails."""
        task = self._task
        return _miss(self._solver, task, _planned(task, task.goal.ways, numbers, self.arrival))


def _miss(simulator: Simulator, task: Task, law: Tracked) -> float:
    """Try a law on a copy; return the share of the mass outside of the goal plus the rms distance [m]."""
    twin = simulator.copy()
    try:
        for index in range(task.frames):
            task.on_frame()
            twin.advance(1, law.force(twin, index))
    except SimulationError:
        return float("inf")
    goal, x = task.goal, twin.positions.astype(np.float64)
    square = float(goal.cloud.weight @ ((x - goal.ways.places) ** 2).sum(axis=1))
    inside = goal.inside(x)
    outside = 0.0 if inside is None else 1 - float(goal.cloud.weight @ inside)
    return outside + float(np.sqrt(square))


def _planned(task: Task, ways: Ways, numbers: Floats, arrival: float) -> Tracked:
    """Return the law of ways with a shift (D,), a bow (D,) and what is added to the share of the frames."""
    dim = task.goal.cloud.dim
    shift, bow = numbers[:dim], numbers[dim : 2 * dim]
    share = float(np.clip(arrival + numbers[-1], _LATEST, 1))
    if not numbers.any():
        return task.tracked(ways, share=share)
    return task.tracked(_bent(ways, task.goal, shift, bow), share=share)


def _bent(ways: Ways, goal: Goal, shift: Floats, bow: Floats) -> Ways:
    """Shift the ends of ways, and bend each to a side by a bow that is largest in its middle."""
    starts, corners = [0], []
    for first, last in zip(ways.starts[:-1], ways.starts[1:], strict=True):
        way = ways.corners[first:last]
        if len(way) == 2:
            way = np.stack([way[0], way.mean(axis=0), way[1]])
        done = np.linspace(0, 1, len(way))[:, None]
        corners.append(way + done * shift + np.sin(np.pi * done) * bow)
        starts.append(starts[-1] + len(way))
    return dataclasses.replace(
        ways,
        places=np.clip(ways.places + shift, goal.room.lower, goal.room.upper),
        starts=np.array(starts, dtype=np.uint32),
        corners=np.clip(np.concatenate(corners), goal.room.lower, goal.room.upper),
    )
