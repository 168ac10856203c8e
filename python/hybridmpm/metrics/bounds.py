"""What errors are read against: the floors that no method should be asked to beat, and the ceiling.

The floor of a chaotic flow is the truth against itself with other jitter, that of a method with fewer
particles also the truth merged into as many. The ceiling is the initial state held still.
"""

import dataclasses

import numpy as np

from hybridmpm.downsampling import merge
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
    """Merge each state of a recording on its own, as `downsampling.merge` does.

    This is the best that a method with so many particles could answer. Only particles of one type and mass
    are merged with each other. Particles of different states do not correspond.

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
                # Nobody reads it: volumes are merged as masses are.
                volume=recording.mass,
            ),
            r_p,
            seed=seed,
        )
        for x, v in zip(recording.positions, recording.velocities, strict=True)
    ]  # fmt: skip
    return dataclasses.replace(
        recording,
        # Sizes of clusters follow from their number alone, so that every state has these.
        types=states[0].types,
        mass=states[0].mass,
        positions=np.stack([state.x for state in states]),
        velocities=np.stack([state.v for state in states]),
    )
