"""Rollouts of a network on held-out trajectories during training: errors and pictures."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from PIL import Image

from hybridmpm import metrics
from hybridmpm._support.files import replacing
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.physics.spec import HISTORY
from hybridmpm.render import side_by_side, view_of
from hybridmpm.scene.particle_types import KINEMATIC
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.trainer import Trainer
from hybridmpm.training.physics.windows import edges_of, known_acceleration
from hybridmpm.training.run import log_row

ROLLOUTS, PICTURE = "rollouts.jsonl", "rollout.png"

_PICTURES = 5
_WIDTH = 240


def log_rollouts(trainer: Trainer, folder: Path, held_out: Sequence[Trajectory]) -> None:
    """Roll out on held-out trajectories; add their errors to `rollouts.jsonl`, and draw `rollout.png`.

    Raises
    ------
    ExportError
        The picture cannot be written.
    """
    paths = [rollout(trainer.simulator, trajectory) for trajectory in held_out]
    for trajectory, path in zip(held_out, paths, strict=True):
        found = errors(path, trajectory)[HISTORY:]
        at = {f"step_{step}": found[step - 1] for step in (10, 25, 50) if step <= len(found)}
        row = {
            "trained_steps": trainer.step_count,
            "scene": trajectory.scene.name if trajectory.scene else "",
            **at,
        }
        log_row(folder / ROLLOUTS, row | {"mean": found.mean()})
    write_picture(folder / PICTURE, held_out, paths)


@torch.no_grad()
def rollout(simulator: LearnedSimulator, trajectory: Trajectory) -> npt.NDArray[np.float32]:
    """Predict a trajectory from its first six states on, over its whole length.

    Returns
    -------
    float32 (F, N, D)
        Positions [m]; the first six states are the trajectory's.
    """
    device = next(simulator.parameters()).device
    types = torch.from_numpy(trajectory.types).to(device)
    acceleration, corners = known_acceleration(trajectory, 0, len(trajectory.positions) - 1)
    walls = torch.from_numpy(corners).to(device).unsqueeze(1)
    path = trajectory.positions.copy()
    for state in range(HISTORY, len(path)):
        history = torch.from_numpy(path[state - HISTORY : state]).to(device)
        graph = edges_of(history[-1], types, (len(types),), simulator.spec.radius)
        known = torch.from_numpy(acceleration[state - 1]).to(device)
        path[state] = simulator(history, types, known, walls, graph).cpu().numpy()
    return path


def errors(path: npt.NDArray[np.float32], trajectory: Trajectory) -> npt.NDArray[np.float64]:
    """Return the `grid_rmse` (F,) of each state of a path (F, N, D) [m] against the trajectory.

    The grid has as many particles per cell as the scene.
    """
    scene = trajectory.scene
    moving = trajectory.types != KINEMATIC
    mass = np.ones(int(moving.sum()), np.float32) if trajectory.mass is None else trajectory.mass[moving]
    assert scene is not None  # noqa: S101 - training data sets contain scenes
    thinning = len(mass) / len(scene.sample().x)
    resolution = max(8, round(scene.resolution * thinning ** (1 / scene.dim)))
    return np.array(
        [
            float(
                metrics.grid_rmse(
                    metrics.grid_mass(np.ascontiguousarray(one[moving]), mass, resolution),
                    metrics.grid_mass(np.ascontiguousarray(two[moving]), mass, resolution),
                )
            )
            for one, two in zip(path, trajectory.positions, strict=True)
        ]
    )


def write_picture(
    file: Path, trajectories: Sequence[Trajectory], paths: Sequence[npt.NDArray[np.float32]]
) -> None:
    """Write a .png with two rows for each trajectory, truth above rollout; may raise `ExportError`."""
    rows = [
        _row(trajectory, states)
        for trajectory, path in zip(trajectories, paths, strict=True)
        for states in (trajectory.positions, path)
    ]
    with replacing(file) as part:
        Image.fromarray(np.concatenate(rows)).save(part, optimize=True)


def _row(trajectory: Trajectory, states: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    moving = trajectory.types != KINEMATIC
    assert trajectory.scene is not None  # noqa: S101 - training data sets contain scenes
    view = view_of(trajectory.scene, trajectory.types[moving].astype(np.uint8), _WIDTH)
    pictures = []
    for state in np.linspace(HISTORY - 1, len(states) - 1, _PICTURES).round().astype(int):
        x = np.ascontiguousarray(states[state][moving])
        pictures.append(view.draw(x, x - states[state - 1][moving], float(state)))
    return side_by_side(pictures)
