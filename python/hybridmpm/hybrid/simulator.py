"""`HybridSimulator`: a network with guards, and MPM as its fallback."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import flag, real, whole
from hybridmpm._support.packing import as_snapshot_error, from_bytes, to_bytes
from hybridmpm.coarse import CoarseSimulator, Upsampler
from hybridmpm.coarse.merging import checked_ratio
from hybridmpm.decisions import Decision, Mode, StepCounts
from hybridmpm.errors import ConfigError
from hybridmpm.hybrid.guard import Guard
from hybridmpm.hybrid.guards import DEFAULT, Cosine, build, from_saved_settings, saved_settings
from hybridmpm.hybrid.loop import HybridLoop
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import Model, as_stepper, model_from_dict, model_to_dict, name_of
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scenarios.checked import checked_scene
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind
from hybridmpm.snapshots import SavedState

MAX_WINDOW = 100
"""Largest number of steps in a window; the history keeps two windows."""
_MAGIC, _VERSION = b"HMPMHYBR", 4

_Floats = npt.NDArray[np.float32]


class HybridSimulator(CoarseSimulator):
    """A network simulates until one of its guards alarms, and MPM otherwise, on the same particles.

    MPM simulates the first 5 `r_t` frames, which are the network's history, every frame with an external
    force, and some steps after each alarm. An alarm refuses the network's step, and with some guards the
    steps before it (`Guard.undo`): MPM then redoes their frames within the same call. After a failure soon
    after another one the network waits for twice as many steps. Where all particles fall freely, or all are
    at rest, neither network nor MPM is evaluated.

    Parameters
    ----------
    scene : Scene
        Scene without emitters, sinks and moving obstacles.
    model : str, Path or Stepper
        The network: name of a model of the library, an .onnx file, or anything that steps like a
        `NeuralModel`. "zero" is free fall.
    r_c : float in [-1, 1], optional
        Mean cosine between the accelerations of two windows of time below which the cosine guard alarms.
        Where it is given, that guard is added to `guards`. In `guards` without `r_c` it alarms below 0.8.
    window : int in [1, 100]
        Steps of the network in each of the two windows.
    wait : int in [1, 100]
        Steps that MPM simulates after an alarm before the network takes over again; up to four times as many
        after repeated failures.
    shortcuts : bool
        Compute steps in which all particles fall freely, or all are at rest, without the network; and keep
        resting particles where they are in the network's own steps.
    guards : sequence of str or Guard
        Names as in `hybrid.GUARDS`, or guards with other settings. Without guards the network is never
        overruled; a state that cannot be physical raises an error.
    show_all : bool
        Where the network moves fewer particles than the scene has, show all of the scene
        (`coarse.Upsampler`): `positions`, `velocities`, `ids`, `mass` and `materials` are then those of
        the whole scene, and forces are given for them; `coarse_positions` are those that are simulated.
    threads : int in [1, 1024]
        Threads of MPM and of a network that is loaded here; the result does not depend on them.

    Raises
    ------
    ConfigError
        A setting is out of range, there is no such network, it was not made for such a scene, or the scene
        cannot be simulated by a network.
    DataError
        The network's file is damaged.
    SceneError
        `scene` is no Scene, or it cannot be filled with particles.

    Notes
    -----
    round(r_p N_h) particles are simulated, in the order of `MpmSolver(scene, r_p=...)`. Between two steps of
    the network positions and velocities are interpolated. Undone steps are undone for the particles shown,
    too. The same scene, network and calls give the same bits.

    A frame fails with `NonFiniteError`, `DomainError`, `InvertedError` or `StepSizeError` where MPM failed,
    or the network where no guard watches it. Rows of a rollout stay as they were where later frames are
    undone.
    """

    kind: ClassVar[Kind] = "hybrid"

    def __init__(
        self,
        scene: Scene,
        model: Model,
        *,
        r_c: float | None = None,
        window: int = 10,
        wait: int = 1,
        shortcuts: bool = True,
        guards: Sequence[str | Guard] = DEFAULT,
        show_all: bool = True,
        threads: int = 1,
    ) -> None:
        _check_scene(checked_scene(scene))
        self._model = as_stepper(model, scene, threads=threads)
        self._model.check(scene)
        self._guards = build(guards, None if r_c is None else real("r_c", r_c, -1, 1))
        self._settings: dict[str, Any] = {
            "window": whole("window", window, 1, MAX_WINDOW),
            "wait": whole("wait", wait, 1, MAX_WINDOW),
            "shortcuts": flag("shortcuts", shortcuts),
        }
        self._show_all, self._threads = flag("show_all", show_all), threads
        mpm = MpmSolver(scene, r_p=checked_ratio(self._model.r_p), threads=threads)
        self._loop = HybridLoop(
            mpm, self._model, self._guards, **self._settings, show_all=self._show_all and mpm.r_p < 1
        )

    def _traits(self) -> list[str]:
        simulates = {"mpm": "MPM", "neural": "the network"}[self.mode]
        return [f"model {name_of(self._model)}", f"{simulates} simulates"]

    @property
    def model(self) -> Stepper:
        """The network."""
        return self._model

    @property
    def _coarse(self) -> HybridLoop:
        return self._loop

    @property
    def _upsampler(self) -> Upsampler | None:
        return self._loop.state.upsampler

    @property
    def _mpm(self) -> MpmSolver:
        return self._loop.state.mpm

    @property
    def scene(self) -> Scene:
        """The scene that this simulator was made from."""
        return self._mpm.scene

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]: the network's."""
        return self._mpm.r_p

    @property
    def r_t(self) -> int:
        """Number of frames that one step of the network spans."""
        return self._loop.state.network.track.r_t

    @property
    def resolution(self) -> int:
        """Number of MPM's grid cells per metre."""
        return self._mpm.resolution

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._loop.state.network.frame

    @property
    def mode(self) -> Mode:
        """Simulator of the next frame, if no force acts on it: "mpm" or "neural".

        With "neural" free fall or rest may stand in for the network; see `step_counts`.
        """
        return self._loop.state.mode

    @property
    def safeguard(self) -> float | None:
        """Mean cosine between the accelerations of the last two windows; None until both are full."""
        return self._loop.state.network.safeguard

    @property
    def r_c(self) -> float | None:
        """Value of `safeguard` below which the cosine guard alarms; None where it is not among the guards."""
        return next((guard.r_c for guard in self._guards if isinstance(guard, Cosine)), None)

    @property
    def log(self) -> tuple[Decision, ...]:
        """All decisions so far between network and MPM, in the order in which they were made."""
        return tuple(self._loop.state.log)

    @property
    def step_counts(self) -> StepCounts:
        """Numbers of the frames that MPM did not simulate: by the network, by free fall, and by rest."""
        return self._loop.state.network.counts

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """Substeps of MPM's latest frame; None before the first and where the network made it."""
        return None if self._loop.is_between else self._mpm.last_frame

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant."""
        mpm = self._mpm
        if self._loop.is_between:
            mpm = mpm.copy()
            mpm.prescribe(self._loop.positions, self._loop.velocities, self.frame)
        return mpm.diagnostics()

    def _advance_coarse(self, force: _Floats | None) -> None:
        self._loop.advance_frame(force if force is not None and force.any() else None)

    def reset(self) -> None:
        """Go back to frame 0."""
        self._loop.reset()

    def copy(self) -> Self:
        """Return an independent simulator in the same state, with the same network."""
        twin = self._shallow()
        twin._loop = self._loop.copy()  # noqa: SLF001 - of this very class
        return twin

    def snapshot(self) -> bytes:
        """Return state, log, history and guards, versioned and checksummed. Going on gives the same bits.

        Raises
        ------
        SnapshotError
            A guard of the caller's own has undeclared state; see `Guard`.
        """
        self._update_shown()
        return to_bytes(_MAGIC, _VERSION, self._loop.state.to_dict())

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene, network and guards.

        Raises
        ------
        SnapshotError
            The bytes are damaged or belong to another scene or other guards; the present state is then
            untouched.
        """
        with as_snapshot_error("snapshot"):
            self._loop.state = self._loop.state.from_dict(from_bytes(_MAGIC, _VERSION, data))

    def _arguments(self) -> dict[str, Any]:
        settings = {"model": self._model, "guards": self._guards, "show_all": self._show_all}
        return {**settings, **self._settings, "threads": self._threads}

    def _notes(self) -> dict[str, Any]:
        return self._mpm._notes()  # noqa: SLF001 - of this class's family

    def _take_notes(self, notes: dict[str, Any]) -> None:
        self._mpm._take_notes(notes)  # noqa: SLF001 - of this class's family

    def _settings_to_save(self) -> dict[str, Any]:
        return {
            "model": model_to_dict(self._model),
            "guards": saved_settings(self._guards),
            "show_all": self._show_all,
            **self._settings,
        }

    @classmethod
    def load(
        cls,
        path: str | Path,
        *,
        model: Model | None = None,
        guards: Sequence[str | Guard] | None = None,
        threads: int = 1,
    ) -> Self:
        """Build the simulator of a file that `save` wrote, in the state it was in.

        Parameters
        ----------
        path : str or Path
        model : str, Path or Stepper, optional
            The network, where the file names none that is installed. The file contains no network.
        guards : sequence of str or Guard, optional
            The guards, where some are the caller's own: the file contains their state, not their code.
        threads : int in [1, 1024]
            May differ from before; the result does not depend on it.

        Raises
        ------
        SnapshotError
            The file is foreign, damaged, cut off, of another version, or its network or a guard is missing or
            another; the message names the file.
        OSError
            The file cannot be read.
        """
        threads = whole("threads", threads, 1, 1024)

        def make(saved: SavedState) -> Any:
            settings = dict(saved.settings)
            stepper = model_from_dict(settings.pop("model"), model, saved.scene, threads=threads)
            named = settings.pop("guards")
            watching = from_saved_settings(named) if guards is None else guards
            return cls(saved.scene, stepper, guards=watching, threads=threads, **settings)

        return cls._restored(path, make)


def _check_scene(scene: Scene) -> None:
    """Raise `ConfigError` for scenes that a network on a fixed set of particles cannot simulate."""
    scene.refuse_rigid("networks are", "none has learned their motion")
    if scene.is_open:
        raise ConfigError(
            "a network needs a fixed number of particles: remove emitters and sinks, or use MpmSolver"
        )
    if any(obstacle.motion is not None for obstacle in scene.obstacles):
        raise ConfigError(
            "a network takes obstacles for particles at rest: remove `motion`, or use MpmSolver"
        )
