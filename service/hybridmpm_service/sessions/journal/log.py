"""The log of a session: what it can be computed again from, elsewhere and later."""

import hashlib
from dataclasses import dataclass
from typing import Protocol

from hybridmpm import SOLVER_VERSION
from hybridmpm_service.errors import ServiceError
from hybridmpm_service.sessions.journal.inputs import Input
from hybridmpm_service.sessions.journal.journal import MAX_INPUTS, Journal
from hybridmpm_service.sessions.journal.origin import Origin, Versions
from hybridmpm_service.sessions.view import Particles


class Logged(Protocol):
    """What a log asks of a simulation."""

    journal: Journal

    def particles(self) -> Particles:
        """Return the state of all particles."""


@dataclass(frozen=True, kw_only=True)
class SessionLog:
    """Scene, simulator and inputs of a session from frame 0 to the present one."""

    origin: Origin
    frame: int
    """The present frame."""
    inputs: tuple[Input, ...]
    """All inputs, in the order in which they acted."""
    digest: str
    """Digest of the state at the present frame, as `digest_of` makes it."""


def log_of(origin: Origin, simulation: Logged) -> SessionLog:
    """Return the log of a simulation.

    Raises
    ------
    ServiceError
        There were more inputs than are kept.
    """
    inputs, particles = simulation.journal.inputs, simulation.particles()
    if inputs is None:
        raise ServiceError(
            f"the session has had more than {MAX_INPUTS} inputs since frame 0, and no longer has a log; "
            "a reset begins a new one"
        )
    return SessionLog(origin=origin, frame=particles.frame, inputs=inputs, digest=digest_of(particles))


def digest_of(particles: Particles) -> str:
    """Return the SHA-256 of ids (uint64), positions and velocities (float32), little-endian, one by one."""
    digest = hashlib.sha256(particles.ids.astype("<u8").tobytes())
    for array in (particles.positions, particles.velocities):
        digest.update(array.astype("<f4").tobytes())
    return digest.hexdigest()


def why_unlike(made_by: Versions, now: Versions) -> str | None:
    """Return why a session that is computed again need not have the same bits; None if it has to."""
    if made_by.solver != SOLVER_VERSION:
        return (
            f"it was computed by version {made_by.solver} of the solver and is computed again by version "
            f"{SOLVER_VERSION}, whose frames are others"
        )
    if made_by.model != now.model:
        return "it was computed with another version of the network"
    return None
