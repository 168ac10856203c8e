"""Speed of the solver on splashing blocks, beside other builds of it and solvers of others.

All simulations of a case are timed by turns in short pieces: ours in this process, each other one in its own.
"""

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybridmpm import _core
from hybridmpm._support import charts
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import Calibration, FrameTime, TimedSimulation, time_per_frame
from hybridmpm_lab.speed.baselines.loading import SOLVERS, check_peer
from hybridmpm_lab.speed.baselines.process import Worker
from hybridmpm_lab.speed.blocks import falling_block, require_sane
from hybridmpm_lab.speed.size_chart import draw_over_particles

CASES: tuple[tuple[int, str], ...] = ((2, "water"), (2, "sand"), (3, "water"), (3, "sand"))
"""Dimension and material of each row."""
INSTRUCTIONS = ("portable", "avx2", "avx512")
"""Sets of vector instructions, the narrowest first."""
LARGEST_SLOWDOWN = 1.15
"""Slowdown [-] of the machine from which on a row counts as measured under load."""

_PIECE = 200_000
"""Particle-frames of one timing; one of few frames would measure how memory is fetched."""
_FEWEST_FRAMES, _MOST_FRAMES = 4, 20


@dataclass(frozen=True, kw_only=True)
class MpmSettings:
    """Size and length of the measurement."""

    particles: tuple[int, ...] = (4000, 100_000)
    """Numbers of particles aimed at; a row tells how many there were."""
    run_up: tuple[int, ...] = (120,)
    """Frames before the measurement; after 120 the block has hit the floor and is spreading."""
    threads: tuple[int, ...] = (1, 2)
    """Numbers of threads of our solver; each has its row."""
    instructions: tuple[str, ...] = INSTRUCTIONS[-1:]
    """Widest vector instructions that our solver may use, of `INSTRUCTIONS`; each has its row, unless the
    processor lacks it, but for the last."""
    repeats: int = 25
    """Number of timings, whose lower quartile is reported."""
    peers: tuple[str, ...] = ()
    """Peers measured by turns with ours, of `SOLVERS`; the fastest of all their settings counts."""
    build: Path | None = None
    """Checkout of another build of this library, measured by turns with ours on as many threads."""

    @property
    def count(self) -> int:
        """Number of rows."""
        sizes = len(CASES) * len(self.particles) * len(self.run_up)
        return sizes * len(self.threads) * len(self.instructions_in_use())

    def instructions_in_use(self) -> list[str]:
        """Return the sets of `instructions` that the processor has, or the widest that it has instead."""
        in_use = [_core.limit_instructions(widest) for widest in self.instructions]
        _core.limit_instructions(INSTRUCTIONS[-1])
        return list(dict.fromkeys(in_use))

    def check(self) -> None:
        """Raise a ConfigError where a peer is not installed, or the other build has no extension."""
        for peer in self.peers:
            check_peer(peer, known=SOLVERS)
        if self.build is not None and not list((self.build / "python" / "hybridmpm").glob("_native*.so")):
            raise ConfigError(
                f"{self.build} holds no build of hybridmpm: python/hybridmpm/_native*.so is missing; "
                "make it there with `maturin develop --release --skip-install`"
            )


class _Own(NamedTuple):
    """Our solver with a number of threads and a set of instructions."""

    solver: MpmSolver
    threads: int
    instructions: str

    def restore(self, state: bytes) -> None:
        """Go back to a state, and use these instructions from now on."""
        _core.limit_instructions(self.instructions)
        self.solver.restore(state)


class _Rival(NamedTuple):
    """A simulation in another process."""

    worker: Worker
    setting: str
    label: str
    """Field of its time in a row."""


def measure(settings: MpmSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure each of `CASES` and yield its rows, which `on_progress` counts.

    Peers start from our state and take as many substeps; their sand starts from the volume alone. They do
    without our correction of volumes, and their walls act on whole nodes. Another build of ours runs up to
    its own state. Fields of what is not measured are None.

    `slowdown` is the larger slowdown of the machine before and after a case, on as many threads as the case
    used, and `loaded` says whether it reached `LARGEST_SLOWDOWN`.

    Raises
    ------
    ConfigError
        See `MpmSettings.check`.
    SimulationError
        The state before the measurement is not a splash, or a peer's state afterwards is not ours: a speed
        would mean nothing.
    """
    settings.check()
    calibration = Calibration(max(settings.threads))
    with contextlib.ExitStack() as stack:
        peers = {peer: stack.enter_context(Worker(peer)) for peer in settings.peers}
        build = None
        if settings.build is not None:
            build = stack.enter_context(Worker("hybridmpm", settings.build))
        for particles in settings.particles:
            for run_up in settings.run_up:
                for dim, material in CASES:
                    case = _Case(falling_block(dim, material, particles), run_up, settings)
                    before = calibration.slowdown()
                    rows = case.rows(peers, build)
                    slowdown = max(before, calibration.slowdown())
                    for row in rows:
                        slowdown = round(slowdown, 2)
                        load = {"slowdown": slowdown, "loaded": slowdown >= LARGEST_SLOWDOWN}
                        yield {"dim": dim, "material": material, **row, **load}
                        on_progress(1)


class _Case:
    """One scene, one frame of it, and all that is timed there."""

    def __init__(self, scene: Scene, run_up: int, settings: MpmSettings) -> None:
        self._scene, self._run_up, self._settings = scene, run_up, settings
        solvers = {
            threads: MpmSolver(scene, substeps="reference", threads=threads) for threads in settings.threads
        }
        self._own = [
            _Own(solver, threads, instructions)
            for instructions in settings.instructions_in_use()
            for threads, solver in solvers.items()
        ]
        first = self._own[0].solver
        first.advance(run_up)
        require_sane(first)
        self._start, self._count = first.snapshot(), first.particle_count
        self._state = (first.positions, first.velocities, first.affine, first.volume_ratio)
        first.advance(1)
        self._substeps = first.last_frame.substeps if first.last_frame else 0
        self._frames = min(_MOST_FRAMES, max(_FEWEST_FRAMES, math.ceil(_PIECE / self._count)))

    def rows(self, peers: dict[str, Worker], build: Worker | None) -> list[Row]:
        """Time all by turns."""
        rivals = self._peers(peers)
        builds = [] if build is None else self._builds(build)
        timed = [
            TimedSimulation(
                restore=partial(own.restore, self._start), advance=own.solver.advance, frames=self._frames
            )
            for own in self._own
        ] + [
            TimedSimulation(
                restore=partial(rival.worker.call, "restore", rival.setting),
                advance=partial(rival.worker.call, "advance", rival.setting),
                frames=self._frames,
            )
            for rival in (*rivals, *builds)
        ]
        try:
            times = time_per_frame(timed, self._settings.repeats)
        finally:
            _core.limit_instructions(INSTRUCTIONS[-1])
        self._require_agreement(rivals)
        mine, theirs = times[: len(self._own)], times[len(self._own) :]
        compared = self._compared(rivals, theirs)
        others = {int(rival.setting): time for rival, time in zip(builds, theirs[len(rivals) :], strict=True)}
        return [
            {
                "particles": self._count,
                "resolution": self._scene.resolution,
                "frame": self._run_up,
                "threads": own.threads,
                "instructions": own.instructions,
                "substeps": self._substeps,
                "ns_per_particle_substep": self._ns(time),
                "spread": round(time.spread, 3),
                "ms_per_frame": round(time.seconds * 1e3, 4),
                **self._beside_the_build(time, others.get(own.threads)),
                **compared,
                "ratio": compared["peer_ns"] and round(compared["peer_ns"] / self._ns(time), 2),
            }
            for own, time in zip(self._own, mine, strict=True)
        ]

    def _beside_the_build(self, mine: FrameTime, other: FrameTime | None) -> dict[str, float | None]:
        if other is None:
            return {"build_ns": None, "build_ratio": None}
        return {"build_ns": self._ns(other), "build_ratio": round(mine.seconds / other.seconds, 3)}

    def _ns(self, time: FrameTime) -> float:
        return round(time.seconds * 1e9 / (self._count * self._substeps), 2)

    def _peers(self, peers: dict[str, Worker]) -> list[_Rival]:
        rivals = []
        scene = self._scene.model_dump(mode="json", exclude_none=True)
        for peer, worker in peers.items():
            worker.call("start")
            worker.call("take", *self._state)
            for setting in worker.call("settings"):
                worker.call("make", setting, scene, self._substeps)
                rivals.append(_Rival(worker, setting, f"{peer}_{setting}_ns"))
        return rivals

    def _builds(self, build: Worker) -> list[_Rival]:
        rivals = []
        scene = self._scene.model_dump(mode="json", exclude_none=True)
        for threads in self._settings.threads:
            name = str(threads)
            build.call("make", name, scene, threads)
            build.call("run_up", name, self._run_up)
            rivals.append(_Rival(build, name, "build_ns"))
        return rivals

    def _compared(self, rivals: Sequence[_Rival], times: Sequence[FrameTime]) -> dict[str, Any]:
        if not rivals:
            return dict.fromkeys(("peer", "peer_ns", "peer_threads", "peer_setting"))
        ns = [self._ns(time) for time, _ in zip(times, rivals, strict=False)]
        best = rivals[ns.index(min(ns))]
        return {
            "peer": best.worker.call("name"),
            "peer_ns": min(ns),
            "peer_threads": best.worker.call("settings")[best.setting],
            "peer_setting": best.setting,
            **{rival.label: value for rival, value in zip(rivals, ns, strict=True)},
        }

    def _require_agreement(self, rivals: Sequence[_Rival]) -> None:
        ours = self._own[0].solver.positions
        for rival in rivals:
            theirs = rival.worker.call("positions", rival.setting)
            require_agreement(ours, theirs, self._scene, rival.label.removesuffix("_ns"))


def require_agreement(ours: np.ndarray, theirs: np.ndarray, scene: Scene, peer: str) -> None:
    """Raise a SimulationError unless half of a peer's particles are within half a cell of ours.

    Those near walls and in the spray need not be.
    """
    apart = np.median(np.linalg.norm(theirs - ours, axis=1))
    if not apart < scene.dx / 2:
        raise SimulationError(
            f"{scene.name}: half of the particles of {peer} ended {apart:.2g} m or more from ours, allowed "
            f"is half a cell, {scene.dx / 2:.2g} m; its speed would mean nothing"
        )


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw time per particle-substep against particles, ours by threads and the peer's, as SVG and PNG.

    Ours are those with the widest vector instructions. Raises as `charts.panels` and `charts.save`.
    """
    widest = max((row["instructions"] for row in rows), key=INSTRUCTIONS.index)
    rows = [row for row in rows if row["instructions"] == widest]
    cases = list(dict.fromkeys((row["dim"], row["material"]) for row in rows))
    figure, axes = charts.panels(columns=min(2, len(cases)), rows=math.ceil(len(cases) / 2))
    for panel, (dim, material) in zip(axes.flat, cases, strict=True):
        mine = [row for row in rows if (row["dim"], row["material"]) == (dim, material)]
        peer = mine[0]["peer"] and ("fastest peer, best of 1 and 2 threads", "peer_ns")
        draw_over_particles(panel, mine, "ns_per_particle_substep", peer)
        panel.set(title=f"{material} {dim}D", xscale="log", ylim=(0, 1.1 * panel.dataLim.y1))
        panel.set(xlabel="particles", ylabel="ns per particle and substep")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    charts.save(figure, file)
