"""`Simulator`: the interface of all simulators."""

import hashlib
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support import signals
from hybridmpm._support.arguments import whole
from hybridmpm.decisions import Decision, Mode, frames_of_mpm
from hybridmpm.errors import ConfigError, SnapshotError
from hybridmpm.force import CheckedForce, Force, checked_force
from hybridmpm.probes import Probe
from hybridmpm.probes.probe import PressureSamples
from hybridmpm.probes.series import checked_probe
from hybridmpm.render import notebook
from hybridmpm.scene import Scene
from hybridmpm.snapshots import SavedState, read_state, write_state

Kind = Literal["mpm", "neural", "hybrid"]
"""Names of the three simulators: MPM, a network, or a network that MPM takes over from."""

MAX_FRAMES_AT_ONCE = 1_000_000

_Floats = npt.NDArray[np.float32]


def digest_of(
    ids: npt.NDArray[np.uint64], positions: _Floats, velocities: _Floats, rigid: npt.NDArray[np.float64]
) -> str:
    """Return the SHA-256 of ids (uint64), positions, velocities (float32) and the numbers of rigid bodies.

    All are little-endian, one after the other. Numbers (B, 13) of bodies are float64; B may be 0.
    """
    digest = hashlib.sha256(ids.astype("<u8").tobytes())
    for array in (positions, velocities):
        digest.update(array.astype("<f4").tobytes())
    digest.update(rigid.astype("<f8").tobytes())
    return digest.hexdigest()


class Simulator(ABC):
    """Particles of a scene that advance by whole frames.

    N is the number of particles, D the dimension. A frame that fails raises an error that names particle and
    frame, and the state is the one before that frame. The same scene, settings and calls give the same bits.
    Ctrl-C ends a call within a frame, and so does another thread by a `CancelFlag`; the state is then the one
    after the last frame that is whole.

    Arrays of a simulator are snapshots of its state, which do not change when it advances. They are
    read-only, because writing to them would move no particle. `positions.copy()` may be changed.
    """

    kind: ClassVar[Kind]
    """Name of this kind of simulator: "mpm", "neural" or "hybrid"."""

    def __repr__(self) -> str:
        count = f"{self.particle_count} particles"
        parts = (self.scene.title, *self._traits(), count, f"frame {self.frame}")
        return f"{type(self).__name__}({', '.join(parts)})"

    def _traits(self) -> Sequence[str]:
        """Return distinguishing settings, for `repr`."""
        return ()

    def _repr_html_(self) -> str:
        return notebook.figure(self._picture(notebook.WIDTH), repr(self))

    def show(self, width: int = notebook.WIDTH) -> None:
        """Show a picture of the present state, in a notebook or else in the system's viewer of pictures.

        Within one cell of a notebook each picture takes the place of the one before, so that
        `for _ in range(100): solver.advance(4); solver.show()` is a film.

        Parameters
        ----------
        width : int in [64, 4096]
            Width of the picture [pixels].

        Raises
        ------
        ConfigError
            `width` is out of range.
        ExportError
            There is neither a notebook nor a viewer.
        """
        notebook.show(self, self._picture(width), repr(self))

    def _picture(self, width: int) -> npt.NDArray[np.uint8]:
        view = notebook.view_for(self, self.scene, self.materials, width, self.particle_spacing)
        return view.draw(self.positions, self.velocities, self.time, self.rigid_numbers())

    def pull(
        self,
        body: int,
        grip: npt.ArrayLike,
        target: npt.ArrayLike,
        *,
        reach: float,
        strength: float,
    ) -> None:
        """Pull at a rigid body in the next frame; `control.pull` describes the force and its arguments.

        Raises
        ------
        ConfigError
            There is no such rigid body, or a number is out of range.
        """
        del body, grip, target, reach, strength
        raise ConfigError(
            f"a simulator of kind {self.kind!r} has no rigid bodies: pull at those of an MpmSolver"
        )

    def rigid_numbers(self) -> npt.NDArray[np.float64]:
        """Return the numbers (B, 13) of the scene's rigid bodies, as `_core.Solver.rigid` has them."""
        return np.empty((0, 13))

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """The scene that this simulator was made from."""

    @property
    def dim(self) -> int:
        """Dimension D, 2 or 3."""
        return self.scene.dim

    @property
    @abstractmethod
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""

    @property
    @abstractmethod
    def r_t(self) -> int:
        """Number of frames that one step of the network spans; 1 where MPM simulates alone."""

    @property
    @abstractmethod
    def mode(self) -> Mode:
        """Simulator of the next frame, if no force acts on it: "mpm" or "neural"."""

    @property
    @abstractmethod
    def frame(self) -> int:
        """Number of frames since the start."""

    @property
    def particle_spacing(self) -> float:
        """Distance of the particles of `positions` at rest [m]: above the scene's where they are merged."""
        return float(self.scene.spacing / self.r_p ** (1 / self.dim))

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self.frame * self.scene.frame_dt

    @property
    @abstractmethod
    def particle_count(self) -> int:
        """Number N of particles at present."""

    @property
    @abstractmethod
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that the particles keep for good, ascending; a snapshot, read-only."""

    @property
    @abstractmethod
    def positions(self) -> _Floats:
        """Positions (N, D) [m]; a snapshot, read-only."""

    @property
    @abstractmethod
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s]; a snapshot, read-only."""

    @property
    @abstractmethod
    def materials(self) -> npt.NDArray[np.uint8]:
        """Particle types (N,): 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid; a snapshot, read-only."""

    @property
    @abstractmethod
    def mass(self) -> _Floats:
        """Masses (N,) [kg], in 2D those of a slice one metre deep; a snapshot, read-only."""

    @property
    @abstractmethod
    def last_frame(self) -> _core.FrameReport | None:
        """Substeps of MPM's latest frame; None before the first and where a network made it."""

    @property
    @abstractmethod
    def log(self) -> tuple[Decision, ...]:
        """All decisions so far between network and MPM, in order; those undone later stay among them."""

    @property
    def mpm_share(self) -> float:
        """Share of the frames so far that MPM simulated; 1 before the first. Frames redone count once."""
        return frames_of_mpm(self.log, self.frame) / self.frame if self.frame else 1.0

    @property
    def safeguard(self) -> float | None:
        """Value of the safeguard of the network; None where there is none, or none yet."""
        return None

    @abstractmethod
    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant."""

    def digest(self) -> str:
        """Return `digest_of` the present state, which pages that play and logs of sessions have, too."""
        return digest_of(self.ids, self.positions, self.velocities, self.rigid_numbers())

    def probe(self, probe: Probe) -> npt.NDArray[np.float64]:
        """Return the reading of a probe of `hybridmpm.probes` at this instant.

        `probes.record` reads several while the simulator advances.

        Returns
        -------
        float64 () or (K,)
            The reading, in the unit `probe.unit`; one for each of K points.

        Raises
        ------
        ConfigError
            It is no probe, lies outside of the walls, or reads a pressure where a network simulates.
        """
        checked_probe(probe).check(self.scene)
        return probe.read(self)

    def pressure_samples(self) -> PressureSamples:
        """Return the pressures of the particles that are simulated.

        Raises
        ------
        ConfigError
            A network simulates, which predicts no stress.
        """
        raise ConfigError(
            f"a simulator of kind {self.kind!r} has no pressure: read it off an MpmSolver of the same scene"
        )

    def keep_forces(self) -> None:
        """Sum the forces on walls and obstacles in all later frames, for `frame_forces`.

        `probes.record` calls it where it has to. The sums take up to 1 % of a frame in 2D, and 3 % in 3D.

        Raises
        ------
        ConfigError
            A network simulates, or parts of the matter may sleep.
        """
        raise ConfigError(
            f"a simulator of kind {self.kind!r} has no forces: read them off an MpmSolver of the same scene"
        )

    def frame_forces(self) -> npt.NDArray[np.float64]:
        """Return the mean forces of the material on walls and obstacles over the latest frame.

        Returns
        -------
        float64 (2 D + n, 3) in 2D, (2 D + n, 6) in 3D
            A row for each wall, x_lower first, then x_upper and y_lower, and for each of n obstacles: D
            components of the force [N], then the torque about the origin [N m], 1 number in 2D, 3 in 3D. In
            2D per metre of depth. NaN before the first frame after `keep_forces`, and after a restore.

        Raises
        ------
        ConfigError
            `keep_forces` was not called, a network simulates, or parts of the matter may sleep.
        """
        raise ConfigError(
            f"a simulator of kind {self.kind!r} has no forces: read them off an MpmSolver of the same scene"
        )

    def advance(self, frames: int = 1, force: Force = None) -> None:
        """Advance by whole frames.

        Parameters
        ----------
        frames : int in [0, 1000000]
            Number T of frames.
        force : optional
            External acceleration [m/s^2] besides gravity, taken as float32:

            - (D,): the same for all particles, over the whole call;
            - (N, D): one for each particle, held over the call;
            - (T, N, D): one for each frame and particle;
            - a function, called before each frame with this simulator: it returns (D,), (N, D), a pair as
              below with (K, D), or None;
            - a pair (ids (K,), accelerations (K, D) or (T, K, D)): other particles get none, and ids of
              removed particles are ignored.

            Where particles come and go, arrays (N, D) are for one frame at a time and (T, N, D) is refused.

        Raises
        ------
        ForceError
            The force has a wrong shape, is not finite, or its function raised. An array is checked before
            anything moves; with a function the frames before the one it failed at are done.
        ConfigError
            `frames` is out of range; nothing has moved.
        SimulationError
            A frame failed; the message names particle and frame. The state is then the one before it.
        """
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        self._advance(frames, checked_force(force, self, frames), None)

    def rollout(self, frames: int, force: Force = None) -> _Floats:
        """Advance, and return the positions of the particles after each frame.

        Parameters and errors are those of `advance`.

        Returns
        -------
        float32 (frames + 1, N, D)
            Positions [m] as they were shown; the first row is the state before the call.

        Raises
        ------
        ConfigError
            The scene has emitters or sinks, so N may change.
        """
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        if self.scene.is_open:
            raise ConfigError(
                "rollout needs a fixed number of particles, but this scene has emitters or sinks: use "
                "hybridmpm.recording.record, which follows particles that come and go"
            )
        checked = checked_force(force, self, frames)
        path = np.empty((frames + 1, self.particle_count, self.dim), dtype=np.float32)
        path[0] = self.positions
        self._advance(frames, checked, path[1:])
        return path

    def _advance(self, frames: int, force: CheckedForce, path: _Floats | None) -> None:
        """Advance by frames, and write the positions after each into a row of `path` (frames, N, D)."""
        for index in range(frames):
            _core.raise_if_cancelled()
            given = force.at(index)
            with signals.whole():
                self._advance_frame(given)
            if path is not None:
                path[index] = self.positions

    @abstractmethod
    def _advance_frame(self, force: _Floats | None) -> None:
        """Advance by one frame under a checked acceleration, (D,) or (N, D) [m/s^2]."""

    @abstractmethod
    def reset(self) -> None:
        """Go back to frame 0."""

    @abstractmethod
    def copy(self) -> Self:
        """Return an independent simulator in the same state; a network is shared.

        `copy.copy` and `copy.deepcopy` do the same. A pickle contains scene, settings, network and state, so
        that a simulator may be sent to another process.
        """

    def __copy__(self) -> Self:
        return self.copy()

    def __deepcopy__(self, _memo: dict[int, Any]) -> Self:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), self.scene, self._arguments(), self.snapshot(), self._notes())

    def _arguments(self) -> dict[str, Any]:
        """Return the arguments that make an equal simulator of the scene."""
        raise TypeError(f"a {type(self).__name__} cannot be pickled: its class does not define `_arguments`")

    def _notes(self) -> dict[str, Any]:
        """Return what a snapshot leaves out: reports of the latest frames, and warnings that were given."""
        return {}

    def _take_notes(self, notes: dict[str, Any]) -> None:
        """Take what `_notes` of a simulator in the same state has returned."""
        del notes

    def _shallow(self) -> Self:
        """Return an object with the same attributes, for `copy`."""
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__)
        return twin

    @abstractmethod
    def snapshot(self) -> bytes:
        """Return the complete state, versioned and checksummed. Going on from it gives the same bits."""

    @abstractmethod
    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene and settings.

        Raises
        ------
        SnapshotError
            The bytes are damaged or belong to another scene; the present state is then untouched.
        """

    def save(self, path: str | Path) -> None:
        """Write scene, settings and state to a file that `load` goes on from with the same bits.

        The file appears under its name only once it is complete. It contains the names of networks, not them.

        Raises
        ------
        ExportError
            The folder does not exist or refuses the file.
        """
        saved = SavedState(
            kind=self.kind,
            scene=self.scene,
            settings=self._settings_to_save(),
            frame=self.frame,
            state=self.snapshot(),
        )
        write_state(Path(path), saved)

    @abstractmethod
    def _settings_to_save(self) -> dict[str, Any]:
        """Return the settings that `load` makes an equal simulator from, as plain data for JSON."""

    @classmethod
    def _restored(cls, path: str | Path, make: Callable[[SavedState], Self]) -> Self:
        """Read a file, make its simulator, and put that into the saved state.

        Raises
        ------
        SnapshotError
            The file, its settings, its network or its state is wrong; the message names the file.
        OSError
            The file cannot be read.
        """
        saved = read_state(Path(path))
        if saved.kind != cls.kind:
            raise SnapshotError(
                f"{path} holds the state of a simulator of kind {saved.kind!r}, and {cls.__name__} is of "
                f"kind {cls.kind!r}: use hybridmpm.load, which reads all kinds"
            )
        try:
            simulator = make(saved)
            simulator.restore(saved.state)
        except Exception as error:
            raise SnapshotError(f"{path} cannot be restored: {error}") from error
        return simulator


def _rebuilt(
    cls: type[Simulator], scene: Scene, arguments: dict[str, Any], state: bytes, notes: dict[str, Any]
) -> Simulator:
    """Return the simulator of a pickle."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # raised where it was made
        simulator = cls(scene, **arguments)  # type: ignore[call-arg]  # each kind has its own
    simulator.restore(state)
    simulator._take_notes(notes)
    return simulator


def checked_simulator(value: object) -> Simulator:
    """Return a value that is a simulator, or raise `ConfigError` with a remedy."""
    if isinstance(value, Simulator):
        return value
    advice = ": write MpmSolver(scene)" if isinstance(value, Scene) else ""
    raise ConfigError(f"a simulator is required, such as an MpmSolver; got a {type(value).__name__}{advice}")
