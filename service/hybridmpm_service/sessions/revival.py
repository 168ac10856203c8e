"""A simulation that goes on from what is left of it: its file, or its log."""

from dataclasses import dataclass

from hybridmpm import CancelFlag, FrameCancelledError, SnapshotError
from hybridmpm.checking import Finding
from hybridmpm.control import Guidance
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.journal.journal import Journal
from hybridmpm_service.sessions.journal.log import SessionLog, digest_of, why_unlike
from hybridmpm_service.sessions.journal.origin import Origin, Versions
from hybridmpm_service.sessions.journal.replay import replay
from hybridmpm_service.sessions.journal.session_file import SessionFile
from hybridmpm_service.sessions.playing.pace import Clock
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverFactory


@dataclass(frozen=True)
class Revived:
    """A simulation in the state that it was left in."""

    simulation: Simulation
    origin: Origin
    notice: str | None
    """What there is to say about it; None if it has the bits that it had."""
    findings: tuple[Finding, ...] = ()
    """What a check of its scene says."""


def revived_from_file(file: SessionFile, solvers: SolverFactory, clock: Clock) -> Revived:
    """Return the simulation of a file, which keeps it from now on.

    It goes on from the checkpoint; the inputs after that act again. Where another version of the solver has
    written the checkpoint, everything is computed again from frame 0. A hand that pushed has let go.

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
            simulation.recall(checkpoint)
            restored = True
        except SnapshotError as err:
            notice = f"its checkpoint cannot be used, and it was computed again from frame 0: {err}"
    first = stored.checked if restored else 0
    simulation.journal = Journal(stored.inputs[:first], complete=stored.complete)
    if checkpoint is not None and not restored:
        unlike = why_unlike(origin.versions, versions)
        notice = notice or (None if unlike is None else f"The session need not be as it was: {unlike}.")
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
        simulation.journal.check(simulation)
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
            raise FrameCancelledError("nobody waits for the session any more")

    late = next((one.frame for one in log.inputs if one.frame > log.frame), None)
    if late is not None:
        raise FieldError("body.log.inputs", f"an input acts in frame {late}, after the end at {log.frame}")
    replay(simulation, log.inputs, log.frame, check=check)
    return Revived(simulation, present, _notice(log, simulation, origin.versions, present.versions))


def _notice(log: SessionLog, simulation: Simulation, made_by: Versions, now: Versions) -> str | None:
    unlike = why_unlike(made_by, now)
    if digest_of(simulation.particles()) == log.digest:
        return None
    reason = unlike or "the log was changed, or made where arithmetic differs"
    return f"The state is not the one that the log ends with: {reason}."
