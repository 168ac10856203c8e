"""`ReversedCase`: one example of control, made from a forward run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics
from hybridmpm._support.arguments import whole
from hybridmpm.control.checks import positive
from hybridmpm.control.goal.cloud import EARTH, Cloud, Floats
from hybridmpm.control.reversal.retrace import Retraced
from hybridmpm.control.reversal.sketches import arrow_of, oval_of
from hybridmpm.control.reversal.smoothing import smoothed
from hybridmpm.control.sketch.sketch import Sketch
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver, Substeps
from hybridmpm.scene import Scene, Walls

Floats32 = npt.NDArray[np.float32]
Start = Literal["live", "reversed"]
"""Velocities at the start of control: those of the forward run, as in a session, or their negative."""
Kind = Literal["oval", "arrow"]
"""What the sketch is: an oval around the end, or an arrow from the start to the end."""
STARTS: tuple[Start, ...] = get_args(Start)
KINDS: tuple[Kind, ...] = get_args(Kind)

DEFAULT_FRAMES = 100
"""Frames of control of the paper."""
DEFAULT_CAP = 30.0
"""Largest force on a particle if none is given [g]."""
_MAX_FRAMES = 10_000
_MAX_CAP = 1000.0


@dataclass(frozen=True, eq=False, kw_only=True)
class ReversedCase:
    """A fluid that is led back to where it was T frames ago, and the sketch that asks for it.

    N is the number of particles, D the dimension. The forward run had the states p_0 to p_T, the last of them
    at `control_frame`. Control starts there, and q_tau = p_(T - tau) is where the particles are to be after
    tau frames: the target, of the sketch too, is q_T = p_0.
    """

    scene: Scene
    seed: int | None
    """Seed that the case was drawn from; None if it was not drawn."""
    control_frame: int
    """Frame of the forward run at which control starts."""
    start: Start
    """Whose velocities the particles have when control starts."""
    sketch: Sketch
    """What stands for the motion, without the tremor of a hand."""
    truth: Floats32
    """q_0 to q_T, (T + 1, N, D) [m]."""
    positions: Floats32
    """Where `forces` lead the solver, (T + 1, N, D) [m]; row 0 is that of `truth`."""
    velocities: Floats32
    """Velocities when control starts (N, D) [m/s]."""
    forces: Floats32
    """Accelerations besides gravity (T, N, D) [m/s^2]; row t acts from state t to t + 1."""
    smoothed_forces: Floats32
    """The forces after `smoothed`, (T, N, D) [m/s^2]."""
    mass: Floats32
    """Masses (N,) [kg]."""
    cap: float
    """Largest force on a particle that was allowed [g]."""
    substeps: Substeps
    """Rule for substeps, as in `MpmSolver`."""
    r_p: float
    """Number of particles over that of the scene."""
    snapshot: bytes
    """State of the solver when control starts."""

    @property
    def frames(self) -> int:
        """Number T of frames of control."""
        return len(self.forces)

    @property
    def kind(self) -> Kind:
        """What the sketch is."""
        return "arrow" if self.sketch.kind == "arrow" else "oval"

    @property
    def target(self) -> Floats32:
        """True positions at the end of control (N, D) [m]."""
        return np.asarray(self.truth[-1])

    @property
    def peak(self) -> float:
        """Largest force on a particle [g]."""
        return float(np.sqrt((self.forces.astype(np.float64) ** 2).sum(axis=2).max())) / EARTH

    @property
    def rms(self) -> float:
        """Root mean square of the force over particles and frames [g]."""
        return float(np.sqrt((self.forces.astype(np.float64) ** 2).sum(axis=2).mean())) / EARTH

    def simulator(self) -> MpmSolver:
        """Return a new solver in the state in which control starts."""
        solver = MpmSolver(self.scene, substeps=self.substeps, r_p=self.r_p)
        solver.restore(self.snapshot)
        return solver

    def law(self, cap: float | None = None) -> Retraced:
        """Return the law that gave `forces`; `cap` [g] allows more or less force than the case has."""
        return _retraced(self.scene, self.truth, self.cap if cap is None else cap)

    def error(self, x: npt.ArrayLike) -> float:
        """Return the grid RMSE [-] between positions x (N, D) [m] and `target`, on the scene's grid."""
        resolution = self.scene.resolution
        found, true = (
            metrics.grid_mass(np.clip(state, 0, 1), self.mass, resolution) for state in (x, self.target)
        )
        return metrics.grid_rmse(found, true)


def reversed_case(
    scene: Scene,
    *,
    control_frame: int,
    frames: int = DEFAULT_FRAMES,
    start: Start = "live",
    kind: Kind = "oval",
    shortest_arrow: float | None = None,
    cap: float = DEFAULT_CAP,
    substeps: Substeps = "reference",
    r_p: float = 1.0,
    seed: int | None = None,
    on_frame: Callable[[], object] = lambda: None,
) -> ReversedCase:
    """Simulate a scene, and lead its particles back along the way that they came.

    The forces are found inside the MPM loop, from the positions and velocities that the particles have: see
    `Retraced`.

    Parameters
    ----------
    scene : Scene
        Without emitters, sinks and moving obstacles, which do not run backwards.
    control_frame : int in [frames, 10000]
        Frame at which control starts.
    frames : int in [2, 10000]
        Frames of control T, and of the past that is reversed.
    start : "live" or "reversed"
        Whether the particles keep their velocities when control starts, or begin with the negative ones.
    kind : "oval" or "arrow"
        What the sketch is.
    shortest_arrow : float > 0, optional
        Distance [m] that the centre of mass must come in the front view; else the sketch is an oval, whatever
        `kind` says. If absent, an arrow is refused that has no length.
    cap : float in (0, 1000]
        Largest force on a particle [g].
    substeps, r_p
        As in `MpmSolver`.
    seed : int, optional
        Kept in the case.
    on_frame : callable
        Called before each frame; what it raises ends the work.

    Raises
    ------
    ConfigError
        An argument is out of range, or the scene does not run backwards.
    SketchError
        An arrow would be shorter than two pixels: the fluid's centre of mass is where it was.
    SimulationError
        A frame failed.
    """
    frames = whole("frames", frames, 2, _MAX_FRAMES)
    control_frame = whole("control_frame", control_frame, 0, _MAX_FRAMES)
    if control_frame < frames:
        raise ConfigError(
            f"control_frame must be at least frames = {frames}, the length of the past that is reversed, got "
            f"{control_frame}"
        )
    _require("start", start, STARTS)
    _require("kind", kind, KINDS)
    cap = positive("cap", cap, _MAX_CAP)
    if shortest_arrow is not None:
        shortest_arrow = positive("shortest_arrow", shortest_arrow)
    _require_reversible(scene)
    solver = MpmSolver(scene, substeps=substeps, r_p=r_p)
    truth = _past(solver, control_frame, frames, on_frame)[::-1].copy()
    sketch = _sketch(truth, Cloud.of(solver).weight, scene.walls, kind, shortest_arrow)
    if start == "reversed":
        solver.prescribe(solver.positions, -solver.velocities, control_frame)
    snapshot, velocities = solver.snapshot(), solver.velocities
    positions, forces = _led(solver, _retraced(scene, truth, cap), frames, on_frame)
    return ReversedCase(
        scene=scene,
        seed=seed,
        control_frame=control_frame,
        start=start,
        sketch=sketch,
        truth=truth,
        positions=positions,
        velocities=velocities,
        forces=forces,
        smoothed_forces=smoothed(forces),
        mass=solver.mass,
        cap=cap,
        substeps=substeps,
        r_p=r_p,
        snapshot=snapshot,
    )


def _require(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        words = " or ".join(f'"{word}"' for word in allowed)
        raise ConfigError(f"{name} must be {words}, got {value!r}")


def _require_reversible(scene: Scene) -> None:
    moving = any(obstacle.motion is not None for obstacle in scene.obstacles)
    if scene.is_open or moving:
        found = "obstacles that move" if moving else "emitters or sinks"
        raise ConfigError(f"a scene with {found} does not run backwards: remove them")


def _sketch(
    truth: Floats32, weight: Floats, walls: Walls, kind: Kind, shortest_arrow: float | None
) -> Sketch:
    distance = float(np.linalg.norm(weight @ (truth[-1] - truth[0])[:, :2]))
    if kind == "arrow" and distance >= (shortest_arrow or 0.0):
        return arrow_of(truth, weight, walls)
    return oval_of(truth[-1], weight, walls)


def _past(solver: MpmSolver, control_frame: int, frames: int, on_frame: Callable[[], object]) -> Floats32:
    """Simulate up to a frame, and return the states of the last `frames` before it and at it."""
    states = []
    for frame in range(control_frame + 1):
        if frame:
            on_frame()
            solver.advance(1)
        if frame >= control_frame - frames:
            states.append(solver.positions)
    return np.stack(states)


def _led(
    solver: MpmSolver, law: Retraced, frames: int, on_frame: Callable[[], object]
) -> tuple[Floats32, Floats32]:
    """Return the positions (T + 1, N, D) and forces (T, N, D) of a solver that follows a law."""
    positions, forces = [solver.positions], []
    for index in range(frames):
        on_frame()
        forces.append(law.force(solver, index))
        solver.advance(1, forces[-1])
        positions.append(solver.positions)
    return np.stack(positions), np.stack(forces)


def _retraced(scene: Scene, truth: Floats32, cap: float) -> Retraced:
    return Retraced.along(
        truth.astype(np.float64),
        frame_dt=scene.frame_dt,
        gravity=np.array(scene.gravity),
        cap=cap * EARTH,
    )
