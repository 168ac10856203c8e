"""The compiled core: MLS-MPM in 2D and 3D. Usable on its own, without the rest of the package.

All quantities are SI. Arrays of particles are in the caller's order and never change it, whatever
order the solver keeps inside; what emitters add comes last, and what sinks remove closes up. N is
the number of particles, D the dimension (2 or 3).
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias, TypedDict, Unpack, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "MAX_SUBSTEPS",
    "SEAMS_IN_3D",
    "SHORTEST_FRAMES",
    "SNAPSHOT_VERSION",
    "SOLVER_VERSION",
    "UPSAMPLER_VERSION",
    "AccelerationHistory",
    "AccelerationSignal",
    "BatchError",
    "CancelFlag",
    "ConfigError",
    "Diagnostics",
    "DomainError",
    "Emitter",
    "FrameCancelledError",
    "FrameReport",
    "FreeSpace",
    "GraphSizeError",
    "InvertedError",
    "Matching",
    "Material",
    "MotionReport",
    "NonFiniteError",
    "Obstacle",
    "Outlines",
    "RadiusGraph",
    "RigidBody",
    "SimulationError",
    "SnapshotError",
    "Solver",
    "StepSizeError",
    "Timing",
    "Upsampler",
    "Ways",
    "__version__",
    "advance_all",
    "after_signals",
    "answer_weights",
    "cfl_substeps",
    "cpu_features",
    "filled_solid",
    "grid_mass",
    "least_acceleration",
    "limit_instructions",
    "match_to_region",
    "pressed",
    "push_force",
    "radius_graph",
    "raise_if_cancelled",
]

_OfPoints: TypeAlias = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]]
_OfCells: TypeAlias = Callable[[list[float], float, list[int], float], npt.NDArray[np.bool_]]

MAX_SUBSTEPS: int
"""Most substeps of a frame; frames that need more are refused."""
SNAPSHOT_VERSION: int
"""Version of the layout of `Solver.snapshot`."""
SEAMS_IN_3D: float
"""Volume of a shape in 3D over that of the fluid that fills it [-].

Parts of a fluid that meet stay about one grid cell apart.
"""
SHORTEST_FRAMES: int
"""Shortest remaining time of a plan [frames].

With 8 the peaks of the force reach the cap, with 14 to 16 they do not.
"""
SOLVER_VERSION: int
"""Version of the results: raised whenever the same scene gives other bits, on purpose.

A snapshot is restored by solvers of the same version only. Data sets and networks name the version that they
were made with.
"""
UPSAMPLER_VERSION: int
"""Version of `Upsampler.snapshot`, raised with its layout and with the bits of an update."""
__version__: str

class SimulationError(Exception):
    """Parent of every error that hybridmpm raises."""

class ConfigError(SimulationError, ValueError):
    """A parameter is outside its range, or arrays disagree in shape or type."""

    fault: tuple[str, str] | None
    """The part of the scene that is at fault, and what is wrong with it, where the message is of one part."""

class DomainError(SimulationError):
    """A particle left the box [0, 1]^D or went more than one cell past a wall."""

class NonFiniteError(SimulationError):
    """A position or velocity became NaN or infinite."""

class InvertedError(SimulationError):
    """The volume ratio J of a particle fell to zero or below."""

class StepSizeError(SimulationError):
    """A fixed number of substeps is above the stability limit, or speeds ask for too many."""

class FrameCancelledError(SimulationError):
    """A `CancelFlag` ended a frame, or other work, before it was done."""

class GraphSizeError(SimulationError):
    """A neighbour graph would be larger than allowed."""

class BatchError(SimulationError):
    """Scenes of a batch failed. The message names each by its index in the batch."""

    failures: dict[int, SimulationError]
    """The error of each scene that failed, by index."""

class SnapshotError(SimulationError, ValueError):
    """Snapshot bytes are truncated, damaged, foreign, or of another scene."""

@final
class Material:
    """Constitutive model and its constants. Build one with `water`, `liquid`, `sand` or `elastic`."""

    @staticmethod
    def water(
        *,
        density: float,
        bulk_modulus: float,
        tension: float = 0.25,
        wall_friction: float = 0.0,
        volume_correction: bool = True,
    ) -> Material:
        """Weakly compressible fluid, Kirchhoff stress tau = lambda J (J - 1) I.

        J follows the divergence of the velocity. Where particles crowd by more than 10 % beyond what J
        says, J is led back to the density on the grid within about 20 ms, which keeps the volume
        through splashes; not so in scenes whose bodies differ in density.

        Parameters
        ----------
        density : float > 0
            Rest density [kg/m^3].
        bulk_modulus : float > 0
            lambda [Pa]; the sound speed is sqrt(lambda / density).
        tension : float in [0, 1]
            Factor on the stress where J > 1. 1 clumps, 0 lets J drift.
        wall_friction : float >= 0
            Coulomb coefficient against box walls and obstacles that name none.
        volume_correction : bool
            Whether J is led back to the room that a particle takes; without it J is what the divergence alone
            makes of it.
        """

    @staticmethod
    def liquid(
        *,
        density: float,
        bulk_modulus: float,
        viscosity: float,
        yield_stress: float = 0.0,
        flow_index: float = 1.0,
        tension: float = 0.25,
        wall_friction: float = 10.0,
        volume_correction: bool = True,
    ) -> Material:
        """Liquid of Herschel and Bulkley: at a shear rate g its shear stress is tau_y + K g^n.

        Its pressure is that of water. The rest of its stress builds up as in an elastic solid of shear
        modulus G = lambda / 2 and relaxes by the law (Saramito 2007), within K / G for n = 1. So no viscosity
        needs shorter substeps than water of this bulk modulus.

        Parameters
        ----------
        density, bulk_modulus, tension, volume_correction
            As of `water`.
        viscosity : float > 0
            K [Pa s^n].
        yield_stress : float >= 0
            tau_y [Pa].
        flow_index : float in [0.2, 2]
            n [-].
        wall_friction : float >= 0
            Coulomb coefficient against box walls and obstacles that name none; with 10 nothing slips.
        """

    @staticmethod
    def sand(
        *,
        density: float,
        youngs_modulus: float,
        poisson_ratio: float,
        friction_angle: float,
        wall_friction: float = 0.5,
        volume_correction: bool = True,
    ) -> Material:
        """Drucker-Prager sand on StVK-Hencky elasticity (Klar et al. 2016).

        Parameters
        ----------
        density : float > 0
            Rest density [kg/m^3].
        youngs_modulus : float > 0
            E [Pa].
        poisson_ratio : float in (-1, 0.5)
            nu [-].
        friction_angle : float in (0, 90)
            Friction angle in triaxial compression [degrees].
        wall_friction : float >= 0
            Coulomb coefficient against box walls and obstacles that name none.
        volume_correction : bool
            Track the volume gained in separation and take it back when sand
            recompacts (Tampubolon et al. 2017); lead volumes back to the room that particles take.
        """

    @staticmethod
    def elastic(
        *, density: float, youngs_modulus: float, poisson_ratio: float, wall_friction: float = 0.5
    ) -> Material:
        """Fixed-corotated solid (Stomakhin et al. 2012); parameters as in `sand`."""

    @property
    def kind(self) -> str:
        """Name of the model: "water", "sand" or "elastic"."""
    @property
    def density(self) -> float:
        """Rest density [kg/m^3]."""
    @property
    def sound_speed(self) -> float:
        """Speed of the fastest wave at rest [m/s]."""

    def signal_speed(self, dim: int) -> float:
        """Speed [m/s] that limits the substep in `dim` dimensions, 2 or 3.

        sqrt((D lambda + 2 mu) / density), that of the stiffest mode of a particle alone.
        """

    @property
    def default_cfl(self) -> float:
        """CFL number dt signal_speed / dx of "cfl" substeps: 1.5 times below `cfl_limit` at least."""

    @property
    def cfl_limit(self) -> float:
        """CFL number up to which splashes and lone particles were stable; fixed steps beyond are refused."""

@final
class Obstacle:
    """A solid, at rest unless made by `moving`. `contact` is "sticky", "slip" or "separating".

    `friction` [-] is the Coulomb coefficient of separating contact; None takes the material's own.
    """

    @staticmethod
    def ball(
        center: Sequence[float],
        radius: float,
        *,
        contact: str = "separating",
        friction: float | None = None,
    ) -> Obstacle: ...
    @staticmethod
    def box(
        lower: Sequence[float],
        upper: Sequence[float],
        *,
        contact: str = "separating",
        friction: float | None = None,
    ) -> Obstacle: ...
    @staticmethod
    def segment(
        start: Sequence[float],
        end: Sequence[float],
        thickness: float,
        *,
        contact: str = "separating",
        friction: float | None = None,
    ) -> Obstacle:
        """Build a ramp: all points within thickness / 2 of the segment."""

    @staticmethod
    def cylinder(
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        *,
        contact: str = "separating",
        friction: float | None = None,
    ) -> Obstacle:
        """Build a cylinder with flat ends, whose centres are `start` and `end`."""

    @staticmethod
    def half_space(
        point: Sequence[float],
        normal: Sequence[float],
        *,
        contact: str = "separating",
        friction: float | None = None,
    ) -> Obstacle:
        """Solid on the side that `normal` points away from; `point` lies on the surface."""

    @staticmethod
    def polygon(
        vertices: npt.NDArray[np.float32], *, contact: str = "separating", friction: float | None = None
    ) -> Obstacle:
        """Build what a closed polygon (N, 2) encloses by the even-odd rule, 2D only."""

    @staticmethod
    def mesh(
        vertices: npt.NDArray[np.float32],
        triangles: npt.NDArray[np.uint32],
        *,
        contact: str = "separating",
        friction: float | None = None,
    ) -> Obstacle:
        """Build what closed triangles (T, 3) of vertices (V, 3) enclose, 3D only."""

    def crossing(self) -> list[float] | None:
        """Return a point where triangles without a common corner cross [m]; None where none do."""

    def moving(
        self,
        *,
        velocity: Sequence[float] | None = None,
        angular_velocity: Sequence[float] | None = None,
        center: Sequence[float] | None = None,
        period: float | None = None,
        phase: float = 0.0,
    ) -> Obstacle:
        """Return the same solid in a prescribed rigid motion that nothing resists.

        With the clock s(t) = t, or s(t) = period / (2 pi) (sin(2 pi (t / period + phase)) - sin(2 pi phase))
        where there is a period, the solid has moved by `velocity` s and turned by `angular_velocity` s at
        time t. Contact conditions hold for the velocity relative to its surface.

        Parameters
        ----------
        velocity : D floats, optional
            [m/s], zero if absent; of a swing the largest.
        angular_velocity : 1 float in 2D, anticlockwise, 3 floats in 3D, optional
            [rad/s], zero if absent; of a swing the largest.
        center : D floats
            Of rotation at time 0 [m]; it moves with `velocity`. Needed with `angular_velocity`.
        period : float > 0, optional
            Of a swing [s]; without it the motion goes on and on.
        phase : float in [0, 1)
            Where in the period the motion starts: at 0 with full speed, at 0.75 at rest, going forth.

        Raises
        ------
        ConfigError
            With the parameter's name, its value and the allowed range.
        """

    def signed_distance(
        self, x: npt.NDArray[np.float32], time: float = 0.0, within: float | None = None
    ) -> npt.NDArray[np.float32]:
        """Distance [m] of points (N, D) to the surface at a time [s], negative inside; shape (N,).

        With `within` [m], those of polygons and meshes are found faster: they are true to 0.015 of it, and
        farther ones may be nearer to zero than they are.
        """

    def moved(self, x: npt.NDArray[np.float32], time: float) -> npt.NDArray[np.float32]:
        """Positions (N, D) [m] at a time [s] of points of the solid that are at `x` (N, D) [m] at time 0."""

class _RigidMotion(TypedDict):
    rotation: Sequence[float]
    density: float
    velocity: Sequence[float]
    angular_velocity: Sequence[float]
    friction: float
    restitution: float

@final
class RigidBody:
    """A rigid body at the start, which the material moves and which moves it.

    `rotation` [rad] and `angular_velocity` [rad/s] have one number in 2D, anticlockwise, and three in 3D.
    `friction` and `restitution` [-] hold on walls, obstacles and other rigid bodies; `density` is in kg/m^3.
    """

    center: list[float]
    """Centre of mass [m]."""
    mass: float
    """[kg], in 2D per metre of depth."""

    def surface(self) -> tuple[list[list[float]], list[list[int]]] | None:
        """Corners of a hull in 3D from the centre of mass, in its own frame [m], and three of each triangle.

        Triangles are anticlockwise from outside. None of other bodies.
        """

    @staticmethod
    def ball(
        center: Sequence[float],
        radius: float,
        **motion: Unpack[_RigidMotion],
    ) -> RigidBody: ...
    @staticmethod
    def box(
        lower: Sequence[float],
        upper: Sequence[float],
        **motion: Unpack[_RigidMotion],
    ) -> RigidBody: ...
    @staticmethod
    def cylinder(
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        **motion: Unpack[_RigidMotion],
    ) -> RigidBody: ...
    @staticmethod
    def hull(
        points: Sequence[Sequence[float]],
        **motion: Unpack[_RigidMotion],
    ) -> RigidBody:
        """Build the convex hull of some points."""

    def signed_distance(
        self, x: npt.NDArray[np.float32], *, within: float | None = None
    ) -> npt.NDArray[np.float32]:
        """Distances (N,) of points (N, D) from the body at the start [m], negative inside.

        `within` is as for obstacles; distances are exact whatever it is.
        """

@final
class Emitter:
    """An opening that material leaves at a given velocity, in layers one spacing apart.

    At the end of a frame, the layers that have left the opening during it are added where they have got to.
    A layer comes whole or not at all: while more than a quarter of its place is taken by other material,
    while an obstacle is in it, or where it would exceed the solver's `max_particles`, nothing comes, and what
    could not come is not made up for.
    """

    def __new__(
        cls,
        *,
        material: int,
        velocity: Sequence[float],
        spacing: float,
        sites: npt.NDArray[np.float32],
        jitter: npt.NDArray[np.float32],
        mass: float,
        volume: float,
        start: float = 0.0,
        stop: float | None = None,
    ) -> Emitter:
        """Describe an emitter; its numbers are checked when a solver takes it up.

        Parameters
        ----------
        material : int
            Index into the solver's materials.
        velocity : D floats, not zero
            Of the material [m/s].
        spacing : float > 0
            Between layers [m].
        sites : float32 (n, D)
            Where the particles of a layer are that has just left the opening [m].
        jitter : float32 (k, n, D)
            Offsets from the sites [m]; the k layers are used in turn.
        mass, volume : float > 0
            Of each particle: [kg] and rest volume [m^D].
        start, stop : float >= 0
            When material comes [s]; without `stop` it never ends.
        """

@final
class Diagnostics:
    """Totals over all particles at one instant."""

    def __new__(
        cls,
        mass: float,
        momentum: Sequence[float],
        centroid: Sequence[float],
        kinetic_energy: float,
        potential_energy: float,
        elastic_energy: float,
        max_speed: float,
        min_volume_ratio: float,
        max_volume_ratio: float,
        emitted_mass: float,
        removed_mass: float,
    ) -> Diagnostics:
        """Return an object of these values, as copies and pickles are made."""

    def __getnewargs__(
        self,
    ) -> tuple[
        float, Sequence[float], Sequence[float], float, float, float, float, float, float, float, float
    ]: ...
    @property
    def mass(self) -> float:
        """[kg]; in 2D for a slice one metre deep."""
    @property
    def momentum(self) -> list[float]:
        """D components [kg m/s]."""
    @property
    def centroid(self) -> list[float]:
        """Centre of mass, D components [m]."""
    @property
    def kinetic_energy(self) -> float:
        """Joule [J]."""
    @property
    def potential_energy(self) -> float:
        """-m g . x [J], zero at the origin."""
    @property
    def elastic_energy(self) -> float:
        """Joule [J]."""
    @property
    def max_speed(self) -> float:
        """Metres per second [m/s]."""
    @property
    def min_volume_ratio(self) -> float:
        """Smallest J (water) or det F (solids) [-]."""
    @property
    def max_volume_ratio(self) -> float:
        """Largest J (water) or det F (solids) [-]."""
    @property
    def emitted_mass(self) -> float:
        """Added by emitters since frame 0 [kg]."""
    @property
    def removed_mass(self) -> float:
        """Taken away by sinks since frame 0 [kg]."""

@final
class FrameReport:
    """How the last frame was cut into substeps."""

    def __new__(
        cls,
        substeps: int,
        smallest_dt: float,
        bound: str,
        obstacle_work: float,
        max_speed: float,
        forces: Sequence[Sequence[float]],
    ) -> FrameReport:
        """Return an object of these values, as copies and pickles are made."""

    def __getnewargs__(self) -> tuple[int, float, str, float, float, list[list[float]]]: ...
    @property
    def substeps(self) -> int: ...
    @property
    def smallest_dt(self) -> float:
        """Seconds [s]."""
    @property
    def bound(self) -> str:
        """What chose the smallest step.

        "sound", "speed" or "obstacle" (the CFL bound, by the stiffest material, the fastest particle or the
        fastest moving obstacle), "frame" (one step a frame was enough), "reference" or
        "fixed" (the caller chose).
        """
    @property
    def max_speed(self) -> float:
        """Largest speed of a particle at the end of the frame [m/s]."""
    @property
    def obstacle_work(self) -> float:
        """Work of moving obstacles on the material [J], in 2D per metre: impulses times velocities."""
    @property
    def forces(self) -> npt.NDArray[np.float64]:
        """Mean forces on walls and obstacles (2 D + n, 3 (D - 1)); see `Simulator.frame_forces`.

        Without rows unless `Solver.keep_forces` was called before. Matter that sleeps does not count.
        """

@final
class MotionReport:
    """What a prescribed motion did, in numbers that tell whether it is sound."""

    def __new__(
        cls,
        density: float,
        divergence: float,
        kinetic_energy: float,
        potential_energy: float,
    ) -> MotionReport:
        """Return an object of these values, as copies and pickles are made."""

    def __getnewargs__(self) -> tuple[float, float, float, float]: ...
    @property
    def density(self) -> float:
        """Density over rest density that one particle in a hundred exceeds [-]."""
    @property
    def divergence(self) -> float:
        """Root mean square of the divergence of velocity [1/s]."""
    @property
    def kinetic_energy(self) -> float:
        """[J], of the particles' velocities without their affine part."""
    @property
    def potential_energy(self) -> float:
        """-m g . x [J], zero at the origin."""

@final
class AccelerationSignal:
    """What the latest accelerations of particles say."""

    def __new__(
        cls,
        cosine: float | None,
        plain: float | None,
        active: float,
        largest: float,
    ) -> AccelerationSignal:
        """Return an object of these values, as copies and pickles are made."""

    def __getnewargs__(self) -> tuple[float | None, float | None, float, float]: ...
    @property
    def cosine(self) -> float | None:
        """Mean of cos(older window, newer window) over the particles that are not calm in both.

        1 where too few are; None until both windows are full.
        """
    @property
    def plain(self) -> float | None:
        """The same mean over all particles, 0 for one without acceleration."""
    @property
    def active(self) -> float:
        """Share of the particles that are not calm."""
    @property
    def largest(self) -> float:
        """Power mean of order 4 of the latest accelerations, which the largest dominate [m/s^2]."""

@final
class AccelerationHistory:
    """Accelerations of particles over two successive windows of time, and how alike they are.

    Updated step by step: the cost does not depend on the window.

    Parameters
    ----------
    particles : int
    dim : 2 or 3
    window : int in [1, 1000]
        Accelerations in each of the two windows.
    dt : float > 0
        Time between two positions [s].
    calm_acceleration : float >= 0
        Root mean square acceleration that a calm particle exceeds in neither window [m/s^2].
    min_active_share : float in [0, 1]
        Share of the particles that must not be calm for the scene to count as active [-].

    Raises
    ------
    ConfigError
        Naming parameter and range.
    """

    def __new__(
        cls,
        particles: int,
        dim: int,
        *,
        window: int,
        dt: float,
        calm_acceleration: float,
        min_active_share: float,
    ) -> AccelerationHistory: ...
    def push(self, x: npt.NDArray[np.float32]) -> AccelerationSignal:
        """Take the next positions, float32 (N, D) [m]; raises `ConfigError` on another shape."""

    def undo(self) -> None:
        """Take the latest push back; raises `ConfigError` where there is none or it was taken back."""

    def snapshot(self) -> bytes:
        """Return the complete state. Going on from it gives the same bits."""

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of a history with the same settings.

        Raises
        ------
        SnapshotError
            The bytes are cut off, or of other settings; the present state is then untouched.
        """

    def __copy__(self) -> AccelerationHistory: ...
    def __deepcopy__(self, _memo: object, /) -> AccelerationHistory: ...
    def copy(self) -> AccelerationHistory:
        """Return an independent history in the same state."""

@final
class CancelFlag:
    """A flag by which one thread ends the work of another.

    The other works in a block of the flag. Once it is set, building a scene or a simulator, a frame, and the
    planning of a sketch raise `FrameCancelledError` in the block, within some milliseconds:

        with flag:
            MpmSolver(scene).advance(1000)

    The block belongs to its thread: it must not contain an `await`. Blocks of several flags may be nested.
    What is completed has the same bits with and without a flag.
    """

    def __new__(cls, is_set: bool = False) -> CancelFlag:
        """Create a flag, set or not."""

    def set(self) -> None:
        """Set the flag for good, from any thread."""

    @property
    def is_set(self) -> bool:
        """Whether the flag is set."""

    def __enter__(self) -> CancelFlag: ...
    def __exit__(self, *_exception: object) -> None: ...

@final
class Solver:
    """MLS-MPM (Hu et al. 2018) with APIC transfer and quadratic B-splines on [0, 1]^D.

    Thread safe: calls on one solver wait for each other, with the GIL released.
    """

    def __new__(
        cls,
        *,
        resolution: int,
        cells: Sequence[int] | None = None,
        frame_dt: float,
        gravity: Sequence[float],
        wall_lower: Sequence[float],
        wall_upper: Sequence[float],
        wall_contact: str | Sequence[str] = "separating",
        wall_friction: float | Sequence[float | None] | None = None,
        materials: Sequence[Material],
        obstacles: Sequence[Obstacle] = (),
        rigid: Sequence[RigidBody] = (),
        emitters: Sequence[Emitter] = (),
        sinks: Sequence[Obstacle] = (),
        max_particles: int | None = None,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        material: npt.NDArray[np.uint8],
        mass: npt.NDArray[np.float32],
        volume: npt.NDArray[np.float32],
        volume_ratio: npt.NDArray[np.float32] | None = None,
        body: npt.NDArray[np.uint32] | None = None,
        contact_friction: float | None = None,
        transfer_loss: float | None = None,
        substeps: str | int = "cfl",
        cfl: float | None = None,
        allow_unstable: bool = False,
        sleep_speed: float | None = None,
        sleep_frames: int = 20,
        threads: int = 1,
    ) -> Solver:
        """Create a solver; the dimension is `len(gravity)`.

        Parameters
        ----------
        resolution : int in [8, 1024]
            Grid cells along each axis; dx = 1 / resolution [m].
        frame_dt : float > 0
            Length of a frame [s].
        gravity : D floats
            [m/s^2].
        wall_lower, wall_upper : D floats in [0, 1]
            Box walls [m]; applied where they are, also between grid nodes.
        wall_contact : "sticky", "slip" or "separating", or 2 D of them
            Of all walls, or of each: the lower and the upper one across the first axis, then those across the
            second.
        wall_friction : float >= 0, or 2 D of them, optional
            Coulomb coefficient of separating walls; None takes each material's own.
        materials : 1 to 255 materials
        rigid : at most 200 RigidBody
        emitters : sequence of Emitter
            They act at the end of each frame, after the sinks.
        sinks : sequence of Obstacle
            Particles that end a frame inside of one, as it is at time 0, are removed. Contact means nothing.
        max_particles : int, optional
            Emitters add none beyond; no limit if absent.
        x, v : float32 (N, D)
            Positions [m] inside the walls and velocities [m/s].
        material : uint8 (N,)
            Index into `materials`.
        mass, volume : float32 (N,), > 0
            [kg] and rest volume [m^D].
        volume_ratio : float32 (N,), > 0, optional
            Initial J; 1 where not given.
        body : uint32 (N,), < 2**31, optional
            Number of each particle's body: elastic bodies part from each other and from all else. Where not
            given, all of one material is one body. An emitter of elastic material makes a body of its own.
        contact_friction : float >= 0, optional
            Coulomb coefficient between an elastic body and anything else; the smaller `wall_friction` of the
            two materials if absent.
        transfer_loss : float >= 0, optional
            Rate [1/s] at which particles lose what the grid does not carry of their velocities; if absent
            they lose it in each substep (APIC).
        substeps : "cfl", "reference" or int >= 1
            "cfl": the fewest that the CFL bound allows, chosen anew as speeds change.
            "reference": floor(frame_dt / (0.02 dx)) + 1 a frame, the ground truth's rule.
            An integer: that many equal substeps a frame.
        cfl : float in (0, 1], optional
            CFL number of "cfl" substeps, for waves and motion alike. By default each material has its own
            (`Material.default_cfl`), and a particle crosses at most 0.55 of a cell in a substep.
        allow_unstable : bool
            Let a fixed number of substeps go above the stability limit.
        sleep_speed : float > 0, optional
            Regions fall asleep once all of their particles and of their neighbours were slower than
            this [m/s] at the end of `sleep_frames` frames in a row; None keeps everything awake.
        sleep_frames : int in [1, 1000000]
        threads : int >= 1
            The result does not depend on it, to the bit.

        Raises
        ------
        ConfigError
            With the parameter's name, its value and the allowed range.
        """

    def advance(
        self,
        frames: int = 1,
        force: npt.NDArray[np.float32] | None = None,
        out: npt.NDArray[np.float32] | None = None,
    ) -> None:
        """Advance by whole frames.

        Parameters
        ----------
        frames : int >= 0
        force : float32 (D,), (N, D) or (frames, N, D), optional
            External acceleration [m/s^2] besides gravity: the same for all particles, one for each particle,
            or one for each particle and frame. The first two hold over the call. (D,) costs nothing and
            gives the bits of an (N, D) whose rows are all alike. With emitters or sinks, N is that before
            the call, and `frames` is 1 unless the force is (D,).
        out : float32 (frames, N, D), C-contiguous, optional
            Receives the positions after each frame. Not with emitters or sinks.

        Raises
        ------
        NonFiniteError, DomainError, InvertedError, StepSizeError
            Naming particle and frame. The state is then the one before the failed frame.
        FrameCancelledError
            A `CancelFlag` was set. The state is then the one before the frame that it ended.
        ConfigError
            An array has the wrong shape, or the force is not finite; nothing has moved.
        """

    def prescribe(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        frame: int,
        *,
        affine: bool = True,
        deform: bool = False,
    ) -> MotionReport:
        """Put the particles where somebody else says that they are at the end of a frame.

        Particles less than a cell past a wall, or in an obstacle, are put back to its surface.

        Parameters
        ----------
        x, v : float32 (N, D)
            Positions [m] and velocities [m/s].
        frame : int >= 0
            Its number, which becomes the solver's.
        affine : bool
            Take the affine matrices from the grid velocities; else they are 0.
        deform : bool
            Deform the materials by these matrices over the frames since; else J, F and the like stay.

        Raises
        ------
        NonFiniteError, DomainError, InvertedError
            Naming the particle. The state is then the one before.
        ConfigError
            Arrays of wrong shape, or a scene with emitters, sinks or sleep.
        """

    @property
    def dim(self) -> int: ...
    @property
    def particle_count(self) -> int: ...
    @property
    def resolution(self) -> int: ...
    @property
    def frame(self) -> int:
        """Frames done since the start."""
    @property
    def time(self) -> float:
        """Seconds [s]."""
    @property
    def is_open(self) -> bool:
        """Whether there are emitters or sinks."""
    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that particles keep for good, ascending; a snapshot, read-only."""
    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Index into the materials (N,); a snapshot, read-only."""
    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """(N,) [kg]; a snapshot, read-only."""
    def pull(
        self,
        *,
        body: int,
        grip: Sequence[float],
        target: Sequence[float],
        reach: float,
        strength: float,
    ) -> None:
        """Pull at a rigid body in the next frame, beside what else does.

        Parameters
        ----------
        body : int
            Its number.
        grip : D floats
            Point that is held, from the centre of mass, in the body's own frame [m].
        target : D floats
            Point that it is drawn to [m].
        reach : float > 0
            Distance from the target at which a spring at rest gives `strength` [m].
        strength : float > 0
            Largest force [N], in 2D per metre of depth.

        Raises
        ------
        ConfigError
            There is no such body, or a number is out of range.
        """

    @property
    def rigid(self) -> npt.NDArray[np.float64]:
        """Numbers (B, 13) of the rigid bodies; a snapshot, read-only.

        Centre of mass [m], unit quaternion of the turn with the scalar first, velocity [m/s], angular
        velocity [rad/s], each with the components in space.
        """

    @property
    def rigid_energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of the rigid bodies [J], in 2D per metre of depth."""

    @property
    def emitters(self) -> list[str]:
        """What each emitter did in the latest frame: "waiting", "running", "blocked", "full" or "ended"."""
    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Positions (N, D) [m]; a snapshot, read-only."""
    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Velocities (N, D) [m/s]; a snapshot, read-only."""
    @property
    def affine(self) -> npt.NDArray[np.float32]:
        """APIC matrix C (N, D, D) [1/s]; a snapshot, read-only."""
    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Which particles sleep (N,); a snapshot, read-only."""

    @property
    def volume_ratio(self) -> npt.NDArray[np.float32]:
        """J of water, det F of solids (N,) [-]; a snapshot, read-only."""
    @property
    def pressure(self) -> npt.NDArray[np.float32]:
        """Pressure -tr(sigma) / D (N,) [Pa] of the Cauchy stress, above 0 in compression; read-only."""
    @property
    def last_frame(self) -> FrameReport | None:
        """Report on the latest frame; None before the first."""
    def keep_forces(self) -> None:
        """Sum the forces on walls and obstacles in all later frames."""
    def diagnostics(self) -> Diagnostics: ...
    def snapshot(self) -> bytes:
        """Complete state, versioned and checksummed. Going on from it gives the same bits."""
    def start(self, upsampler: Upsampler | None = None, *, redoes: bool = False) -> bytes:
        """Return settings and state, from which the WebAssembly module goes on with the same bits.

        Parameters
        ----------
        upsampler : Upsampler, optional
            Source of the particles that are shown.
        redoes : bool
            Whether a frame that fails is done again at each material's own step.
        """
    def restore(self, data: bytes) -> None:
        """Take the state of `data`, which must come from a solver of the same scene.

        Raises
        ------
        SnapshotError
            The present state is then untouched.
        """

    def __copy__(self) -> Solver: ...
    def __deepcopy__(self, _memo: object, /) -> Solver: ...
    def copy(self) -> Solver:
        """Return an independent solver in the same state."""

@final
class Upsampler:
    """All N particles of a scene, moved with n coarse particles; see `hybridmpm.coarse.Upsampler`.

    Thread safe: calls on one upsampler wait for each other, with the GIL released. Methods that take the
    coarse particles take their `ids` (n,), ascending, positions `x` (n, D) [m], velocity gradients `affine`
    (n, D, D) [1/s], if known, and masses `mass` (n,) [kg].
    """

    def __new__(
        cls,
        solver: Solver,
        *,
        resolution: int,
        cells: Sequence[int] | None = None,
        affine_share: float = 0.5,
        relaxation: float = 2.0,
        emitters: Sequence[Emitter] = (),
        max_particles: int | None = None,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        material: npt.NDArray[np.uint8],
        mass: npt.NDArray[np.float32],
        volume: npt.NDArray[np.float32],
    ) -> Upsampler:
        """Take the particles of a scene at frame 0.

        Parameters
        ----------
        solver : Solver
            Solver of the scene at frame 0, on the coarse grid; its particles are the coarse ones.
        resolution : int
            Cells per metre of the scene's own grid.
        affine_share : float in [0, 1]
            Part of the affine motion of coarse particles that is interpolated.
        relaxation : float in [0, 8]
            Displacement of shown particles in a pass of the density relaxation [cells] per excess density and
            cell.
        emitters : sequence of Emitter
            Emitters of shown particles, one for each of the solver's.
        max_particles : int, optional
            Emitters add no particles beyond this number.
        x, v, material, mass, volume
            As for `Solver`.

        Raises
        ------
        ConfigError
            A number is out of range, or arrays disagree.
        """

    @property
    def every(self) -> int:
        """Frames from one update to the next."""

    @property
    def frame(self) -> int:
        """Frame of the latest update."""

    @property
    def particle_count(self) -> int:
        """Number N of particles."""

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Permanent ids (N,) of the particles, ascending; a snapshot, read-only."""

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """Masses (N,) [kg]; a snapshot, read-only."""

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (N,) into the materials; a snapshot, read-only."""

    @property
    def emitters(self) -> list[str]:
        """Status of each emitter in the latest frame."""

    def update(
        self,
        frame: int,
        *,
        ids: npt.NDArray[np.uint64],
        x: npt.NDArray[np.float32],
        affine: npt.NDArray[np.float32] | None = None,
        mass: npt.NDArray[np.float32],
        rigid: npt.NDArray[np.float64] | None = None,
    ) -> None:
        """Move all particles to the end of a frame after the latest update, with the coarse particles then.

        `rigid` (B, 13) are the numbers of the scene's rigid bodies, as `Solver.rigid` has them.

        Raises
        ------
        ConfigError
            The frame is not after the latest update, or the arrays disagree or are not finite.
        """

    def positions(
        self,
        frame: int,
        *,
        ids: npt.NDArray[np.uint64],
        x: npt.NDArray[np.float32],
        affine: npt.NDArray[np.float32] | None = None,
        mass: npt.NDArray[np.float32],
        rigid: npt.NDArray[np.float64] | None = None,
    ) -> npt.NDArray[np.float32]:
        """Return positions (N, D) [m] at a frame from the latest update on; raises as `update`."""

    def velocities(
        self,
        frame: int,
        *,
        ids: npt.NDArray[np.uint64],
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        affine: npt.NDArray[np.float32] | None = None,
        mass: npt.NDArray[np.float32],
        rigid: npt.NDArray[np.float64] | None = None,
    ) -> npt.NDArray[np.float32]:
        """Return velocities (N, D) [m/s] at such a frame; `v` (n, D) are those of the coarse particles."""

    def gather_force(self, force: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Convert accelerations (N, D) [m/s^2] to those (n, D) of coarse particles at the latest update."""

    def snapshot(self) -> bytes:
        """Complete state, without that of the simulator of the coarse particles."""

    def restore(self, data: bytes) -> None:
        """Restore the state of a snapshot of the same scene; raises `SnapshotError`."""

    def __copy__(self) -> Upsampler: ...
    def __deepcopy__(self, _memo: object, /) -> Upsampler: ...
    def copy(self) -> Upsampler:
        """Return an independent upsampler in the same state."""

def advance_all(
    solvers: Sequence[Solver],
    frames: int = 1,
    force: Sequence[npt.NDArray[np.float32] | None] | None = None,
    threads: int | None = None,
) -> None:
    """Advance independent scenes side by side, each on one thread; the results are those of `advance`.

    Parameters
    ----------
    solvers : N solvers
        One that stands in the list twice advances twice.
    frames : int >= 0
    force : N entries, optional
        For each solver None or what its `advance` takes: (D,), (N, D) or (frames, N, D).
    threads : int >= 1, optional
        As many as the process may use if absent.

    Raises
    ------
    BatchError
        Some scenes failed and are in the state before their failed frame; all others have advanced.
    ConfigError
        An argument is out of range or has a wrong shape; nothing has moved.
    """

def cfl_substeps(
    materials: Sequence[Material],
    *,
    dim: int,
    resolution: int,
    frame_dt: float,
    speed: float = 0.0,
    cfl: float | None = None,
) -> int:
    """Return the number of substeps of a frame by the CFL law, for a solver with `substeps="cfl"`.

    A solver takes as many in its first frame. The number may exceed `MAX_SUBSTEPS`, which solvers refuse.

    Parameters
    ----------
    materials : sequence of Material
        Materials of the scene.
    dim : 2 or 3
    resolution : int >= 1
        Grid cells per metre.
    frame_dt : float
        Length of a frame [s].
    speed : float >= 0
        Largest speed of particles plus that of obstacles [m/s].
    cfl : float in (0, 1], optional
        CFL number of waves and motion; if absent, waves take `Material.default_cfl`, and a particle crosses
        at most 0.55 of a cell in a substep.

    Raises
    ------
    ConfigError
        An argument is out of range.
    """

def grid_mass(
    x: npt.NDArray[np.float32],
    mass: npt.NDArray[np.float32],
    resolution: int,
    cells: Sequence[int] | None = None,
) -> npt.NDArray[np.float32]:
    """Mass of the nodes of a grid over the world, by quadratic B-spline P2G.

    Parameters
    ----------
    x : float32 (N, D), inside the world
    mass : float32 (N,)
    resolution : int
        Cells per metre.
    cells : D integers in [2, 4096], optional
        Cells along each axis; those of a metre if absent.

    Returns
    -------
    float32, one more than `cells` along each axis
        [kg]. Mass that the stencil carries outside the box goes to the nearest node, so the sum is
        that of `mass`.
    """

@final
class RadiusGraph:
    """Edges between points at most a radius apart, in both directions.

    Ordered by receiver, then by sender. E is the number of edges. A graph that is given as `out` is
    overwritten, and so are arrays taken from it before.
    """

    def __new__(
        cls,
        starts: npt.NDArray[np.uint32],
        senders: npt.NDArray[np.uint32],
        radius: float,
    ) -> RadiusGraph:
        """Return an object of these values, as copies and pickles are made."""

    def __getnewargs__(self) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32], float]: ...
    @property
    def senders(self) -> npt.NDArray[np.uint32]:
        """Shape (E,)."""
    @property
    def receivers(self) -> npt.NDArray[np.uint32]:
        """Shape (E,), ascending; made from `starts` when first asked for."""
    @property
    def starts(self) -> npt.NDArray[np.uint32]:
        """Shape (N + 1,): the edges into point i are `starts[i]` to `starts[i + 1]`."""
    @property
    def radius(self) -> float:
        """Metres [m]."""

def radius_graph(
    x: npt.NDArray[np.float32],
    radius: float,
    types: npt.NDArray[np.integer] | None = None,
    *,
    kinematic: int = 3,
    inclusive: bool = True,
    self_edges: bool = False,
    max_edges: int | None = None,
    threads: int = 1,
    out: RadiusGraph | None = None,
) -> RadiusGraph:
    """Join all pairs of points that are near each other; exact, without a cap on the neighbours.

    Distances are compared in double precision. The result depends on neither `threads` nor `out`, to the bit.

    Parameters
    ----------
    x : float32 (N, 2) or (N, 3)
        Points [m], anywhere.
    radius : float > 0
        [m], rounded to float32.
    types : integers (N,), optional
        Points of the type `kinematic` are not joined to each other: what moves as prescribed needs no
        messages from its like. Without types all pairs are joined, as in the reference GNS.
    kinematic : int
        By default that of the data sets of Sanchez-Gonzalez et al. (2020), arXiv:2002.09405.
    inclusive : bool
        Join pairs at exactly the radius (`<=`, as k-d trees do) or leave them out (`<`).
    self_edges : bool
        Join each point to itself, whatever its type.
    max_edges : int, optional
        Refuse graphs with more edges; 2**32 - 1 if absent.
    threads : int >= 1
    out : RadiusGraph, optional
        Is overwritten and returned. It keeps its arrays, where the edges fit in, and the search its memory.

    Returns
    -------
    RadiusGraph
        `out`, or a new one.

    Raises
    ------
    ConfigError
        A radius or a coordinate that is not finite, or an array of another kind.
    GraphSizeError
        There are more edges than `max_edges`.
    """

def answer_weights(
    history: npt.NDArray[np.float32],
    known_acceleration: npt.NDArray[np.float32],
    starts: npt.NDArray[np.uint32],
    senders: npt.NDArray[np.uint32],
    *,
    radius: float,
    scale: Sequence[float],
    hops: int,
    quiet: float,
    unnoticed: float,
    most: float,
    lower: Sequence[float],
    upper: Sequence[float],
) -> npt.NDArray[np.float32]:
    """Return the weights of a network's answer at each point: 0 where a body falls undisturbed, else up to 1.

    A point's own disturbance is a sum of three parts: the squares of its acceleration beyond the known one
    over all states, the squares of its neighbours' latest velocities against its own, both over `scale`, and
    how far walls are within the radius of where the point is and of where it goes. All points within `hops`
    edges feel it. The disturbances that a point feels add up to s, and its weight is 1 - exp(-s / quiet).

    Parameters
    ----------
    history : float32 (S, N, 2) or (S, N, 3)
        Two or more states [m], one step apart, oldest first.
    known_acceleration : float32 (N, D)
        Acceleration that disturbs nothing [m per step^2].
    starts, senders : uint32 (N + 1,) and (E,)
        Edges, as in `RadiusGraph`.
    radius : float > 0
        Radius of the graph, R [m].
    scale : D floats > 0
        Unit of accelerations and of relative velocities [m per step^2 and m per step].
    hops : int >= 0
        Number of edges in a row that a disturbance is felt across.
    quiet : float > 0
        Disturbance that gives a weight of 63 %.
    unnoticed : float
        Disturbance of a point that counts as none.
    most : float
        Largest disturbance of a point.
    lower, upper : D floats
        Corners of the box [m].

    Returns
    -------
    float32 (N,)
        Weights in [0, 1].

    Raises
    ------
    ConfigError
        Arrays that do not fit together, or a number out of range.
    """

@final
class FreeSpace:
    """The room between walls and obstacles on a coarse grid, for shortest ways and lines of sight.

    Parameters
    ----------
    lower : sequence of D floats
        First node [m].
    spacing : float
        Distance of the nodes [m].
    distance : float64 with D axes
        Signed distance of the nearest obstacle from each node, negative inside [m].

    Raises
    ------
    ConfigError
        The dimension is not 2 or 3, or the shapes do not fit together.
    """

    def __new__(
        cls, lower: Sequence[float], spacing: float, distance: npt.NDArray[np.float64]
    ) -> FreeSpace: ...

@final
class Matching:
    """What `match_to_region` found, for N particles in G groups."""

    @property
    def places(self) -> npt.NDArray[np.float64]:
        """Place of each particle (N, D) [m]."""

    @property
    def group(self) -> npt.NDArray[np.uint32]:
        """Group of each particle (N,)."""

    @property
    def way_starts(self) -> npt.NDArray[np.uint32]:
        """(G + 1,): the way of group g has the corners `ways[way_starts[g]:way_starts[g + 1]]`."""

    @property
    def ways(self) -> npt.NDArray[np.float64]:
        """Ways of the groups' centres (K, D) [m]: start, corners around obstacles, end."""

    @property
    def cut_off(self) -> npt.NDArray[np.bool_]:
        """Whether no way leads to the places of a group (G,); its way is then the straight one."""

@final
class Outlines:
    """Closed lines in the plane; what they enclose an odd number of times is inside.

    Parameters
    ----------
    lines : float64 (K, 2)
        Points of all lines [m].
    starts : uint32 (L + 1,)
        Line l has the points starts[l] to starts[l + 1] - 1; the last of them joins the first.

    Raises
    ------
    ConfigError
        Arrays that do not fit together.
    """

    def __new__(cls, lines: npt.NDArray[np.float64], starts: npt.NDArray[np.uint32]) -> Outlines: ...
    @property
    def area(self) -> float:
        """Area [m^2]; 0 where the lines enclose nothing."""

    @property
    def center(self) -> list[float]:
        """Centre of the area (2,) [m]."""

    def covers(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Return which points (N, 2) [m] lie inside; (N,)."""

    def filled(
        self,
        lower: Sequence[float],
        upper: Sequence[float],
        *,
        volume: float,
        particles: int,
        shrinks: bool,
        free: _OfPoints,
        depth: Sequence[float] | None = None,
    ) -> tuple[npt.NDArray[np.float64], float, float]:
        """Return the region that a fluid is to fill.

        Where the free part of the shape is smaller than the fluid, the shape grows, with its holes, until
        that part is as large. It gets 8 % more room than the fluid at rest in 2D, 15 % in 3D.

        Parameters
        ----------
        lower, upper : sequence of D floats
            Corners of the walls [m].
        volume : float
            Volume of the fluid at rest, in 2D its area [m^D].
        particles : int
            Number of its particles.
        shrinks : bool
            Whether a shape that is larger is shrunk, instead of filled evenly.
        free : callable
            Returns which of points (M, D) [m] no obstacle takes, (M,).
        depth : sequence of 2 floats, optional
            Middle and half length of the interval along the depth [m], in 3D.

        Returns
        -------
        cells : float64 (M, D)
            Centres of equal cells [m].
        side : float
            Side of a cell [m].
        scale : float
            Factor on the size of the shape [-].

        Raises
        ------
        ConfigError
            `free` returns another number of booleans.
        """

def pressed(
    cells: npt.NDArray[np.float64],
    side: float,
    *,
    lower: Sequence[float],
    upper: Sequence[float],
    volume: float,
    particles: int,
    free: _OfPoints,
) -> npt.NDArray[np.float64]:
    """Return cells of a region, moved inwards from its edges so that as places they press a fluid together.

    A fluid that has splashed contains voids, which places that fill the region evenly do not close. At a
    straight edge cells are moved by 5 distances of particles at rest in 2D, by 1.5 in 3D; deeper ones by
    less. Edges at walls and obstacles stay, and all cells where the region is much larger than the fluid.

    Parameters
    ----------
    cells : float64 (M, D)
        Centres [m], as of `Outlines.filled`, whose parameters the others are.
    side : float
        Side of a cell [m].

    Raises
    ------
    ConfigError
        Arrays that do not fit together, or `free` returns another number of booleans.
    """

def filled_solid(
    lower: Sequence[float],
    upper: Sequence[float],
    *,
    center: Sequence[float],
    low: Sequence[float],
    high: Sequence[float],
    solid: float,
    volume: float,
    particles: int,
    shrinks: bool,
    covers: _OfCells,
    free: _OfPoints,
) -> tuple[npt.NDArray[np.float64], float, float]:
    """Return the region of a solid that a fluid is to fill, as `Outlines.filled` does that of a shape.

    Parameters
    ----------
    center : sequence of 3 floats
        Centre from which the solid grows [m].
    low, high : sequence of 3 floats
        Corners of the box around it [m].
    solid : float
        Volume of the solid [m^3].
    covers : callable
        Called with the lower corner (3,) [m] of a box of cells, their side [m], their number along each axis
        and a factor; returns which of their centres lie in the solid grown by the factor, in one row, those
        along the last axis first.

    Others are those of `Outlines.filled`.

    Raises
    ------
    ConfigError
        `covers` or `free` returns another number of booleans.
    """

def match_to_region(
    x: npt.NDArray[np.float64],
    cells: npt.NDArray[np.float64],
    space: FreeSpace | None = None,
    side: float | None = None,
) -> Matching:
    """Fill a region evenly with as many places as there are particles, and give each particle one.

    Particles and places are divided into at most 208 groups each. Groups are assigned to each other exactly,
    by the least sum of squared ways (Crouse 2016, doi:10.1109/TAES.2016.140952), then the particles of each
    pair of groups, their centres laid upon each other. The same input gives the same bits.

    Parameters
    ----------
    x : float64 (N, D)
        Particles [m], at least one.
    cells : float64 (M, D)
        Centres of equal cells that make up the region [m]; several for each particle.
    space : FreeSpace, optional
        Obstacles to lead ways around; without it all ways are straight.
    side : float, optional
        Side of a cell [m]. With it, places that lie in no cell are moved to the middle of the nearest: a
        place is the mean of some cells, which may lie between two arms of a shape.

    Raises
    ------
    ConfigError
        Shapes that do not fit together, numbers that are not finite, or fewer cells than places.
    """

@final
class Timing:
    """How a way through K points is timed."""

    @property
    def times(self) -> npt.NDArray[np.float64]:
        """When each point is passed (K,), from 0 on [s]."""

    @property
    def velocities(self) -> npt.NDArray[np.float64]:
        """Velocity in each point (K, D) [m/s]."""

def least_acceleration(
    points: npt.NDArray[np.float64],
    start_velocity: Sequence[float],
    end_velocity: Sequence[float],
    seconds: float,
) -> Timing:
    """Time a way through points so that the integral of the squared acceleration is least.

    For given times that is the clamped cubic spline through the points. The times are searched.

    Parameters
    ----------
    points : float64 (K, D)
        [m], K >= 2.
    start_velocity, end_velocity : sequence of D floats
        [m/s].
    seconds : float > 0

    Raises
    ------
    ConfigError
        Shapes that do not fit together, or numbers out of range.
    """

@final
class Ways:
    """The law that keeps N particles on P ways, computed from where they really are.

    A particle at x with velocity u that is to be at y with velocity w after tau seconds gets the acceleration
    6 (y - x) / tau^2 - (4 u + 2 w) / tau - g, the first moment of the motion that has the least integral of
    |a|^2. On a way between two corners y is its end. On a way of several pieces y lies `ahead` frames ahead.

    A fluid that is torn in order to fill a shape does not get everywhere as planned: parts that meet stay
    about a cell apart, and between two arms some of it is left. So with `settling` optimal transport from the
    present state gives each particle a place of the region anew, every 20 frames. To it the force leads in
    the shortest time of a plan, 15 frames. The places of the last two times are kept, also in `to_bytes`.
    Where they are not there, as after a jump in time, they are found from the present state.

    Parameters
    ----------
    ids : uint64 (N,)
        Permanent numbers of the particles, ascending.
    weight : float64 (N,)
        Mass of each over that of all [-].
    starts : uint32 (P + 1,)
        Way p has the corners starts[p] to starts[p + 1] - 1, at least two.
    times : float64 (K,)
        When a corner is passed, from the start on [s]; increasing along each way.
    corners, v : float64 (K, D)
        Places of the corners [m] and velocities in them [m/s]; cubic pieces lie between.
    group : uint32 (N,)
        Way of each particle.
    places : float64 (N, D)
        Place of each particle at the end [m].
    end : sequence of D floats, optional
        Velocity of all at the end [m/s], with which the ways go on; rest if None.
    gravity : sequence of D floats
        What the force makes up for [m/s^2].
    frame_dt : float
        Length of a frame [s].
    smoothing : int in [0, 256]
        Cells along the longest side of the world of the grid that the force is put on and read from again, by
        linear weights, which keeps its momentum; 0 leaves it as it is.
    cap : float > 0
        Largest acceleration [m/s^2]; longer ones are shortened to it.
    ahead : int > 0
        [frames].
    unit : float > 0
        Longest side of the world [m].
    lower, spacing, distance : sequence of D floats, float, float64 with D axes, optional
        First node [m] of a grid, distance [m] of its nodes, and signed distance of the nearest obstacle in
        each [m]. A particle that an obstacle keeps from what it aims at goes the shortest way around it
        towards the ends of the ways.
    cells, side : float64 (M, D), float
        Centres of the cells of a region, and side of a cell [m].
    settling : (int, int), optional
        Frames since the start after which particles are given places in the region anew, and those in which
        it is to be reached.

    Raises
    ------
    ConfigError
        Arrays that do not fit together, or a number out of range.
    """

    def __new__(
        cls,
        *,
        ids: npt.NDArray[np.uint64],
        weight: npt.NDArray[np.float64],
        starts: npt.NDArray[np.uint32],
        times: npt.NDArray[np.float64],
        corners: npt.NDArray[np.float64],
        v: npt.NDArray[np.float64],
        group: npt.NDArray[np.uint32],
        places: npt.NDArray[np.float64],
        end: Sequence[float] | None,
        gravity: Sequence[float],
        frame_dt: float,
        smoothing: int,
        cap: float,
        ahead: int,
        unit: float,
        lower: Sequence[float] | None = None,
        spacing: float = 0.0,
        distance: npt.NDArray[np.float64] | None = None,
        cells: npt.NDArray[np.float64] | None = None,
        side: float = 0.0,
        settling: tuple[int, int] | None = None,
    ) -> Ways: ...
    @staticmethod
    def from_bytes(data: bytes, dim: int) -> Ways:
        """Return the law of `to_bytes`, in D = `dim` dimensions.

        Raises
        ------
        ConfigError
            The bytes are cut off, or of another kind, version or dimension.
        """

    def to_bytes(self) -> bytes:
        """Return the law with the places that it has found, little-endian."""

    @property
    def dim(self) -> int:
        """Dimension D."""

    @property
    def count(self) -> int:
        """Number N of particles."""

    @property
    def settles(self) -> bool:
        """Whether particles are given places of a region anew."""

    @property
    def places(self) -> npt.NDArray[np.float64]:
        """Ends of the particles' ways (N, D) [m]."""

    def force(
        self,
        index: int,
        ids: npt.NDArray[np.uint64],
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
    ) -> tuple[npt.NDArray[np.uint64] | None, npt.NDArray[np.float32]]:
        """Return the accelerations besides gravity in the frame after `index` frames since the start.

        Parameters
        ----------
        index : int
        ids : uint64 (M,)
            Permanent numbers of the particles that are there, ascending.
        x, v : float32 (M, D)
            Positions [m] and velocities [m/s].

        Returns
        -------
        rows : uint64 (L,) or None
            Rows of those who are led; None where these are all N in order.
        force : float32 (L, D)
            [m/s^2].

        Raises
        ------
        ConfigError
            Arrays that do not fit together.
        """

def push_force(
    x: npt.NDArray[np.float32],
    v: npt.NDArray[np.float32],
    *,
    point: Sequence[float],
    velocity: Sequence[float],
    radius: float,
    cap: float,
    frame_dt: float,
) -> npt.NDArray[np.float32]:
    """Return the accelerations (N, D) [m/s^2] by which a hand drags particles along.

    They are w (velocity - v) / (4 frame_dt) with w = (1 - r^2 / radius^2)^2 within the radius, computed in
    double precision; pages that play call the same function. `frame_dt` [s] is rounded to float32 first.

    Parameters
    ----------
    x, v : float32 (N, D)
        Positions [m] and velocities [m/s].
    point, velocity : sequence of D floats
        Middle [m] and velocity [m/s] of the hand.
    radius : float > 0
        [m].
    cap : float > 0
        Largest acceleration [g = 9.81 m/s^2].
    frame_dt : float
        Length of a frame [s].

    Raises
    ------
    ConfigError
        A number out of range, or shapes that do not fit together.
    """

def cpu_features() -> list[str]:
    """Instruction sets of this processor that matter for speed, e.g. "avx2", "fma"."""

def limit_instructions(widest: str) -> str:
    """Let solvers use no wider vector instructions from now on, in the whole process.

    The results stay the same bits; this is for comparing speeds.

    Parameters
    ----------
    widest : str
        "portable", "avx2" or "avx512".

    Returns
    -------
    str
        The set in use: the widest of those allowed that the processor has.

    Raises
    ------
    ConfigError
        There is no set of that name.
    """

def raise_if_cancelled() -> None:
    """Raise `FrameCancelledError` if a `CancelFlag` is set in whose block this thread is."""

def after_signals(hook: Callable[[], object]) -> None:
    """Call `hook` after each look for signals within a long call, which an exception of it ends."""
