"""Computing a session again, from its file or from its log."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hybridmpm import SOLVER_VERSION, CancelFlag, FrameCancelledError, SnapshotError
from hybridmpm.checking import Finding
from hybridmpm.control import Guidance, prepare
from hybridmpm_service.errors import FieldError, ServiceError
from hybridmpm_service.sessions.inputs import Input, Origin, PushInput, SketchInput, Versions
from hybridmpm_service.sessions.journal import MAX_INPUTS, Journal, SessionFile
from hybridmpm_service.sessions.player import Clock
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverFactory
from hybridmpm_service.sessions.view import Particles


@dataclass(frozen=True, kw_only=True)
class SessionLog:
    """Scene, simulator and inputs of a session from frame 0 to the present one."""

    origin: Origin
    frame: int
    """The present frame."""
    inputs: tuple[Input, ...]
    """All inputs, in the order in which they acted."""
    digest: str
    """Digest of the state at the present frame, as `digest_of` returns it."""


@dataclass(frozen=True)
class Revived:
    """A simulation in the state that it was left in."""

    simulation: Simulation
    origin: Origin
    notice: str | None
    """Remark on its state; None if it has the bits that it had."""
    findings: tuple[Finding, ...] = ()
    """Static findings of its scene."""


def log_of(origin: Origin, simulation: Simulation) -> SessionLog:
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
            f"{SOLVER_VERSION}, whose frames differ"
        )
    if made_by.model != now.model:
        return "it was computed with another version of the network"
    return None


def replay(
    simulation: Simulation,
    inputs: Sequence[Input],
    until: int,
    guidances: Mapping[int, Guidance] | None = None,
    check: Callable[[], object] = lambda: None,
) -> None:
    """Advance a simulation to a frame, with the inputs acting as they did.

    Parameters
    ----------
    simulation : Simulation
        At the frame of the first input or before.
    inputs : sequence of Input
        In the order in which they acted.
    until : int
        Frame to stop at; inputs that act from it on are given, too.
    guidances : mapping, optional
        Guidances of sketches by the place of the sketch among the inputs. Other sketches are planned again,
        in the state of their frame.
    check : callable, optional
        Called between frames and during plans; its exception ends the replay.

    Raises
    ------
    SimulationError, SketchError
        A frame or a plan failed.
    """
    plans = dict(guidances or {})
    drawn = {
        place: one for place, one in enumerate(inputs) if isinstance(one, SketchInput) and place not in plans
    }
    stops = sorted({one.frame for one in inputs} | {one.drawn_frame for one in drawn.values()} | {until})
    waiting = list(enumerate(inputs))
    for stop in (stop for stop in stops if stop >= simulation.frame):
        check()
        simulation.advance(stop - simulation.frame)
        for place, sketch in drawn.items():
            if sketch.drawn_frame == stop:
                plans[place] = prepare(
                    simulation.copy(), sketch.sketch.sketch(), on_frame=check, **sketch.settings.model_dump()
                )
        while waiting and waiting[0][1].frame == stop:
            place, one = waiting.pop(0)
            _act(simulation, one, plans.get(place))


def _act(simulation: Simulation, one: Input, guidance: Guidance | None) -> None:
    if isinstance(one, PushInput):
        simulation.hand = None if one.push is None else one.push.push()
    elif guidance is not None and isinstance(one, SketchInput):
        simulation.steer(guidance, one.number, one.settings.model_dump())
    else:
        simulation.release()


def revived_from_file(file: SessionFile, solvers: SolverFactory, clock: Clock) -> Revived:
    """Return the simulation of a file, which keeps it from now on.

    It continues from the checkpoint, and the inputs after that act again. A checkpoint of another solver
    version is not used: everything is computed again from frame 0. A pushing hand has let go.

    Raises
    ------
    StorageError
        The file cannot be read, or is damaged.
    SimulationError, FieldError, ModelDamagedError
        The simulator cannot be made again, or a frame fails.
    """
    stored = file.read()
    origin = stored.origin
    chosen = solvers.make(origin.choice, origin.scene, origin.scenario)
    versions = Origin.of(origin.scene, chosen, None, None).versions
    checkpoint = stored.checkpoint
    notice, restored = None, False
    simulation = Simulation(chosen, clock=clock)
    if checkpoint is not None and versions == origin.versions:
        try:
            simulation.restore(checkpoint)
            restored = True
        except SnapshotError as err:
            notice = f"Its checkpoint cannot be used, and it was computed again from frame 0: {err}"
    first = stored.checked if restored else 0
    simulation.journal = Journal(stored.inputs[:first], complete=stored.complete)
    if checkpoint is not None and not restored:
        unlike = why_unlike(origin.versions, versions)
        notice = notice or (
            None if unlike is None else f"The session may differ from its former state: {unlike}."
        )
        if not stored.complete:
            notice = (
                "The session begins anew: another version has computed it, and its inputs are not all kept."
            )
    frames = [stored.reached, *(one.frame for one in stored.inputs)]
    until = max(frames if checkpoint is None else [*frames, checkpoint.frame])
    if stored.complete or restored:
        guidances = {
            place - first: Guidance.restored(data, origin.scene)
            for place, data in stored.guidances.items()
            if place >= first
        }
        replay(simulation, stored.inputs[first:], until, guidances)
    simulation.hand = None
    simulation.journal.keep_in(file, simulation.computed_seconds)
    if not restored and checkpoint is not None:
        simulation.journal.check(simulation.computed_seconds, simulation.checkpoint)
    return Revived(simulation, origin, notice)


def revived_from_log(log: SessionLog, chosen: ChosenSolver, clock: Clock, cancel: CancelFlag) -> Revived:
    """Return the simulation of a log, computed again from frame 0.

    Parameters
    ----------
    log : SessionLog
    chosen : ChosenSolver
        Simulator of the log at frame 0.
    clock : Clock
    cancel : CancelFlag
        Ends the computation.

    Raises
    ------
    FieldError
        An input is out of range.
    SimulationError, SketchError
        A frame or a plan fails.
    """
    origin = log.origin
    present = Origin.of(origin.scene, chosen, origin.scenario, origin.seed)
    simulation = Simulation(chosen, clock=clock)
    simulation.cancel_by(cancel)

    def check() -> None:
        if cancel.is_set:
            raise FrameCancelledError("the client of the session has gone")

    late = next((one.frame for one in log.inputs if one.frame > log.frame), None)
    if late is not None:
        raise FieldError("body.log.inputs", f"an input acts in frame {late}, after the end at {log.frame}")
    replay(simulation, log.inputs, log.frame, check=check)
    notice = None
    if digest_of(simulation.particles()) != log.digest:
        unlike = why_unlike(origin.versions, present.versions)
        reason = unlike or "the log was changed, or made where arithmetic differs"
        notice = f"The state is not the one that the log ends with: {reason}."
    return Revived(simulation, present, notice)
