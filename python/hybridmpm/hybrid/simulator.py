"""`HybridSimulator`: a network, guards that watch it, and MPM to fall back to."""

import copy
import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import flag, real, whole
from hybridmpm._support.packing import pack, unfitting, unpack
from hybridmpm.coarse import CoarseSimulator, Upsampler
from hybridmpm.coarse.merging import checked_ratio
from hybridmpm.decisions import Answered, Decision, Mode, without_undone
from hybridmpm.errors import ConfigError
from hybridmpm.force import Force, checked_force
from hybridmpm.hybrid import saved_guards
from hybridmpm.hybrid.engine import Engine
from hybridmpm.hybrid.guard import Guard
from hybridmpm.hybrid.guards import DEFAULT, Cosine, Safeguard, build
from hybridmpm.hybrid.handoff import KINDS, Handoff
from hybridmpm.hybrid.switch import SwitchSettings
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import Model, as_stepper, described, name_of, recalled
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import warmup_frames
from hybridmpm.scenarios.checked import checked_scene
from hybridmpm.scene import Scene
from hybridmpm.simulator import MAX_FRAMES_AT_ONCE, Kind
from hybridmpm.snapshots import SavedState

MAX_WINDOW = 100
"""Longest window: the history kept holds two of this many accelerations."""
_MAGIC, _VERSION = b"HMPMHYBR", 3

_Floats = npt.NDArray[np.float32]


class HybridSimulator(CoarseSimulator):
    """A network simulates while its guards see no trouble, and MPM otherwise, on the same particles.

    MPM simulates the first 5 `r_t` frames, from which the network gets its history, every frame with an
    external force, and some steps after each alarm. An alarm refuses the network's step, and with some guards
    the steps before it (`Guard.undo`): MPM then redoes their frames within the same call. A network that
    fails again soon is given its next chance after twice as many steps. Where all particles fall freely, or
    all are at rest, neither network nor MPM is asked.

    Parameters
    ----------
    scene : Scene
        Scene without emitters, sinks and moving obstacles.
    model : str, Path or Stepper
        The network: name of a model of the library, an .onnx file, or anything that steps like a
        `NeuralModel`. "zero" is free fall.
    r_c : float in [-1, 1], optional
        Mean cosine between the accelerations of two windows of time below which the cosine guard alarms.
        Where it is given, that guard is added to `guards`; in `guards` without `r_c` it alarms below 0.8.
    window : int in [1, 100]
        Steps of the network in each of the two windows.
    wait : int in [1, 100]
        Steps that MPM simulates after an alarm before the network takes over again, doubled and doubled again
        where it keeps failing.
    patience : float in [1e-3, 1e6]
        Longest time that the network may take for an answer [s]. One that takes longer counts as failed, and
        is never asked again.
    shortcuts : bool
        Answer steps in which all particles fall freely, or all are at rest, without the network; and keep
        particles at rest where they are in those that the network answers.
    hysteresis : float in [0, 1]
        The motion is calm from r_c + hysteresis (1 - r_c) on.
    guards : sequence of str or Guard
        Names as in `hybrid.GUARDS`, or guards with other settings. Without any nothing is ever done about the
        network, and a state that cannot be raises an error.
    safeguard : "ours" or "paper"
        Which mean of the cosines; see `hybrid.Cosine`.
    handoff : "warm", "shadow" or "cold"
        What MPM takes over from the network besides positions and velocities; see docs/results/hybrid.md.
    show_all : bool
        Where the network moves fewer particles than the scene has, carry all of them along
        (`downsampling.Upsampler`): `positions`, `velocities`, `ids`, `mass` and `materials` are then those of
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
    the network positions and velocities are interpolated. What is undone is undone for the particles that are
    carried, too. The same scene, network and calls give the same bits.

    A frame fails with `NonFiniteError`, `DomainError`, `InvertedError` or `StepSizeError` where MPM failed,
    or the network where no guard watches it. A rollout shows frames that were undone later as they were when
    their turn came.
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
        patience: float = 60.0,
        shortcuts: bool = True,
        hysteresis: float = 0.25,
        guards: Sequence[str | Guard] = DEFAULT,
        safeguard: Safeguard = "ours",
        handoff: Handoff = "warm",
        show_all: bool = True,
        threads: int = 1,
    ) -> None:
        _check_scene(checked_scene(scene))
        self._model = as_stepper(model, scene, threads=threads)
        self._model.check(scene)
        if handoff not in KINDS:
            raise ConfigError(f"handoff must be among {', '.join(KINDS)}; got {handoff!r}")
        self._cosine = Cosine(Cosine.r_c if r_c is None else r_c, hysteresis, safeguard)
        self._guards = build(guards, self._cosine, is_asked_for=r_c is not None)
        for guard in self._guards:
            if isinstance(guard, Cosine):
                self._cosine = guard
        self._settings = SwitchSettings(
            window=whole("window", window, 1, MAX_WINDOW),
            wait=whole("wait", wait, 1, MAX_WINDOW),
            patience=real("patience", patience, 1e-3, 1e6),
            shortcuts=flag("shortcuts", shortcuts),
            safeguard=safeguard,
            handoff=handoff,
        )
        self._show_all = flag("show_all", show_all)
        mpm = MpmSolver(scene, r_p=checked_ratio(self._model.r_p), threads=threads)
        self._engine = Engine(
            mpm, self._model, self._guards, self._settings, show_all=self._show_all and mpm.r_p < 1
        )

    def _traits(self) -> list[str]:
        who = {"mpm": "MPM", "neural": "the network"}[self.mode]
        return [f"model {name_of(self._model)}", f"{who} simulates"]

    @property
    def model(self) -> Stepper:
        """The network."""
        return self._model

    @property
    def _few(self) -> Engine:
        return self._engine

    @property
    def _upsampler(self) -> Upsampler | None:
        return self._engine.state.upsampler

    @property
    def _mpm(self) -> MpmSolver:
        return self._engine.state.mpm

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
        return self._engine.state.moment.track.r_t

    @property
    def resolution(self) -> int:
        """Number of MPM's grid cells per metre."""
        return self._mpm.resolution

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._engine.state.moment.frame

    @property
    def mode(self) -> Mode:
        """Who simulates the next frame, if no force acts on it: "mpm" or "neural".

        With "neural" free fall or rest may stand in for the network; see `answered`.
        """
        return self._engine.state.mode

    @property
    def safeguard(self) -> float | None:
        """Mean cosine between the accelerations of the last two windows; None until both are full."""
        return self._engine.state.moment.value

    @property
    def r_c(self) -> float | None:
        """Value of `safeguard` below which the cosine guard alarms; None where it is not among the guards."""
        return self._cosine.r_c if self._cosine in self._guards else None

    @property
    def log(self) -> tuple[Decision, ...]:
        """All decisions so far about who simulates, in the order in which they were made."""
        return tuple(self._engine.state.log)

    @property
    def answered(self) -> Answered:
        """Numbers of the frames that MPM did not simulate: by the network, by free fall, and by rest."""
        return self._engine.state.moment.answered

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """How MPM cut its latest frame; None before the first and where the network made it."""
        return None if self._engine.is_between else self._mpm.last_frame

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant."""
        mpm = self._mpm
        if self._engine.is_between:
            mpm = mpm.copy()
            mpm.prescribe(self._engine.positions, self._engine.velocities, self.frame)
        return mpm.diagnostics()

    def _advance_few(self, force: _Floats | None) -> None:
        self._engine.advance_frame(force if force is not None and force.any() else None)

    def replay(self, log: Iterable[Decision], frames: int, force: Force = None) -> None:
        """Start again and advance as a log says, whatever the guards would; the result has the same bits.

        What the log says of the last frame is done too: where MPM takes over there, it has.

        Parameters
        ----------
        log : iterable of Decision
            Log of a simulator of the same scene and network, with the same handoff.
        frames : int in [0, 1000000]
            Number of frames to simulate.
        force : optional
            Force of the logged run; see `advance`.

        Raises
        ------
        ConfigError
            The log lets the network begin where it cannot; otherwise as `advance`.
        """
        script = without_undone(log)
        first = warmup_frames(self.r_t)
        for decision in script:
            if decision.mode == "neural" and (decision.frame % self.r_t or decision.frame < first):
                raise ConfigError(
                    f"the log lets the network begin at frame {decision.frame}, which must be a multiple of "
                    f"its r_t = {self.r_t} and at least {first}"
                )
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        checked_force(force, self, frames)
        self.reset()
        self._engine.script = script
        try:
            self.advance(frames, force)
            self._engine.left_by_script()
        finally:
            self._engine.script = None

    def cancel_by(self, flag: _core.CancelFlag) -> None:
        """Let another thread end the frame that is being computed; see `Simulator.cancel_by`."""
        super().cancel_by(flag)
        self._mpm.cancel_by(flag)

    def reset(self) -> None:
        """Go back to frame 0."""
        self._engine.reset()

    def copy(self) -> Self:
        """Return an independent simulator in the same state, with the same network."""
        twin = copy.copy(self)
        twin._engine = self._engine.copy()  # noqa: SLF001 - of this very class
        return twin

    def snapshot(self) -> bytes:
        """Return state, log, history and guards, versioned and checksummed. Going on gives the same bits.

        Raises
        ------
        SnapshotError
            A guard of one's own keeps something that it does not declare; see `Guard`.
        """
        return pack(_MAGIC, _VERSION, self._engine.state.remember())

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene, network and guards.

        Raises
        ------
        SnapshotError
            The bytes are damaged or belong to another scene or other guards; the present state is then
            untouched.
        """
        with unfitting("snapshot"):
            self._engine.state = self._engine.state.recalled(unpack(_MAGIC, _VERSION, data))

    def _settings_to_save(self) -> dict[str, Any]:
        return {
            "model": described(self._model),
            "guards": saved_guards.described(self._guards),
            "r_c": self.r_c,
            "hysteresis": self._cosine.hysteresis,
            "show_all": self._show_all,
            **dataclasses.asdict(self._settings),
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
            The network, where the file does not name one that is here. The file holds no network.
        guards : sequence of str or Guard, optional
            The guards, where some of them are one's own: the file holds what they remember, not their code.
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
            stepper = recalled(settings.pop("model"), model, saved.scene, threads=threads)
            named = settings.pop("guards")
            watching = saved_guards.recalled(named) if guards is None else guards
            return cls(saved.scene, stepper, guards=watching, threads=threads, **settings)

        return cls._restored(path, make)


def _check_scene(scene: Scene) -> None:
    """Refuse what a network on a fixed set of particles cannot simulate."""
    if scene.is_open:
        raise ConfigError(
            "a network needs a fixed number of particles: remove emitters and sinks, or use MpmSolver"
        )
    if any(obstacle.motion is not None for obstacle in scene.obstacles):
        raise ConfigError(
            "a network takes obstacles for particles at rest: remove `motion`, or use MpmSolver"
        )
