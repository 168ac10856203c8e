"""`NeuralPhysics`: a scene that a network moves."""

import copy
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import flag, whole
from hybridmpm._support.packing import pack, unfitting, unpack
from hybridmpm.coarse import CoarseSimulator, Upsampler
from hybridmpm.coarse.upsampler import recalled as recalled_upsampler
from hybridmpm.decisions import Decision, Mode
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.frames import NetworkFrames
from hybridmpm.physics.load import Model, as_stepper, described, name_of, recalled
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import warmup_frames
from hybridmpm.scenarios.checked import checked_scene
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind
from hybridmpm.snapshots import SavedState

_MAGIC, _VERSION = b"HMPMNEUR", 2

_Floats = npt.NDArray[np.float32]


class NeuralPhysics(CoarseSimulator):
    """A learned simulator on a scene.

    MPM makes the first 5 r_t frames, which the network looks back on. From then on the network steps r_t
    frames at once, and frames between are interpolated. N is the number of particles that are shown, D the
    dimension; obstacles take part as kinematic particles that are not among the N.

    Parameters
    ----------
    scene : Scene
    model : str, Path or Stepper
        The network: name of a model of the library, an .onnx file, or anything that steps like a
        `NeuralModel`. "zero" is free fall.
    show_all : bool
        Where the network moves fewer particles than the scene has, carry all of them along
        (`downsampling.Upsampler`): `positions`, `velocities`, `ids`, `mass` and `materials` are then those of
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

    A force that changes within a step of the network takes effect at once; the network sees it from its next
    step on.
    """

    kind: ClassVar[Kind] = "neural"

    def __init__(self, scene: Scene, model: Model, *, show_all: bool = True, threads: int = 1) -> None:
        self._model = as_stepper(model, checked_scene(scene), threads=threads)
        self._model.check(scene)
        self._show_all = flag("show_all", show_all)
        self._start(MpmSolver(scene, r_p=self._model.r_p, threads=threads))

    def _start(self, solver: MpmSolver) -> None:
        self._frames = NetworkFrames(solver, self._model)
        carrying = self._show_all and solver.r_p < 1
        self._shown_by = solver.upsampler_for(self._frames) if carrying else None

    def _traits(self) -> list[str]:
        return [f"model {name_of(self._model)}"]

    @property
    def _few(self) -> NetworkFrames:
        return self._frames

    @property
    def _upsampler(self) -> Upsampler | None:
        return self._shown_by

    @property
    def _solver(self) -> MpmSolver:
        """MPM, which makes the first frames."""
        return self._frames.solver

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
        return self._frames.track.r_t

    @property
    def mode(self) -> Mode:
        """Who simulates the next frame: "mpm" in the first 5 r_t frames, then "neural"."""
        return "neural" if self._frames.track.ready else "mpm"

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._frames.frame

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """How MPM cut its latest frame; None before the first and where the network made it."""
        return self._solver.last_frame if self._frames.is_by_mpm else None

    @property
    def log(self) -> tuple[Decision, ...]:
        """The one decision there is, once it is made: after the first frames the network takes over."""
        if not self._frames.track.ready:
            return ()
        warmup = warmup_frames(self.r_t)
        return (Decision(frame=warmup, mode="neural", value=None, reason="warm-up", noticed=warmup),)

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant.

        A network knows no stress: elastic energy is that of the last frame that MPM made.
        """
        if self._frames.is_by_mpm:
            return self._solver.diagnostics()
        solver = self._solver.copy()
        solver.prescribe(self._frames.positions, self._frames.velocities, self.frame)
        return solver.diagnostics()

    def _advance_few(self, force: _Floats | None) -> None:
        self._frames.advance(force)

    def cancel_by(self, flag: _core.CancelFlag) -> None:
        """Let another thread end the frame that is being computed; see `Simulator.cancel_by`."""
        super().cancel_by(flag)
        self._solver.cancel_by(flag)

    def reset(self) -> None:
        """Go back to frame 0."""
        self._solver.reset()
        self._start(self._solver)

    def copy(self) -> Self:
        """Return an independent simulator in the same state; the two share the network."""
        twin = copy.copy(self)
        twin._frames = self._frames.copy()  # noqa: SLF001 - of this very class
        if self._shown_by is not None:
            twin._shown_by = self._shown_by.copy(twin._frames)  # noqa: SLF001 - of this very class
        return twin

    def snapshot(self) -> bytes:
        """Return the complete state, versioned and checksummed. Going on from it gives the same bits."""
        carried = None if self._upsampler is None else self._upsampler.snapshot()
        state = {"frames": self._frames.remember(), "coarse": carried}
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
            upsampler = recalled_upsampler(self._shown_by, state["coarse"])
            self._frames.recall(state["frames"])
        self._shown_by = upsampler

    def _settings_to_save(self) -> dict[str, Any]:
        return {"model": described(self._model), "show_all": self._show_all}

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
            return cls(saved.scene, stepper, show_all=saved.settings["show_all"], threads=threads)

        return cls._restored(path, make)
