"""Reversed control data: a fluid led back to its past, with the sketch of that motion.

Paper, section 3.2.2. `reversed_case` turns the past of a forward run into an example of control: the state
at its start, a sketch of the state at its end, and forces that lead from one to the other. The method
`Oracle` follows such a sketch by these forces, which do not follow from the sketch alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, scenarios
from hybridmpm._support.arguments import whole
from hybridmpm.control.checks import positive
from hybridmpm.control.goal.cloud import EARTH, Cloud, Floats
from hybridmpm.control.laws import Retraced
from hybridmpm.control.sketch.sketch import MIN_LENGTH, Arrow, Ellipse, StrokeSketch, width_of_depth
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver, Substeps
from hybridmpm.scene import Scene, Walls

Floats32 = npt.NDArray[np.float32]
Start = Literal["live", "reversed"]
"""Velocities at the start of control: those of the forward run, as in a session, or their negative."""
Kind = Literal["oval", "arrow"]
"""Kind of the sketch: an oval around the end, or an arrow from the start to the end."""
STARTS: tuple[Start, ...] = get_args(Start)
KINDS: tuple[Kind, ...] = get_args(Kind)

DEFAULT_FRAMES = 100
"""Frames of control of the paper."""
DEFAULT_CAP = 30.0
"""Default of the largest force on a particle [g]."""
_MAX_FRAMES = 10_000
_MAX_CAP = 1000.0
MAX_DRAWN_FRAMES = 5_000
"""Largest number of frames of a drawn case; control starts at most twice as many frames into the scene."""
SHORTEST_ARROW = 0.12
"""Shortest drawn arrow [m]; shorter ones leave no room for a head, and ovals take their place."""
_SALT = 2**22
"""Number that seeds the generator of a case beside its seed."""
SEGMENTS = 8
"""Number of segments of an arrow, of equal duration."""
_SIGMAS = 2.0
"""Semi-axis of an oval over the standard deviation of the particles along it."""
SMOOTHING = 0.1
"""The paper's lambda [-]."""
SHARPNESS = 2.0
"""The paper's beta [-]."""


def step_cosines(forces: Floats32) -> Floats:
    """Return the cosine between the forces of successive frames, (T - 1, N) for forces (T, N, D).

    It is 0 where either is zero.
    """
    a = forces.astype(np.float64)
    sizes = np.sqrt((a**2).sum(axis=2))
    both = sizes[:-1] * sizes[1:]
    dot = (a[:-1] * a[1:]).sum(axis=2)
    return np.asarray(np.divide(dot, both, out=np.zeros_like(both), where=both > 0))


def smoothed(forces: Floats32, *, smoothing: float = SMOOTHING, sharpness: float = SHARPNESS) -> Floats32:
    """Return forces (T, N, D) moved towards those of the next frame, more where they differ more.

    a_t - lambda exp(-beta cos(a_t, a_t+1)) (a_t - a_t+1), where the cosine with a zero vector is 0. The last
    frame stays as it is. `smoothing` is lambda, `sharpness` is beta.

    Smoothed forces no longer lead to the end of the recorded motion, since no feedback corrects them.

    References
    ----------
    The paper's eq. `control_acceleration_smoothness`.
    """
    share = smoothing * np.exp(-sharpness * step_cosines(forces))[..., None]
    result = forces.astype(np.float64)
    result[:-1] -= share * (result[:-1] - result[1:])
    return result.astype(np.float32)


def arrow_of(motion: npt.NDArray[np.float32], weight: Floats, walls: Walls) -> Arrow:
    """Return the arrow along the path of the centre of mass, from the start of a motion to its end.

    Parameters
    ----------
    motion : (T + 1, N, D)
        Positions after each frame [m].
    weight : (N,)
        Mass of each particle over that of all [-].
    walls : Walls
        In 3D the depth between them gives the width of the stroke.

    Raises
    ------
    SketchError
        The centre of mass moves by less than two pixels in the front view.
    """
    moments = np.linspace(0, len(motion) - 1, SEGMENTS + 1).round().astype(int)
    way = np.stack([weight @ motion[moment].astype(np.float64) for moment in np.unique(moments)])
    front = np.clip(way[:, :2], 0.0, 1.0)
    return Arrow(front, None if motion.shape[2] == 2 else _widths(way[:, 2], walls))


def oval_of(x: npt.NDArray[np.float32], weight: Floats, walls: Walls) -> Ellipse:
    """Return the oval at two standard deviations around a cloud x (N, D) [m], in the front view.

    In 3D the width of its stroke gives the depth of the centre of mass. `weight` and `walls` are those of
    `arrow_of`.
    """
    cloud = x.astype(np.float64)
    mean = weight @ cloud
    away = cloud[:, :2] - mean[:2]
    values, vectors = np.linalg.eigh((weight[:, None] * away).T @ away)
    axes = np.clip(_SIGMAS * np.sqrt(np.maximum(values[::-1], 0.0)), MIN_LENGTH, 1.0)
    # Of the two angles of an axis, the one in (-pi / 2, pi / 2].
    major = vectors[:, 1] if vectors[0, 1] > 0 else -vectors[:, 1]
    angle = float(np.arctan2(major[1], major[0]))
    width = None if x.shape[1] == 2 else float(_widths(mean[2:], walls)[0])
    return Ellipse(np.clip(mean[:2], 0.0, 1.0), axes, angle, width)


def _widths(depths: Floats, walls: Walls) -> Floats:
    return np.array([width_of_depth(depth, walls.lower[2], walls.upper[2]) for depth in depths])


@dataclass(frozen=True, eq=False, kw_only=True)
class ReversedCase:
    """A fluid that is led back to its state of T frames ago, and the sketch of that motion.

    N is the number of particles, D the dimension. The forward run had the states p_0 to p_T, the last of them
    at `control_frame`, where control starts. q_tau = p_(T - tau) are the wanted positions after tau frames.
    The target of the control and of the sketch is q_T = p_0.
    """

    scene: Scene
    seed: int | None
    """Seed of a drawn case; None for others."""
    control_frame: int
    """Frame of the forward run at which control starts."""
    start: Start
    """Velocities of the particles when control starts."""
    sketch: StrokeSketch
    """StrokeSketch of the motion, without the tremor of a hand."""
    truth: Floats32
    """q_0 to q_T, (T + 1, N, D) [m]."""
    positions: Floats32
    """Positions of the solver under `forces`, (T + 1, N, D) [m]; row 0 is that of `truth`."""
    velocities: Floats32
    """Velocities when control starts (N, D) [m/s]."""
    forces: Floats32
    """Accelerations besides gravity (T, N, D) [m/s^2]; row t acts from state t to t + 1."""
    smoothed_forces: Floats32
    """The forces after `smoothed`, (T, N, D) [m/s^2]."""
    mass: Floats32
    """Masses (N,) [kg]."""
    cap: float
    """Largest allowed force on a particle [g]."""
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
        """Kind of the sketch."""
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
        """Return the law of `forces`, or the law under another cap [g]."""
        return _retraced(self.scene, self.truth, self.cap if cap is None else cap)

    def error(self, x: npt.ArrayLike) -> float:
        """Return the grid RMSE [-] between positions x (N, D) [m] and `target`, on the scene's grid."""
        scene = self.scene
        found, true = (
            metrics.grid_mass(np.clip(state, 0, scene.size), self.mass, scene.resolution, scene.cells)
            for state in (x, self.target)
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
    """Simulate a scene, and lead its particles back along their past paths.

    The forces are found inside the MPM loop, from the actual positions and velocities: see `Retraced`.

    Parameters
    ----------
    scene : Scene
        Scene without emitters, sinks and moving obstacles, which do not run backwards.
    control_frame : int in [frames, 10000]
        Frame at which control starts.
    frames : int in [2, 10000]
        Frames of control T, and of the past that is reversed.
    start : "live" or "reversed"
        Velocities when control starts: those of the forward run, or the negative ones.
    kind : "oval" or "arrow"
        Kind of the sketch.
    shortest_arrow : float > 0, optional
        Shortest displacement of the centre of mass in the front view [m] for an arrow; below it the sketch is
        an oval, whatever `kind` is. Without it an arrow without length is refused.
    cap : float in (0, 1000]
        Largest force on a particle [g].
    substeps, r_p
        As in `MpmSolver`.
    seed : int, optional
        Seed to store in the case.
    on_frame : callable
        Called before each frame; an exception that it raises ends the work.

    Raises
    ------
    ConfigError
        An argument is out of range, or the scene does not run backwards.
    SketchError
        An arrow would be shorter than two pixels, because the centre of mass hardly moves.
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
    if scene.world is not None:
        raise ConfigError(
            "reversed cases are for worlds of one metre along each axis, as networks are trained in: leave "
            "`world` out of the scene"
        )
    moving = any(obstacle.motion is not None for obstacle in scene.obstacles)
    if scene.is_open or moving:
        found = "obstacles that move" if moving else "emitters or sinks"
        raise ConfigError(f"a scene with {found} does not run backwards: remove them")


def _sketch(
    truth: Floats32, weight: Floats, walls: Walls, kind: Kind, shortest_arrow: float | None
) -> StrokeSketch:
    distance = float(np.linalg.norm(weight @ (truth[-1] - truth[0])[:, :2]))
    if kind == "arrow" and distance >= (shortest_arrow or 0.0):
        return arrow_of(truth, weight, walls)
    return oval_of(truth[-1], weight, walls)


def _past(solver: MpmSolver, control_frame: int, frames: int, on_frame: Callable[[], object]) -> Floats32:
    """Simulate up to a frame, and return the states of the last `frames` frames and of this one."""
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


def reversed_from_seed(
    scenario: str | Scene,
    seed: int,
    *,
    frames: int = DEFAULT_FRAMES,
    start: Start | None = None,
    kind: Kind | None = None,
    cap: float = DEFAULT_CAP,
    substeps: Substeps = "reference",
    r_p: float = 1.0,
    on_frame: Callable[[], object] = lambda: None,
) -> ReversedCase:
    """Draw the scene of a seed and the start of control; return the case.

    Control starts between T and 2 T frames into the scene, when the fluid is in flight or in its first
    splash, and mostly not yet at rest.

    Parameters
    ----------
    scenario : str or Scene
        Name of a scenario whose scene is drawn, or a scene that was drawn from the seed by other means.
    seed : int
        Seed of scene and case. By convention seeds below 10**6 are for training, those from 10**6 on for
        validation, those from 1.1 * 10**6 on for tests.
    start, kind : optional
        As in `reversed_case`; drawn from the seed if absent. The sketch is an oval where the centre of mass
        moves by less than 12 cm.
    frames, cap, substeps, r_p, on_frame
        As in `reversed_case`.

    Raises
    ------
    UnknownScenarioError
        No scenario has this name.
    ConfigError, SketchError, SimulationError
        As `reversed_case`.
    """
    frames = whole("frames", frames, 2, MAX_DRAWN_FRAMES)
    scene = scenario if isinstance(scenario, Scene) else scenarios.get(scenario, seed)
    rng = np.random.default_rng([_SALT, seed])
    control_frame = frames + int(rng.integers(frames, endpoint=True))
    # All are drawn, also where one is given, so that it does not change the others.
    drawn_start, drawn_kind = STARTS[rng.integers(len(STARTS))], KINDS[rng.integers(len(KINDS))]
    return reversed_case(
        scene,
        control_frame=control_frame,
        frames=frames,
        start=drawn_start if start is None else start,
        kind=drawn_kind if kind is None else kind,
        shortest_arrow=SHORTEST_ARROW if kind is None else None,
        cap=cap,
        substeps=substeps,
        r_p=r_p,
        seed=seed,
        on_frame=on_frame,
    )
