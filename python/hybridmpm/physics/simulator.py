"""`NeuralPhysics`: a scene that a network moves."""

import copy
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm._support.arguments import whole
from hybridmpm._support.packing import pack, unfitting, unpack
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import DomainError, NonFiniteError, SnapshotError
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import Model, as_stepper, described, recalled
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track, warmup_frames
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind, Simulator
from hybridmpm.snapshots import SavedState

_MAGIC, _VERSION = b"HMPMNEUR", 1

_Floats = npt.NDArray[np.float32]


class NeuralPhysics(Simulator):
    """A learned simulator on a scene.

    MPM makes the first 5 r_t frames, which the network looks back on. From then on the network steps r_t
    frames at once, and frames between are interpolated. N is the number of fluid particles, D the dimension;
    obstacles take part as kinematic particles that are not among the N.

    Parameters
    ----------
    scene : Scene
    model : str, Path or Stepper
        The network: name of a model of the library, an .onnx file, or anything that steps like a
        `NeuralModel`. "zero" is free fall.
    threads : int in [1, 1024]
        Threads of the first frames, and of a network that is loaded here.

    Raises
    ------
    ConfigError
        The network was not made for such a scene, there is none of this name, or a setting is out of range.
    DataError
        The network's file is damaged.
    SceneError
        The scene cannot be filled with particles.

    Notes
    -----
    A frame that fails raises `NonFiniteError`, `DomainError` or `GraphSizeError`, or in the first frames an
    error of `MpmSolver`, and the state is the one before that frame.

    A force that changes within a step of the network takes effect at once; the network sees it from its next
    step on.
    """

    kind: ClassVar[Kind] = "neural"

    def __init__(self, scene: Scene, model: Model, *, threads: int = 1) -> None:
        self._model = as_stepper(model, scene, threads=threads)
        self._model.check(scene)
        self._solver = MpmSolver(scene, r_p=self._model.r_p, threads=threads)
        self._start()

    def _start(self) -> None:
        self._frame = 0
        self._force = np.zeros((self.particle_count, self.dim), dtype=np.float32)
        self._track = Track(self._model, self.scene, self.materials)
        self._track.observe(self._solver.positions)

    @property
    def model(self) -> Stepper:
        """The network."""
        return self._model

    @property
    def scene(self) -> Scene:
        """The scene that this simulator was made from."""
        return self._solver.scene

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]: the network's."""
        return self._solver.r_p

    @property
    def r_t(self) -> int:
        """Number of frames that one step of the network spans."""
        return self._track.r_t

    @property
    def mode(self) -> Mode:
        """Who simulates the next frame: "mpm" in the first 5 r_t frames, then "neural"."""
        return "neural" if self._track.ready else "mpm"

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._frame

    @property
    def particle_count(self) -> int:
        """Number N of particles."""
        return self._solver.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) of the particles: 0, 1, ..."""
        return self._solver.ids

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m]; a copy."""
        return self._solver.positions if self._by_mpm else self._track.positions.copy()

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s]; a copy."""
        return self._solver.velocities if self._by_mpm else self._track.velocities

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,), read-only: 5 water, 6 sand, 7 elastic (goop)."""
        return self._solver.materials

    @property
    def mass(self) -> _Floats:
        """Masses (N,) [kg], read-only; in 2D those of a slice one metre deep."""
        return self._solver.mass

    @property
    def last_frame(self) -> _native.FrameReport | None:
        """How MPM cut its latest frame; None before the first and where the network made it."""
        return self._solver.last_frame if self._by_mpm else None

    @property
    def log(self) -> tuple[Decision, ...]:
        """The one decision there is, once it is made: after the first frames the network takes over."""
        if not self._track.ready:
            return ()
        warmup = warmup_frames(self.r_t)
        return (Decision(frame=warmup, mode="neural", value=None, reason="warm-up", noticed=warmup),)

    def diagnostics(self) -> _native.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant.

        A network knows no stress: elastic energy is that of the last frame that MPM made.
        """
        if self._by_mpm:
            return self._solver.diagnostics()
        solver = self._solver.copy()
        solver.prescribe(self.positions, self.velocities, self._frame)
        return solver.diagnostics()

    def _advance_frame(self, force: _Floats | None) -> None:
        if self._track.ready:
            held = np.zeros(self.dim, dtype=np.float32) if force is None else force
            self._advance_by_network(np.broadcast_to(held, self._force.shape))
        else:
            self._solver.advance(1, force)
            if self._solver.frame % self.r_t == 0:
                self._track.observe(self._solver.positions)
        self._frame += 1

    def _advance_by_network(self, force: _Floats) -> None:
        track = self._track.copy()  # a frame that fails leaves the state before it
        if not track.is_under_way:
            after = track.answer(force)
            track.begin(after, force)
            self._check(track)
        elif not np.array_equal(force, self._force):
            track.push(force - self._force)
            self._check(track)
        track.tick()
        if track.phase == track.r_t:
            track.arrive()
        # A copy: the caller's array may hold another force at the next frame.
        self._track, self._force = track, force.copy()

    def _check(self, track: Track) -> None:
        """Refuse a step that leads nowhere that a particle may be."""
        frame, end = self._frame + 1, track.end
        bad = ~np.isfinite(end).all(axis=1)
        if bad.any():
            raise NonFiniteError(
                f"particle {int(bad.argmax())} became non-finite in frame {frame}, in a network step: the "
                "scene is beyond what the network can do, or a force without bound acts"
            )
        lower, upper = track.walls
        beyond = np.maximum(lower - end, end - upper).max(axis=1, initial=0.0)
        if (beyond > self.scene.dx).any():
            particle = int(beyond.argmax())
            raise DomainError(
                f"particle {particle} left the domain in frame {frame}, in a network step, at "
                f"{end[particle].tolist()} m; allowed is up to {self.scene.dx:.2e} m past a wall"
            )

    @property
    def _by_mpm(self) -> bool:
        """Whether MPM made the present state."""
        return self._frame == self._solver.frame

    def cancel_by(self, flag: _native.CancelFlag) -> None:
        """Let another thread end the frame that is being computed; see `Simulator.cancel_by`."""
        super().cancel_by(flag)
        self._solver.cancel_by(flag)

    def reset(self) -> None:
        """Go back to frame 0."""
        self._solver.reset()
        self._start()

    def copy(self) -> Self:
        """Return an independent simulator in the same state; the two share the network."""
        twin = copy.copy(self)
        twin._solver, twin._track = self._solver.copy(), self._track.copy()  # noqa: SLF001 - of this class
        return twin

    def snapshot(self) -> bytes:
        """Return the complete state, versioned and checksummed. Going on from it gives the same bits."""
        state = {
            "frame": self._frame,
            "force": np.ascontiguousarray(self._force),
            "solver": self._solver.snapshot(),
            "track": self._track.remember(),
        }
        return pack(_MAGIC, _VERSION, state)

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene and network.

        Raises
        ------
        SnapshotError
            The bytes are damaged or belong to another scene; the present state is then untouched.
        """
        with unfitting("snapshot"):
            state = unpack(_MAGIC, _VERSION, data)
            track, force, frame = self._track.copy(), state["force"], state["frame"]
            track.recall(state["track"])
            if force.shape != self._force.shape or not 0 <= frame <= 2**53:
                raise SnapshotError("the snapshot holds a force or a frame that do not fit")
            self._solver.restore(state["solver"])
        self._track, self._force, self._frame = track, force, frame

    def _settings_to_save(self) -> dict[str, Any]:
        return {"model": described(self._model)}

    @classmethod
    def load(cls, path: str | Path, *, model: Model | None = None, threads: int = 1) -> Self:
        """Build the simulator of a file that `save` wrote, in the state it was in.

        Parameters
        ----------
        path : str or Path
        model : str, Path or Stepper, optional
            The network, where the file does not name one that is here. The file holds no network.
        threads : int in [1, 1024]
            May differ from before; the result does not depend on it.

        Raises
        ------
        SnapshotError
            The file is foreign, damaged, cut off, of another version, or its network is missing or another;
            the message names the file.
        OSError
            The file cannot be read.
        """
        threads = whole("threads", threads, 1, 1024)

        def make(saved: SavedState) -> Any:
            stepper = recalled(saved.settings["model"], model, saved.scene, threads=threads)
            return cls(saved.scene, stepper, threads=threads)

        return cls._restored(path, make)
