"""Whole packages that a user could pick instead, as they are written, beside the solver on the same block.

Each runs in a process of its own, at its own steps and settings. So a time of a frame compares what a user
waits for, and no kernels. Where the copy of libGLdispatch in SPlisHSPlasH's wheel ends the process, the
system's copy in `LD_PRELOAD` helps.
"""

import json
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene, Water
from hybridmpm_lab.harness.command import Measurement, measured, setting
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.harness.timing import QUIET, Calibration
from hybridmpm_lab.speed.solver import MAX_PARTICLES, falling_block

_FRAME = 2.5e-3
_RUN_UP, _TIMED = (
    120,
    40,
)  # frames in which the block falls and splashes, and timed ones
_LOW, _HIGH = 0.1, 0.9  # places of the walls [m]
_SOUND_STEP = 2e-2  # of a cell [s/m]: Genesis warns above it


@dataclass(frozen=True, kw_only=True)
class Run:
    """A run of a block to its splash."""

    seconds: list[float]
    """Times of the last frames [s]."""
    steps: float
    """Steps of the solver in a frame."""
    positions: np.ndarray
    """Positions (N, 3) at the end, y upwards [m]."""


@dataclass(frozen=True, kw_only=True)
class Package:
    """A package of others."""

    distribution: str
    """Name that pip knows."""
    materials: tuple[str, ...]
    """Materials of ours that it has."""
    differs: str
    """What sets its row apart."""
    run: Callable[[Scene], Run]


def _advanced(step: Callable[[], object], time_step: float) -> tuple[list[float], float]:
    """Advance to the splash; returns the times of the last frames [s], and the steps in a frame."""
    per_frame = max(1, round(_FRAME / time_step))
    for _ in range(_RUN_UP * per_frame):
        step()
    seconds = []
    for _ in range(_TIMED):
        start = time.perf_counter()
        for _ in range(per_frame):
            step()
        seconds.append(time.perf_counter() - start)
    return seconds, float(per_frame)


def _block(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lower and upper corner [m] and velocity [m/s] of the only body of a scene."""
    body = scene.bodies[0]
    if not isinstance(body, Box):
        raise TypeError(f"the body is a {type(body).__name__}, only boxes are timed")
    return np.array(body.lower), np.array(body.upper), np.array(body.velocity)


_UP = [0, 2, 1]
"""Order of the axes of packages whose third one is upwards."""


def _hybridmpm(scene: Scene) -> Run:
    solver = MpmSolver(scene, threads=2)
    seconds, _ = _advanced(lambda: solver.advance(1), _FRAME)
    steps = solver.last_frame.substeps if solver.last_frame else 0
    return Run(seconds=seconds, steps=float(steps), positions=solver.positions)


def _genesis(scene: Scene) -> Run:
    genesis = import_module("genesis")
    genesis.init(backend=genesis.cpu, logging_level="error")
    dx, (lower, upper, velocity) = scene.dx, _block(scene)
    margin = 3 * dx  # its particles stay three cells inside of its bounds
    made = genesis.Scene(
        sim_options=genesis.options.SimOptions(
            dt=_FRAME, substeps=math.ceil(_FRAME / (_SOUND_STEP * dx)), gravity=(0, 0, -9.81)
        ),
        mpm_options=genesis.options.MPMOptions(
            lower_bound=(_LOW - margin,) * 3,
            upper_bound=(_HIGH + margin,) * 3,
            grid_density=scene.resolution,
            particle_size=dx / 2,
        ),
        show_viewer=False,
    )
    materials = genesis.materials.MPM
    kind = materials.Liquid if isinstance(scene.bodies[0].material, Water) else materials.Sand
    middle, size = (lower + upper) / 2, upper - lower
    block = made.add_entity(
        material=kind(sampler="regular"),
        morph=genesis.morphs.Box(pos=tuple(middle[_UP]), size=tuple(size[_UP])),
    )
    made.build()
    block.set_velocity(velocity[_UP])
    seconds, _ = _advanced(made.step, _FRAME)
    positions = np.asarray(block.get_particles_pos().cpu()).reshape(-1, 3)
    return Run(seconds=seconds, steps=made.sim.substeps, positions=positions[:, _UP])


def _newton(scene: Scene) -> Run:
    warp, newton = import_module("warp"), import_module("newton")
    warp.config.log_level = warp.LOG_WARNING
    warp.set_device("cpu")
    implicit = newton.solvers.SolverImplicitMPM
    spacing, (lower, upper, velocity) = scene.dx / 2, _block(scene)
    counts = np.rint((upper - lower) / spacing).astype(int)[_UP]
    builder = newton.ModelBuilder()
    implicit.register_custom_attributes(builder)
    builder.add_particle_grid(
        pos=warp.vec3(*(lower + spacing / 2)[_UP]),
        rot=warp.quat_identity(),
        vel=warp.vec3(*velocity[_UP]),
        **{f"dim_{axis}": int(count) for axis, count in zip("xyz", counts, strict=True)},
        **{f"cell_{axis}": spacing for axis in "xyz"},
        mass=1000.0 * spacing**3,
        jitter=0.0,
        radius_mean=spacing / 2,
    )
    smooth = newton.ModelBuilder.ShapeConfig(mu=0.0, density=0.0)
    for axis in range(3):
        for middle in (_LOW - 0.5, _HIGH + 0.5):
            half, place = [2.0] * 3, [0.5] * 3
            half[axis], place[axis] = 0.5, middle
            wall = warp.transform(warp.vec3(*place), warp.quat_identity())
            builder.add_shape_box(body=-1, cfg=smooth, xform=wall, hx=half[0], hy=half[1], hz=half[2])
    model = builder.finalize()
    model.set_gravity((0, 0, -9.81))
    settings = implicit.Config()
    settings.voxel_size = scene.dx
    if isinstance(scene.bodies[0].material, Water):  # as its example of a dam break sets them
        model.mpm.friction.fill_(0.0)
        model.mpm.tensile_yield_ratio.fill_(1.0)
        settings.max_iterations, settings.tolerance = 50, 1e-3
        settings.warmstart_mode, settings.collider_basis = "particles", "pic"
    solver = implicit(model, config=settings)
    states = [model.state(), model.state()]

    def step() -> None:
        solver.step(*states, None, None, _FRAME)
        solver.project_outside(states[1], states[1], _FRAME)
        states.reverse()

    seconds, steps = _advanced(step, _FRAME)
    return Run(seconds=seconds, steps=steps, positions=states[0].particle_q.numpy()[:, _UP])


def _splishsplash(scene: Scene) -> Run:
    splish = import_module("pysplishsplash")
    lower, upper, velocity = _block(scene)
    spacing = scene.dx / 2
    side = _HIGH - _LOW
    with tempfile.TemporaryDirectory() as folder:
        walls = Path(folder) / "walls.obj"
        walls.write_text(_UNIT_CUBE, encoding="ascii")
        words: Row = {
            "Configuration": {
                "particleRadius": spacing / 2,
                "simulationMethod": 4,  # DFSPH
                "gravitation": [0, -9.81, 0],
                "cflMethod": 1,
                "cflFactor": 1,
                "cflMaxTimeStepSize": 0.005,
                "boundaryHandlingMethod": 2,  # volume maps
            },
            "Materials": [{"id": "Fluid", "density0": 1000, "viscosityMethod": 1}],
            "RigidBodies": [
                {
                    "geometryFile": str(walls),
                    "translation": [0.5] * 3,
                    "scale": [side] * 3,
                    "rotationAxis": [1, 0, 0],
                    "rotationAngle": 0,
                    "isDynamic": False,
                    "isWall": True,
                    "mapInvert": True,
                    "mapThickness": 0.0,
                    "mapResolution": [20, 20, 20],
                }
            ],
            # Its sampler leaves one layer less than the sides over the spacing.
            "FluidBlocks": [
                {
                    "denseMode": 0,
                    "start": lower.tolist(),
                    "end": (upper + spacing).tolist(),
                    "initialVelocity": velocity.tolist(),
                }
            ],
        }
        file = Path(folder) / "scene.json"
        file.write_text(json.dumps(words), encoding="utf-8")
        base = splish.Exec.SimulatorBase()
        base.init(sceneFile=str(file), useGui=False, outputDir=folder, initialPause=False)
        base.initSimulation()
        ends: list[tuple[float, float]] = []  # of the steps: times by the clock, and simulated [s]
        base.setTimeStepCB(
            lambda: ends.append((time.perf_counter(), splish.TimeManager.getCurrent().getTime()))
        )
        base.setValueFloat(base.STOP_AT, (_RUN_UP + _TIMED) * _FRAME)
        base.runSimulation()
        fluid = splish.Simulation.getCurrent().getFluidModel(0)
        positions = np.array([fluid.getPosition(index) for index in range(fluid.numActiveParticles())])
    clock, simulated = np.array(ends).T
    frames = np.arange(_RUN_UP, _RUN_UP + _TIMED + 1) * _FRAME
    seconds = np.diff(np.interp(frames, simulated, clock))
    steps = float(np.count_nonzero(simulated > frames[0]) / _TIMED)
    return Run(seconds=seconds.tolist(), steps=steps, positions=positions)


_CORNERS = "".join(f"v {x} {y} {z}\n" for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5))
_SIDES = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
_UNIT_CUBE = _CORNERS + "".join(
    f"f {a} {b} {c}\nf {a} {c} {d}\n" for a, b, c, d in (side.split() for side in _SIDES)
)
"""A cube of one metre around the origin, as an OBJ file with normals outwards."""

PACKAGES = {
    "genesis": Package(
        distribution="genesis-world",
        materials=("water", "sand"),
        differs="explicit MLS-MPM; its own bulk modulus; the longest steps without a warning",
        run=_genesis,
    ),
    "newton": Package(
        distribution="newton",
        materials=("water", "sand"),
        differs="implicit MPM of an incompressible material, one step a frame, on one thread",
        run=_newton,
    ),
    "splishsplash": Package(
        distribution="pysplishsplash",
        materials=("water",),
        differs="divergence-free SPH of an incompressible liquid, steps by its own bound",
        run=_splishsplash,
    ),
}


@dataclass(frozen=True, kw_only=True)
class PackageSettings:
    """Packages and sizes of the block in 3D."""

    package: tuple[str, ...] = setting(tuple(PACKAGES), "Package to be timed.", list(PACKAGES))
    particles: tuple[int, ...] = setting((4000,), "Number of particles.", low=64, high=MAX_PARTICLES)

    @property
    def cases(self) -> list[tuple[str, str, int]]:
        """Packages with materials and numbers of particles."""
        return [
            (name, material, particles)
            for particles in self.particles
            for name in self.package
            for material in PACKAGES[name].materials
        ]

    @property
    def steps(self) -> int:
        """Number of rows."""
        return len(self.cases)


def measure(settings: PackageSettings, on_progress: Progress) -> Iterator[Row]:
    """Time each package between two runs of ours, and yield its row; `on_progress` counts rows.

    Frames are of 2.5 ms in mid-splash; the lower quartile counts. `inside` is the share of the particles that
    are between the walls at the end, `apart` the distance of the centres of mass from ours [m].

    Raises
    ------
    ConfigError
        A package is not installed.
    SimulationError
        A package ended its process.
    """
    versions = {name: _version(name) for name in settings.package}
    calibration = Calibration(2)
    for name, material, particles in settings.cases:
        scene = falling_block(3, material, particles)
        before = calibration.slowdown()
        ours_and_theirs = (_hybridmpm, PACKAGES[name].run, _hybridmpm)
        first, theirs, second = (_run_apart(run, scene) for run in ours_and_theirs)
        slowdown = round(max(before, calibration.slowdown()), 2)
        ours, other = (
            1e3 * float(np.percentile(seconds, 25))
            for seconds in (first.seconds + second.seconds, theirs.seconds)
        )
        x, margin = theirs.positions, scene.dx
        yield {
            "package": f"{PACKAGES[name].distribution} {versions[name]}",
            "material": material,
            "particles": len(x),
            "resolution": scene.resolution,
            "ms_per_frame": significant(other),
            "steps": round(theirs.steps, 2),
            "ours_particles": len(first.positions),
            "ours_ms_per_frame": significant(ours),
            "ours_steps": first.steps,
            "ratio": significant(other / ours),
            "inside": significant(float(((x > _LOW - margin) & (x < _HIGH + margin)).all(axis=1).mean())),
            "apart": significant(float(np.linalg.norm(x.mean(0) - first.positions.mean(0)))),
            "differs": PACKAGES[name].differs,
            "slowdown": slowdown,
            "loaded": slowdown >= QUIET,
        }
        on_progress(1)


def _version(name: str) -> str:
    try:
        return version(PACKAGES[name].distribution)
    except PackageNotFoundError:
        text = "is not installed: pip install --editable 'lab[packages]'"
        raise ConfigError(f"the package {PACKAGES[name].distribution} {text}") from None


def _run_apart(run: Callable[[Scene], Run], scene: Scene) -> Run:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        try:
            return pool.submit(run, scene).result()
        except BrokenProcessPool:
            raise SimulationError(
                "a package ended its process; for pysplishsplash set LD_PRELOAD=libGLdispatch.so.0"
            ) from None


packages = Measurement(
    name="packages",
    settings=PackageSettings,
    measure=measured(measure),
    columns=(
        "package", "material", "particles", "ms_per_frame", "steps", "ours_ms_per_frame", "ours_steps",
        "ratio", "inside", "apart", "slowdown", "loaded", "differs",
    ),
    summary="""Time whole packages of others beside the solver, each as it is written.

    A block of water or sand falls in 3D; frames of 2.5 ms in mid-splash are timed. Each package takes its own
    steps, and the threads that it takes by itself; ours takes its default substeps on two threads.
    """,
).command()  # fmt: skip
