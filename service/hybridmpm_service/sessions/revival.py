"""Computing a session again, from its file or from its log."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from hybridmpm import SOLVER_VERSION, SnapshotError
from hybridmpm.checking import Finding
from hybridmpm.control import Led, plan_motion, restored
from hybridmpm_service.errors import FieldError, ServiceError, StorageError
from hybridmpm_service.sessions.inputs import Inputs, Origin, SketchInput, Versions
from hybridmpm_service.sessions.journal import MAX_INPUTS, Journal
from hybridmpm_service.sessions.player import Clock
from hybridmpm_service.sessions.session_file import SessionFile
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverFactory


@dataclass(frozen=True, kw_only=True)
class SessionLog:
    """Scene, simulator and inputs of a session from frame 0 to the present one."""

    origin: Origin
    frame: int
    """The present frame."""
    inputs: Inputs
    """All inputs, in the order in which they acted."""
    digest: str
    """Digest of the state at the present frame, as `Particles.digest` returns it."""


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
    return SessionLog(origin=origin, frame=particles.frame, inputs=inputs, digest=particles.digest())


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
    inputs: Inputs,
    until: int,
    guidances: Mapping[int, Led] | None = None,
    *,
    first: int = 0,
    check: Callable[[], object] = lambda: None,
) -> None:
    """Advance a simulation to a frame, with the pending inputs of its journal acting as they did.

    Parameters
    ----------
    simulation : Simulation
        At the frame of the first pending input or before.
    inputs : Inputs
        All inputs, in the order in which they acted.
    until : int
        Frame to stop at; inputs that act from it on are given, too.
    guidances : mapping, optional
        Guidances of sketches by the place of the sketch among the inputs. Other sketches are planned again,
        in the state of their frame.
    first : int
        Place of the first pending input.
    check : callable, optional
        Called between frames and during plans; its exception ends the replay.

    Raises
    ------
    SimulationError, SketchError
        A frame or a plan failed.
    StorageError
        A sketch has no plan, and was drawn before the present frame; or the inputs are not in order.
    """
    plans, place = dict(guidances or {}), first
    missing = [one for one in inputs.sketches if one >= first and one not in plans]
    drawn = {one: inputs.sketch(one) for one in missing}
    stops = sorted({until, *inputs.frames[first:], *(one.drawn_frame for one in drawn.values())})
    for stop in (stop for stop in stops if stop >= simulation.frame):
        while simulation.frame < stop:
            check()
            simulation.advance(1)
        for number, sketch in drawn.items():
            if sketch.drawn_frame == stop:
                check()
                plans[number] = plan_motion(
                    simulation.copy(), sketch.goals(), on_frame=check, **sketch.settings.model_dump()
                )
                # If this is interrupted, it goes on after the frame for which the sketch was planned.
                simulation.journal.plan(number, plans[number].snapshot)
        while place < len(inputs) and inputs.frames[place] == stop:
            one = inputs[place]
            if isinstance(one, SketchInput) and place not in plans:
                raise StorageError(f"the plan of sketch {one.number} is missing")
            simulation.journal.acted()
            simulation.act(one, plans.get(place))
            place += 1
    if place < len(inputs):
        raise StorageError(f"an input of frame {inputs.frames[place]} comes after one of a later frame")


def revived_from_file(
    file: SessionFile, solvers: SolverFactory, clock: Clock, *, patient: bool
) -> Revived | None:
    """Return the simulation of a file, which keeps it from now on.

    It continues from the checkpoint, and the inputs after that act again. A checkpoint of another solver
    version is not used: everything is computed again from frame 0. A pushing hand lets go.

    Parameters
    ----------
    file : SessionFile
    solvers : SolverFactory
    clock : Clock
    patient : bool
        Whether everything may be computed again from frame 0; if not, None is returned instead.

    Raises
    ------
    StorageError
        The file cannot be read, or is damaged.
    SimulationError, FieldError, ModelDamagedError
        The simulator cannot be made again, or a frame fails.
    """
    stored = file.read()
    origin, checkpoint, inputs, notice = stored.origin, stored.checkpoint, stored.inputs, stored.notice
    chosen = solvers.make(origin.choice, origin.scene, origin.scenario)
    versions = Origin.of(origin.scene, chosen, None, None).versions
    simulation = Simulation(chosen, clock=clock)
    frames = [stored.reached, *inputs.frames]
    until = max(frames if checkpoint is None else [*frames, checkpoint.frame])
    unlike, first, complete = why_unlike(origin.versions, versions), stored.acted, stored.complete
    again = unlike is not None and (until > 0 or bool(inputs))
    if again:
        notice = f"The session may differ from its former state: {unlike}."
    elif checkpoint is not None:
        try:
            simulation.restore(checkpoint)
            if simulation.frame != checkpoint.frame:
                raise StorageError(f"its checkpoint is of frame {simulation.frame}, not {checkpoint.frame}")
        except SnapshotError as err:
            again = True
            notice = f"Its checkpoint cannot be used, and it was computed again from frame 0: {err}"
    guidances = {}
    if not again:
        pending = ((place, data) for place, data in stored.guidances.items() if place >= first)
        guidances = {place: restored(data, origin.scene) for place, data in pending}
    else:
        if not patient:
            return None
        if checkpoint is not None and not complete:
            notice = (
                "The session begins anew: another version has computed it, and its inputs are not all kept."
            )
            inputs, until, complete = Inputs(), 0, True
        # If this is interrupted, it goes on from its own checkpoints.
        origin = replace(origin, versions=versions)
        file.rewrite(inputs, origin=origin, reached=until, complete=complete, notice=notice)
        simulation.reset()
        first = 0
    simulation.journal = Journal(
        inputs,
        complete=complete,
        pending=len(inputs) - first,
        sketches=stored.sketches,
        links=stored.links,
    )
    simulation.journal.keep_in(file)
    replay(simulation, inputs, until, guidances, first=first)
    simulation.let_go()
    return Revived(simulation, origin, notice)


def revived_from_log(
    log: SessionLog,
    chosen: ChosenSolver,
    clock: Clock,
    check: Callable[[], object] = lambda: None,
) -> Revived:
    """Return the simulation of a log, computed again from frame 0.

    Parameters
    ----------
    log : SessionLog
    chosen : ChosenSolver
        Simulator of the log at frame 0.
    clock : Clock
    check : callable, optional
        As in `replay`.

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
    late = next((frame for frame in log.inputs.frames if frame > log.frame), None)
    if late is not None:
        raise FieldError("body.log.inputs", f"an input acts in frame {late}, after the end at {log.frame}")
    numbers = (log.inputs.sketch(place).number for place in log.inputs.sketches)
    simulation.journal = Journal(log.inputs, sketches=max(numbers, default=0), pending=len(log.inputs))
    replay(simulation, log.inputs, log.frame, check=check)
    notice = None
    if simulation.particles().digest() != log.digest:
        unlike = why_unlike(origin.versions, present.versions)
        reason = unlike or "the log was changed, or made where arithmetic differs"
        notice = f"The state is not the one that the log ends with: {reason}."
    return Revived(simulation, present, notice)
