"""Computing `Normalization` from trajectories, in one pass."""

from collections.abc import Iterable

import numpy as np

from hybridmpm.data.statistics import Moments
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.scene.particle_types import KINEMATIC
from hybridmpm.training.physics.windows import known_acceleration


def normalization(trajectories: Iterable[Trajectory], spec: NetworkSpec, noise: float) -> Normalization:
    """Return the scales of a network from the trajectories it is trained on, without kinematic particles.

    Means along y are those of the data. Means along other axes are 0, because samples are mirrored at random.

    Parameters
    ----------
    trajectories : iterable of Trajectory
    spec : NetworkSpec
    noise : float >= 0
        Standard deviation of the training noise over that of the velocity, root mean square over the axes.
    """
    velocities, accelerations = Moments(), Moments()
    for trajectory in trajectories:
        moving = trajectory.types != KINEMATIC
        velocity = np.diff(trajectory.positions[:, moving].astype(np.float64), axis=0)
        known, _ = known_acceleration(trajectory, 0, len(velocity))
        velocities.add(velocity)
        accelerations.add(np.diff(velocity, axis=0) - known[1:, moving] * spec.step_dt**2)
    upright = np.arange(spec.dim) == 1
    noise_std = noise * float(np.sqrt(np.mean(np.square(velocities.std))))
    return Normalization(
        velocity_mean=tuple(np.where(upright, velocities.mean, 0.0)),
        velocity_std=_inflated(velocities, noise_std),
        acceleration_mean=tuple(np.where(upright, accelerations.mean, 0.0)),
        acceleration_std=_inflated(accelerations, noise_std),
        noise_std=noise_std,
    )


def _inflated(moments: Moments, noise_std: float) -> tuple[float, ...]:
    return tuple(float(np.hypot(std, noise_std)) for std in moments.std)
