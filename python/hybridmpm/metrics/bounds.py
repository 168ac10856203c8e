"""Bounds of errors: floors that no method can be expected to beat, and a ceiling.

In a chaotic flow a floor is the error of the truth against the truth with other jitter. For a method with
fewer particles, another floor is the error of the truth merged into as many particles. The ceiling is the
error of the initial state held still.
"""

import dataclasses

import numpy as np

from hybridmpm.coarse import merge
from hybridmpm.recording import Recording
from hybridmpm.scene import Particles, Scene

_SEEDS = 2**53


def other_jitter(scene: Scene, shift: int = 1) -> Scene:
    """Return the scene with another jitter of its particles: `shift` is added to the seed of each body."""
    bodies = tuple(body.model_copy(update={"seed": (body.seed + shift) % _SEEDS}) for body in scene.bodies)
    return scene.model_copy(update={"bodies": bodies})


def held_still(recording: Recording) -> Recording:
    """Return the recording with its first state, at rest, in place of all others."""
    first = np.broadcast_to(recording.positions[:1], recording.positions.shape)
    return dataclasses.replace(recording, positions=first, velocities=np.zeros_like(recording.velocities))


def merged_states(recording: Recording, r_p: float, *, seed: int = 0) -> Recording:
    """Return a recording with each state merged on its own, as `coarse.merge` does.

    No method with so few particles can do better. Only particles of the same type and mass are merged with
    each other. A particle of one state does not correspond to the particle of this index in another state.

    Raises
    ------
    ConfigError
        `r_p` is not in (0, 1].
    """
    kinds = np.stack([recording.types, recording.mass], axis=1)
    group = np.unique(kinds, axis=0, return_inverse=True)[1].astype(np.int32)
    states = [
        merge(
            Particles(
                x=x, v=v, material=recording.types, types=recording.types, body=group, mass=recording.mass,
                # `merge` needs volumes; the merged volumes are not used.
                volume=recording.mass,
            ),
            r_p,
            seed=seed,
        )
        for x, v in zip(recording.positions, recording.velocities, strict=True)
    ]  # fmt: skip
    return dataclasses.replace(
        recording,
        # Cluster sizes depend on the number of clusters alone, so all states have the same types and masses.
        types=states[0].types,
        mass=states[0].mass,
        positions=np.stack([state.x for state in states]),
        velocities=np.stack([state.v for state in states]),
    )
