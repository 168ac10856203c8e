"""The scenes of a crossing: scenarios at several resolutions and stiffnesses."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hybridmpm import scenarios
from hybridmpm.scene import Scene, Water
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED
from hybridmpm_lab.harness.rows import Row

SCENARIOS = ("water_2d", "sand_2d", "water_3d", "sand_3d")
"""Scenarios of the scenes: each material in each dimension, without obstacles."""
RESOLUTIONS = {2: (64, 128, 256, 512), 3: (32, 64, 128)}
"""Cells per metre by dimension."""
COMPRESSIONS = (0.014, 0.005, 0.001)
"""Compression of water by its own weight, at most [-]. Sand is as much stiffer than its own as water of this
compression is than water of the first."""
MANY = 100_000
"""Number of particles above which a case has one scene only."""


@dataclass(frozen=True, kw_only=True)
class CrossingSettings:
    """What a crossing measures; the defaults are those of docs/results/crossing.json."""

    scenarios: tuple[str, ...] = SCENARIOS
    """Scenarios of the scenes."""
    resolutions: tuple[int, ...] = ()
    """Resolutions; all of `RESOLUTIONS` where there are none."""
    compressions: tuple[float, ...] = COMPRESSIONS
    """Compressions, at the scenario's own resolution."""
    scenes: int = 3
    """Number of held-out scenes of each case; one above `MANY` particles."""
    span: int = 200
    """Number of frames that errors count over."""
    timed: int = 80
    """Number of frames that are timed."""
    passes: int = 3
    """Number of times that each frame is timed; the lower quartile counts."""
    threads: int = 1
    """Threads of every simulator."""
    patterns: tuple[str, ...] = ()
    """Shell patterns of the names of methods; without any all take part."""

    def shared(self) -> Row:
        """Return what runs must share to stand in one table."""
        return {"first_seed": FIRST_SEED, "span": self.span, "timed": self.timed, "threads": self.threads}


@dataclass(frozen=True, kw_only=True)
class Case:
    """Scenes of one scenario, resolution and stiffness."""

    scenario: str
    """Scenario of the scenes."""
    resolution: int
    """Cells per metre."""
    compression: float | None = None
    """One of `COMPRESSIONS`; None for the scenario's own material."""

    @property
    def key(self) -> tuple[object, ...]:
        """Scenario, resolution and compression."""
        return (self.scenario, self.resolution, self.compression)

    @property
    def finer(self) -> float:
        """Resolution over that of the scenario [-]."""
        return self.resolution / scenarios.get(self.scenario, FIRST_SEED).resolution

    @property
    def is_trained(self) -> bool:
        """Whether networks know the spacing of the particles and the material."""
        return self.finer == 1 and self.compression is None

    def scene(self, seed: int) -> Scene:
        """Return a scene: the same bodies as in the scenario, as many particles as the cells ask for."""
        plain = scenarios.get(self.scenario, seed)
        most = max(plain.max_particles, round(plain.max_particles * self.finer**plain.dim))
        fine = plain.model_copy(update={"resolution": self.resolution, "max_particles": most})
        return fine if self.compression is None else _stiffer(fine, self.compression)

    def stiffer(self, scene: Scene) -> float:
        """Return the modulus of a scene's material over that of the scenario's [-]."""
        if self.compression is None:
            return 1.0
        material = scene.bodies[0].material
        if isinstance(material, Water):
            return material.stiffness(scene.potential_drop) / Water().stiffness(scene.potential_drop)
        return COMPRESSIONS[0] / self.compression

    def scenes(self, settings: CrossingSettings) -> Iterator[tuple[int, Scene]]:
        """Yield seeds and scenes: as many as the settings say, or one of more than `MANY` particles."""
        for seed in range(FIRST_SEED, FIRST_SEED + settings.scenes):
            scene = self.scene(seed)
            yield seed, scene
            if len(scene.sample().x) > MANY:
                return


def cases(settings: CrossingSettings) -> list[Case]:
    """Return the cases: each resolution with the scenario's material, each stiffness at its resolution."""
    found: dict[tuple[object, ...], Case] = {}
    for scenario in settings.scenarios:
        plain = scenarios.get(scenario, FIRST_SEED)
        for resolution in _of_interest(RESOLUTIONS[plain.dim], settings.resolutions):
            case = Case(scenario=scenario, resolution=resolution)
            found[case.key] = case
        for compression in settings.compressions:
            case = Case(scenario=scenario, resolution=plain.resolution, compression=compression)
            if not settings.resolutions or plain.resolution in settings.resolutions:
                found[case.key] = case
    return list(found.values())


def _of_interest(all_there: Sequence[int], wanted: Sequence[int]) -> list[int]:
    return [one for one in all_there if not wanted or one in wanted]


def _stiffer(scene: Scene, compression: float) -> Scene:
    bodies = []
    for body in scene.bodies:
        material = body.material
        if isinstance(material, Water):
            changed = {"bulk_modulus": None, "max_compression": compression}
            material = material.model_copy(update=changed)
        else:
            material = material.softened(COMPRESSIONS[0] / compression, scene.potential_drop)
        bodies.append(body.model_copy(update={"material": material}))
    return scene.model_copy(update={"bodies": tuple(bodies)})
