"""Speed of the solver on scenes of blocks, beside plain solvers of others, and of batches of scenes.

All simulations of a scene are timed by turns in short pieces: ours in this process, each other in its own.
"""

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm import _core, scenarios
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmBatch, MpmSolver
from hybridmpm.scene import Box, Scene
from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.command import Measurement, measured, setting
from hybridmpm_lab.harness.provenance import gpu_model
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import QUIET, Calibration, TimedCall, seconds_by_turns
from hybridmpm_lab.speed.baselines import DEVICES, SOLVERS, Baseline, baseline_process, require_installed

CASES = ((2, "water"), (2, "sand"), (3, "water"), (3, "sand"))
"""Dimension and material of falling blocks."""
MAX_PARTICLES = 1_000_000
"""Largest number of particles of a block."""
INSTRUCTIONS = ("portable", "avx2", "avx512")
"""Sets of vector instructions, the narrowest first."""
_PIECE = 200_000  # particle-frames of one timing; one of few frames would measure how memory is fetched
_LOW, _HIGH = 0.1, 0.9  # places of the walls [m]

_RUN_UP = 120  # frames before the measurement: most bodies have hit the floor by then and are spreading


@dataclass(frozen=True, kw_only=True)
class SolverSettings:
    """Blocks of water and sand in 2D and 3D that fall aslant, and the settings of the measurement."""

    particles: tuple[int, ...] = setting(
        (4000, 100_000), "Number of particles of a block.", low=64, high=MAX_PARTICLES
    )
    frame: tuple[int, ...] = setting(
        (120,), "Frames before: at 0 the block flies, at 120 it splashes.", low=0, high=10_000
    )
    threads: tuple[int, ...] = setting((1, 2), "Number of threads of our solver.", low=1, high=1024)
    instructions: tuple[str, ...] = setting(
        ("avx512",),
        "Widest vector instructions of our solver, as far as the processor has them.",
        INSTRUCTIONS,
    )
    baseline: tuple[str, ...] = setting(
        (), "Package of a plain solver to be timed by turns; the fastest of all their ways counts.", SOLVERS
    )
    device: str = setting("cpu", "Device of the plain solvers; ours is on the CPU.", DEVICES)
    repeats: int = setting(25, "Number of timings of each.", low=1, high=1000)

    @property
    def blocks(self) -> list[tuple[int, int, tuple[int, str]]]:
        """Numbers of particles and of frames before, with dimension and material."""
        return list(product(self.particles, self.frame, CASES))

    @property
    def steps(self) -> int:
        """Number of rows."""
        return len(self.blocks) * len(self.instructions) * len(self.threads)


def falling_block(dim: int, material: str, particles: int, resolution: int | None = None) -> Scene:
    """Return a scene with one block of at most `particles` particles that falls aslant.

    Without a resolution the block fills at most half of the box: 20 000 particles at 128^2 fill it, more get
    a finer grid.
    """
    cells = math.pow(particles / 0.5, 1 / dim) / 2  # along an axis of the box, at 2**D particles each
    fine_enough: int = 32 * math.ceil(cells / (_HIGH - _LOW) / 32)
    resolution = resolution or max(fine_enough, 128 if dim == 2 else 64)
    spacing = 0.5 / resolution
    sides = [spacing * count for count in _counts(particles, dim)]
    # On the lattice of the sampler, so that the count is exact.
    lower = [spacing * round((0.5 - side / 2) / spacing) for side in sides]
    upper = tuple(a + side for a, side in zip(lower, sides, strict=True))
    body = Box(material=material, lower=tuple(lower), upper=upper, velocity=(1.0, -2.0, 0.5)[:dim])
    return Scene(dim=dim, resolution=resolution, bodies=(body,), max_particles=2 * MAX_PARTICLES)


def _counts(particles: int, dim: int) -> list[int]:
    """Return numbers of sites along each axis, about equal, whose product is `particles` or somewhat less."""
    if dim == 1:
        return [particles]
    even = max(1, math.floor(particles ** (1.0 / dim) + 1e-9))
    count = next((count for count in range(even, even // 2, -1) if particles % count == 0), even)
    return [count, *_counts(particles // count, dim - 1)]


def measure(settings: SolverSettings, on_progress: Progress) -> Iterator[Row]:
    """Time each scene and yield its rows, which `on_progress` counts.

    Baselines start from our state and take as many substeps; their sand starts from the volume alone, they
    have no correction of volumes, and their walls act on whole nodes. Fields of what is not measured are
    None. `slowdown` is the larger slowdown of the machine before and after a scene.

    Raises
    ------
    ConfigError
        A baseline is not installed, or the device is cuda and there is none.
    SimulationError
        The state before the measurement is not a splash, or a baseline's state afterwards is not ours: a
        speed would mean nothing.
    """
    for package in settings.baseline:
        require_installed(package)
    if settings.device == "cuda":
        gpu_model()  # refuses before anything is measured
    calibration = Calibration(max(settings.threads))
    with contextlib.ExitStack() as stack:
        baselines = [
            stack.enter_context(baseline_process(name, settings.device)) for name in settings.baseline
        ]
        for particles, run_up, (dim, of) in settings.blocks:
            before = calibration.slowdown()
            rows = _timed(falling_block(dim, of, particles), run_up, settings, baselines)
            slowdown = round(max(before, calibration.slowdown()), 2)
            for row in rows:
                yield {"dim": dim, "material": of} | row | {"slowdown": slowdown, "loaded": slowdown >= QUIET}
                on_progress(1)


def _timed(scene: Scene, run_up: int, settings: SolverSettings, baselines: Sequence[Baseline]) -> list[Row]:
    solvers = {
        (widest, threads): MpmSolver(scene, substeps="reference", threads=threads)
        for widest, threads in product(settings.instructions, settings.threads)
    }
    first = next(iter(solvers.values()))
    first.advance(run_up)
    require_sane(first)
    start, count = first.snapshot(), first.particle_count
    state = (first.positions, first.velocities, first.affine, first.volume_ratio)
    first.advance(1)
    substeps = first.last_frame.substeps if first.last_frame else 0
    frames = min(20, max(4, math.ceil(_PIECE / count)))

    def restore(widest: str, solver: MpmSolver) -> None:
        _core.limit_instructions(widest)
        # Untimed: cores that other pieces left idle are slow for milliseconds, and their caches are cold.
        solver.advance(frames)
        solver.restore(start)
        solver.advance(1)

    def again(baseline: Baseline, way: str) -> None:
        baseline.restore(way, frames)
        baseline.restore(way, 1)

    calls = [
        TimedCall(prepare=partial(restore, widest, solver), call=partial(solver.advance, frames))
        for (widest, _), solver in solvers.items()
    ]
    others = []
    for baseline in baselines:
        name, ways = baseline.start(scene, substeps, state)
        others += [(baseline, name, way, threads) for way, threads in ways.items()]
    calls += [
        TimedCall(prepare=partial(again, baseline, way), call=partial(baseline.advance, way, frames))
        for baseline, _, way, _ in others
    ]
    times = seconds_by_turns(calls, settings.repeats)
    in_use = {widest: _core.limit_instructions(widest) for widest in settings.instructions}
    _core.limit_instructions(INSTRUCTIONS[-1])
    for baseline, name, way, _ in others:
        require_agreement(first.positions, baseline.positions(way), scene, f"{name}, {way}")

    # Disturbances only ever add time, so the lower quartile counts.
    quartiles = [np.percentile(mine, (25, 75)) / frames for mine in times]
    ns = [round(1e9 * float(low) / (count * substeps), 2) for low, _ in quartiles]

    peer: dict[str, Any] = dict.fromkeys(("peer", "peer_way", "peer_threads", "peer_ns"))
    if settings.device == "cuda":
        peer["peer_device"] = gpu_model()
    if others:
        fastest = min(range(len(others)), key=lambda k: ns[len(solvers) + k])
        peer |= zip(peer, (*others[fastest][1:], ns[len(solvers) + fastest]), strict=False)
    return [
        {
            "particles": count,
            "resolution": scene.resolution,
            "frame": run_up,
            "threads": threads,
            "instructions": in_use[widest],
            "substeps": substeps,
            "ns_per_particle_substep": mine,
            "spread": round(float(high / low) - 1, 3),
            "ms_per_frame": round(1e3 * float(low), 4),
            **peer,
            "ratio": peer["peer_ns"] and round(peer["peer_ns"] / mine, 2),
        }
        for (widest, threads), mine, (low, high) in zip(solvers, ns, quartiles, strict=False)
    ]


def require_sane(solver: MpmSolver) -> None:
    """Raise a `SimulationError` unless all particles are in the box and move like a splash."""
    x, v, dx = solver.positions, solver.velocities, solver.scene.dx
    inside = ((x > _LOW - dx) & (x < _HIGH + dx)).all()
    if not (inside and np.isfinite(v).all() and 0.05 < np.abs(v).max() < 50):
        raise SimulationError(f"the state after {solver.frame} frames is not a splash")


def require_agreement(ours: np.ndarray, theirs: np.ndarray, scene: Scene, baseline: str) -> None:
    """Raise a `SimulationError` unless half of a baseline's particles are within half a cell of ours.

    Those near walls and in the spray need not be.
    """
    apart = np.median(np.linalg.norm(theirs - ours, axis=1))
    if not apart < scene.dx / 2:
        raise SimulationError(
            f"half of the particles of {baseline} ended {apart:.2g} m or more from ours, allowed is half a "
            f"cell, {scene.dx / 2:.2g} m; its speed would mean nothing"
        )


def draw(rows: Sequence[Row], file: Path) -> None:
    """Draw the time of a particle in a substep over the particles, with the widest vector instructions.

    A panel is a material in a dimension, a line a number of threads or the fastest baseline.
    """
    widest = max((row["instructions"] for row in rows), key=INSTRUCTIONS.index)
    rows = [row for row in rows if row["instructions"] == widest]
    cases = list(dict.fromkeys((row["material"], row["dim"]) for row in rows))
    columns = 2 if len(cases) == 4 else len(cases)
    figure, axes = charts.panels(columns, len(cases) // columns)
    for axis, case in zip(axes.flat, cases, strict=True):
        here = [row for row in rows if (row["material"], row["dim"]) == case]
        threads = sorted({row["threads"] for row in here})
        lines = [(f"hybridmpm, threads: {count}", "ns_per_particle_substep", count) for count in threads]
        if any(row["peer_ns"] is not None for row in here):
            device = here[0].get("peer_device")
            lines.append((f"fastest baseline{f', {device}' if device else ''}", "peer_ns", threads[0]))
        for (label, field, count), marker in zip(lines, charts.MARKERS, strict=False):
            mine = [row for row in here if row["threads"] == count and row[field] is not None]
            points = sorted((row["particles"], row[field]) for row in mine)
            axis.plot(*zip(*points, strict=True), marker=marker, label=label)
        axis.set(
            title=f"{case[0]} {case[1]}D", xscale="log", xlabel="particles", ylabel="ns per particle substep"
        )
        if here[0].get("peer_device"):
            axis.set(yscale="log")  # a GPU takes a thirtieth of the time
            charts.plain_log_ticks(axis.yaxis)
        else:
            axis.set(ylim=(0, 1.1 * axis.dataLim.y1))
    legend = charts.entries(axes)
    figure.legend(legend.values(), legend.keys(), loc="outside upper center", ncols=3)
    charts.save(figure, file)


speed = Measurement(
    name="speed",
    settings=SolverSettings,
    measure=measured(measure),
    columns=(
        "dim", "material", "frame", "particles", "resolution", "threads", "instructions", "substeps",
        "ns_per_particle_substep", "spread", "ms_per_frame", "slowdown", "loaded", "peer", "peer_way",
        "peer_device", "peer_ns", "ratio",
    ),
    draw=draw,
    summary="""Time the solver on splashing blocks.

    The blocks are of water and sand, in 2D and 3D; the solver takes the ground truth's substeps. All that is
    timed takes turns, in pieces of up to 20 frames, whose lower quartile counts. A row is marked as loaded
    where the machine was busy before or after.
    """,
).command()  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class BatchSettings:
    """Size and length of the measurement."""

    scenario: str = setting("water_2d", "Scenario of the scenes.", scenarios.NAMES)
    scenes: tuple[int, ...] = setting(
        (16,), "Number of scenes, of the seeds 0 and following.", low=1, high=4096
    )
    threads: int = setting(2, "Number of threads that one thread is compared with.", low=2, high=1024)
    frames: int = setting(10, "Number of frames timed in one go.", low=1, high=1000)
    repeats: int = setting(9, "Number of timings, the least of which counts.", low=1, high=1000)

    @property
    def steps(self) -> int:
        """Number of rounds."""
        return self.repeats * len(self.scenes)


def measure_batches(settings: BatchSettings, on_progress: Progress) -> Iterator[Row]:
    """Time each batch and yield a row for one thread and one for several; `on_progress` counts rounds."""
    threads, frames = settings.threads, settings.frames
    for count in settings.scenes:
        scenes = [scenarios.get(settings.scenario, seed) for seed in range(count)]
        batches = {each: MpmBatch(scenes, threads=each) for each in (1, threads)}
        batches[threads].advance(_RUN_UP)
        starts = [member.snapshot() for member in batches[threads]]
        calls = [
            TimedCall(prepare=partial(_restore_all, batch, starts), call=partial(batch.advance, frames))
            for batch in batches.values()
        ]
        seconds = [min(mine) for mine in seconds_by_turns(calls, settings.repeats, on_progress)]
        for (each, batch), mine in zip(batches.items(), seconds, strict=True):
            yield {
                "scenario": settings.scenario,
                "scenes": count,
                "particles": sum(member.particle_count for member in batch),
                "threads": each,
                "ms_per_scene_frame": round(1e3 * mine / (count * frames), 4),
                "frames_per_second": round(count * frames / mine, 1),
                "speedup": round(seconds[0] / mine, 3),
            }


def _restore_all(batch: MpmBatch, starts: Sequence[bytes]) -> None:
    for member, start in zip(batch, starts, strict=True):
        member.restore(start)


batch = Measurement(
    name="batch",
    settings=BatchSettings,
    measure=measured(measure_batches),
    columns=(
        "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second", "speedup",
    ),
    summary="""Time many scenes on one thread and on several, in the middle of their splash.""",
).command()  # fmt: skip
