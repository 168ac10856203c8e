"""Findings about emitters: the number of particles that they add."""

from collections.abc import Iterator

from hybridmpm.checking.report import Finding
from hybridmpm.scene import Scene

_GROWTH = 2.0
"""Note emitters that multiply the particle count by at least this."""


def of_openings(scene: Scene) -> Iterator[Finding]:
    """Yield the findings about the emitters of a scene; solvers refuse one that opens into a solid."""
    added = [emitted(scene, index) for index in range(len(scene.emitters))]
    before = sum(body.measure for body in scene.bodies) / scene.spacing**scene.dim
    after = min(before + sum(added), scene.max_particles)
    if added and after > _GROWTH * max(before, 1.0):
        full = ", where max_particles stops them" if before + sum(added) > scene.max_particles else ""
        longer = f", and a frame then takes about {after / max(before, 1.0):.2g} times as long as the first"
        growth = longer if before >= 1 else ""
        yield Finding(
            severity="note",
            field="emitters",
            problem=f"bring the scene from {before:.0f} to up to {after:.0f} particles by frame "
            f"{scene.frames}{full}{growth}",
            advice="lower max_particles, or give the emitters an earlier stop, if that is too many",
        )


def emitted(scene: Scene, index: int, frames: int | None = None) -> float:
    """Return the number of particles that an emitter adds in so many frames, if nothing blocks it.

    `frames` is the suggested length of the scene if absent.
    """
    emitter = scene.emitters[index]
    end = (scene.frames if frames is None else frames) * scene.frame_dt
    seconds = max(0.0, min(end, end if emitter.stop is None else emitter.stop) - emitter.start)
    return len(emitter.sites(scene.spacing)) * emitter.speed * seconds / scene.spacing
