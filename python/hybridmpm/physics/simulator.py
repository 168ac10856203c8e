"""`NeuralPhysics`: a learned simulator on a scene."""

import copy
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import flag, whole
from hybridmpm._support.packing import as_snapshot_error, from_bytes, to_bytes
from hybridmpm.coarse import CoarseSimulator, Upsampler
from hybridmpm.coarse.upsampler import restored
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import DomainError, NonFiniteError, SnapshotError
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import Model, as_stepper, model_from_dict, model_to_dict, name_of
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track, warmup_frames
from hybridmpm.scenarios.checked import checked_scene
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind
from hybridmpm.snapshots import SavedState

_MAGIC, _VERSION = b"HMPMNEUR", 3

_Floats = npt.NDArray[np.float32]


class NetworkStepper:
    """Advances n particles by frames of a network, without checks of arguments.

    Parameters
    ----------
    solver : MpmSolver
        Solver at frame 0 with the particles of the network; the stepper's own from now on.
    model : Stepper
        The network.
    """

    affine = None
    """None: a network does not predict velocity gradients."""

    def __init__(self, solver: MpmSolver, model: Stepper) -> None:
        self.solver = solver
        self.frame = 0
        """Number of frames since the start."""
        self.track = Track(model, solver.scene, solver.materials)
        self.track.observe(solver.positions)
        self._force = np.zeros((solver.particle_count, solver.dim), dtype=np.float32)

    @property
    def is_by_mpm(self) -> bool:
        """Whether MPM made the present state."""
        return self.frame == self.solver.frame

    @property
    def particle_count(self) -> int:
        """Number n of particles."""
        return self.solver.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (n,) of the particles: 0, 1, ..."""
        return self.solver.ids

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (n,) into the scene's materials."""
        return self.solver.material

    @property
    def mass(self) -> _Floats:
        """Masses (n,) [kg]."""
        return self.solver.mass

    @property
    def positions(self) -> _Floats:
        """Positions (n, D) [m]; a copy."""
        return self.solver.positions if self.is_by_mpm else self.track.positions.copy()

    @property
    def velocities(self) -> _Floats:
        """Velocities (n, D) [m/s]; a copy."""
        return self.solver.velocities if self.is_by_mpm else self.track.velocities

    def advance(self, force: _Floats | None) -> None:
        """Advance by one frame under an acceleration, (D,) or (n, D) [m/s^2], or change nothing and raise."""
        if self.track.ready:
            held = np.zeros(self.solver.dim, dtype=np.float32) if force is None else force
            self._advance_by_network(np.broadcast_to(held, self._force.shape))
        else:
            self.solver.advance(1, force)
            if self.solver.frame % self.track.r_t == 0:
                self.track.observe(self.solver.positions)
        self.frame += 1

    def _advance_by_network(self, force: _Floats) -> None:
        track = self.track.copy()  # a frame that fails leaves the state before it
        if not track.is_under_way:
            after = track.predict(force)
            track.begin(after, force)
            self._check(track)
        elif not np.array_equal(force, self._force):
            track.push(force - self._force)
            self._check(track)
        track.tick()
        if track.phase == track.r_t:
            track.arrive()
        # A copy: the caller's array may hold another force at the next frame.
        self.track, self._force = track, force.copy()

    def _check(self, track: Track) -> None:
        """Raise where a step ends at a position that is not finite or outside of the domain."""
        frame, end = self.frame + 1, track.end
        bad = ~np.isfinite(end).all(axis=1)
        if bad.any():
            raise NonFiniteError(
                f"particle {int(bad.argmax())} became non-finite in frame {frame}, in a network step: the "
                "scene is beyond what the network can do, or a force without bound acts"
            )
        lower, upper = track.walls
        beyond = np.maximum(lower - end, end - upper).max(axis=1, initial=0.0)
        if (beyond > self.solver.scene.dx).any():
            particle = int(beyond.argmax())
            raise DomainError(
                f"particle {particle} left the domain in frame {frame}, in a network step, at "
                f"{end[particle].tolist()} m; allowed is up to {self.solver.scene.dx:.2e} m past a wall"
            )

    def copy(self) -> Self:
        """Return an independent stepper in the same state; the two share the network."""
        twin = copy.copy(self)
        twin.solver, twin.track = self.solver.copy(), self.track.copy()
        return twin

    def to_dict(self) -> dict[str, Any]:
        """Return the state as plain data, for a snapshot."""
        return {
            "frame": self.frame,
            "force": np.ascontiguousarray(self._force),
            "solver": self.solver.snapshot(),
            "track": self.track.to_dict(),
        }

    def from_dict(self, tree: dict[str, Any]) -> Self:
        """Return a stepper of the same network and scene in the state that `to_dict` described.

        Raises
        ------
        SnapshotError
            The state belongs to another scene or network.
        """
        force, frame = tree["force"], tree["frame"]
        if force.shape != self._force.shape or not 0 <= frame <= 2**53:
            raise SnapshotError("the snapshot holds a force or a frame that do not fit")
        twin = self.copy()
        twin.solver.restore(tree["solver"])
        twin.track, twin.frame = self.track.from_dict(tree["track"]), frame
        twin._force = force  # noqa: SLF001 - of this very class
        return twin


class NeuralPhysics(CoarseSimulator):
    """A learned simulator on a scene.

    MPM simulates the first 5 r_t frames, which are the network's history. Then the network steps r_t frames
    at once, and frames between are interpolated. N is the number of particles that are shown, D the
    dimension; obstacles take part as kinematic particles that are not among the N.

    Parameters
    ----------
    scene : Scene
    model : str, Path or Stepper
        The network: name of a model of the library, an .onnx file, or anything that steps like a
        `NeuralModel`. "zero" is free fall.
    show_all : bool
        Where the network moves fewer particles than the scene has, show all of the scene
        (`coarse.Upsampler`): `positions`, `velocities`, `ids`, `mass` and `materials` are then those of
        the whole scene, and forces are given for them; `coarse_positions` are those that the network moves.
    threads : int in [1, 1024]
        Threads of the first frames, and of a network that is loaded here.

    Raises
    ------
    ConfigError
        The network was not made for such a scene, there is none of this name, or a setting is out of range.
    DataError
        The network's file is damaged.
    SceneError
        `scene` is no Scene, or it cannot be filled with particles.

    Notes
    -----
    A frame that fails raises `NonFiniteError`, `DomainError` or `GraphSizeError`, or in the first frames an
    error of `MpmSolver`, and the state is the one before that frame.

    A force that changes within a step of the network takes effect at once, and in the network from its next
    step on.
    """

    kind: ClassVar[Kind] = "neural"

    def __init__(self, scene: Scene, model: Model, *, show_all: bool = True, threads: int = 1) -> None:
        self._model = as_stepper(model, checked_scene(scene), threads=threads)
        self._model.check(scene)
        self._show_all, self._threads = flag("show_all", show_all), threads
        self._start(MpmSolver(scene, r_p=self._model.r_p, threads=threads))

    def _start(self, solver: MpmSolver) -> None:
        self._stepper = NetworkStepper(solver, self._model)
        shows_more = self._show_all and solver.r_p < 1
        self._shown_by = solver.upsampler_for(self._stepper) if shows_more else None

    def _traits(self) -> list[str]:
        return [f"model {name_of(self._model)}"]

    @property
    def _coarse(self) -> NetworkStepper:
        return self._stepper

    @property
    def _upsampler(self) -> Upsampler | None:
        return self._shown_by

    @property
    def _solver(self) -> MpmSolver:
        """MPM, which makes the first frames."""
        return self._stepper.solver

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
        return self._stepper.track.r_t

    @property
    def mode(self) -> Mode:
        """Simulator of the next frame: "mpm" in the first 5 r_t frames, then "neural"."""
        return "neural" if self._stepper.track.ready else "mpm"

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._stepper.frame

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """Substeps of MPM's latest frame; None before the first and where the network made it."""
        return self._solver.last_frame if self._stepper.is_by_mpm else None

    @property
    def log(self) -> tuple[Decision, ...]:
        """The one decision there is, once it is made: after the first frames the network takes over."""
        if not self._stepper.track.ready:
            return ()
        warmup = warmup_frames(self.r_t)
        return (Decision(frame=warmup, mode="neural", value=None, reason="warm-up", noticed=warmup),)

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant.

        A network predicts no stress: elastic energy is that of the last frame of MPM.
        """
        if self._stepper.is_by_mpm:
            return self._solver.diagnostics()
        solver = self._solver.copy()
        solver.prescribe(self._stepper.positions, self._stepper.velocities, self.frame)
        return solver.diagnostics()

    def _advance_coarse(self, force: _Floats | None) -> None:
        self._stepper.advance(force)

    def reset(self) -> None:
        """Go back to frame 0."""
        self._solver.reset()
        self._start(self._solver)

    def copy(self) -> Self:
        """Return an independent simulator in the same state; the two share the network."""
        twin = self._shallow()
        twin._stepper = self._stepper.copy()  # noqa: SLF001 - of this very class
        if self._shown_by is not None:
            twin._shown_by = self._shown_by.copy(twin._stepper)  # noqa: SLF001 - of this very class
        return twin

    def snapshot(self) -> bytes:
        """Return the complete state, versioned and checksummed. Going on from it gives the same bits."""
        self._update_shown()
        shown = None if self._upsampler is None else self._upsampler.snapshot()
        state = {"network": self._stepper.to_dict(), "shown": shown}
        return to_bytes(_MAGIC, _VERSION, state)

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene and network.

        Raises
        ------
        SnapshotError
            The bytes are damaged or belong to another scene; the present state is then untouched.
        """
        with as_snapshot_error("snapshot"):
            state = from_bytes(_MAGIC, _VERSION, data)
            stepper = self._stepper.from_dict(state["network"])
            self._shown_by = restored(self._shown_by, state["shown"], stepper)
        self._stepper = stepper

    def _arguments(self) -> dict[str, Any]:
        return {"model": self._model, "show_all": self._show_all, "threads": self._threads}

    def _notes(self) -> dict[str, Any]:
        return self._solver._notes()  # noqa: SLF001 - of this class's family

    def _take_notes(self, notes: dict[str, Any]) -> None:
        self._solver._take_notes(notes)  # noqa: SLF001 - of this class's family

    def _settings_to_save(self) -> dict[str, Any]:
        return {"model": model_to_dict(self._model), "show_all": self._show_all}

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
            stepper = model_from_dict(saved.settings["model"], model, saved.scene, threads=threads)
            return cls(saved.scene, stepper, show_all=saved.settings["show_all"], threads=threads)

        return cls._restored(path, make)
