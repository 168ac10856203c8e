"""Cost model: the time of a frame of a candidate in a scene, from a machine's time for each kind of work."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hybridmpm.coarse import CoarseLevel, coarse_level, coarse_warnings, fastest_impact
from hybridmpm.mpm.cost import cfl_substeps, frame_cost
from hybridmpm.planner.calibration import Calibration, MaterialTimes
from hybridmpm.planner.candidates import Candidate, softened, solvers
from hybridmpm.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Work:
    """Work of a candidate in a frame of a scene."""

    particles: int
    """Particles that are simulated."""
    shown: int
    """Particles that are shown."""
    resolution: int
    """Cells per metre of the grid of the particles simulated."""
    cells: float
    """Cells that the material fills at rest."""
    obstacles: int
    """Number of obstacles."""
    substeps: int
    """Substeps in mid-splash."""
    moduli: tuple[float, ...]
    """Factor on the elastic moduli of each of the scene's materials."""


def work(candidate: Candidate, scene: Scene, speed: float) -> Work:
    """Return the work of a candidate in a frame.

    Parameters
    ----------
    candidate : Candidate
    scene : Scene
    speed : float
        Largest speed of particles in mid-splash over that of matter that falls onto the floor [-].

    Raises
    ------
    ConfigError
        Its grid would be too coarse for the scene.
    """
    scene = softened(scene, candidate.softer)
    level = level_of(candidate, scene)
    count = particle_count(scene)
    few = max(round(level.r_p * count), len(scene.bodies), 1)
    materials = [
        material.softened(factor, scene.potential_drop) if factor < 1 else material
        for material, factor in zip(scene.materials, level.moduli, strict=True)
    ]
    fastest = speed * fastest_impact(scene)
    return Work(
        particles=few,
        shown=count if candidate.show_all else few,
        resolution=level.resolution,
        cells=filled_cells(scene, count, level.resolution),
        obstacles=len(scene.obstacles),
        substeps=cfl_substeps(scene, materials, level.resolution, speed=fastest, cfl=level.cfl),
        moduli=tuple(candidate.softer * factor for factor in level.moduli),
    )


def filled_cells(scene: Scene, count: int, resolution: int) -> float:
    """Return the number of cells that `count` particles fill on a grid of `resolution` cells per metre."""
    return count * float(scene.spacing * resolution) ** scene.dim


def particle_count(scene: Scene) -> int:
    """Return the approximate number of particles, with those of emitters over the scene's frames."""
    count = frame_cost(scene).particles
    for emitter in scene.emitters:
        end = scene.frames * scene.frame_dt
        seconds = max(0.0, min(end, end if emitter.stop is None else emitter.stop) - emitter.start)
        layers = emitter.speed * seconds / scene.spacing
        count += math.ceil(layers * len(emitter.sites(scene.spacing)))
    return min(count, scene.max_particles)


def level_of(candidate: Candidate, scene: Scene) -> CoarseLevel:
    """Return the settings of MPM: those of the candidate, or of the MPM that a network falls back to."""
    name = candidate.settings.get("coarse")
    return CoarseLevel.unfitted(scene, candidate.r_p) if name is None else coarse_level(scene, name)


def warnings_of(candidate: Candidate, scene: Scene) -> list[str]:
    """Return the texts of the warnings of coarse levels that building a candidate raises."""
    return coarse_warnings(scene, level_of(candidate, scene)) if "coarse" in candidate.settings else []


def milliseconds(candidate: Candidate, scene: Scene, calibration: Calibration) -> float | None:
    """Return the median time of a frame in mid-splash [ms]; None where its network was not calibrated.

    Materials without a calibration cost as much as sand. Several materials count by their share of the
    volume.

    Raises
    ------
    ConfigError
        As `work`.
    """
    total = 0.0
    for share, times in _by_material(scene, calibration.times.materials):
        one = _of_material(candidate, scene, times, calibration)
        if one is None:
            return None
        total += share * one
    return total / 1e3


def _by_material(scene: Scene, known: Sequence[MaterialTimes]) -> list[tuple[float, MaterialTimes]]:
    """Return the share of each material in the scene's volume, with its times."""
    by_kind: dict[str, MaterialTimes] = {one.material: one for one in known if one.dim == scene.dim}
    volumes: dict[str, float] = {}
    for body in scene.bodies:
        volumes[body.material.kind] = volumes.get(body.material.kind, 0.0) + body.measure
    if not volumes:
        volumes = {material.kind: 1.0 for material in scene.materials}
    whole = sum(volumes.values())
    return [(volume / whole, by_kind.get(kind, by_kind["sand"])) for kind, volume in volumes.items()]


def _of_material(
    candidate: Candidate, scene: Scene, times: MaterialTimes, calibration: Calibration
) -> float | None:
    """Return the time of a frame [us], as if the whole scene were of one material."""
    for ratio in calibration.times.ratios:
        if (ratio.name, ratio.material, ratio.dim) == (candidate.name, times.material, times.dim):
            base = solvers().get(ratio.base)
            spent = None if base is None else _of_material(base, scene, times, calibration)
            return None if spent is None else ratio.ratio * spent
    todo = work(candidate, scene, times.speed)
    n = todo.particles
    spent = 0.0
    if candidate.show_all:
        each = times.upsample_shown + times.upsample_obstacle * todo.obstacles
        spent = times.upsample + times.upsample_coarse * n + each * todo.shown
    if candidate.method == "hybrid":
        return None  # its time is a ratio, found above
    if candidate.method == "neural":
        known = (one for one in calibration.times.networks if one.model == candidate.model)
        network = next(known, None)
        return None if network is None else spent + network.frame + network.particle * n
    s = todo.substeps
    each = times.particle_substep + times.obstacle_particle_substep * todo.obstacles
    all_of_them = times.substep + times.obstacle_substep * todo.obstacles + times.cell_substep * todo.cells
    return spent + s * (all_of_them + each * n) + times.frame + times.particle * n
