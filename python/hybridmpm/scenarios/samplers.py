"""Ranges from which the scenarios are drawn, the table of docs/reference/scenarios.md."""

from dataclasses import dataclass

from hybridmpm.scenarios.placement import RampShape, Span
from hybridmpm.scene import Sand, Water

DENSE_AS_WATER = Sand(density=1000.0, youngs_modulus=1e6)
"""Sand of the scenario with water. The networks were trained on it, and all its results are of it."""

_RAMPS = RampShape(length=(0.15, 0.35), thickness=(0.02, 0.03), steepest=50.0)


@dataclass(frozen=True, kw_only=True)
class VelocityRanges:
    """Ranges of the initial velocity of a block."""

    horizontal: Span
    """Velocity along x, and along z in 3D [m/s]."""
    vertical: Span
    """Velocity along y, positive upwards [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Sampler:
    """Ranges of one scenario; pairs of floats are the ends of uniform distributions."""

    text: str
    """Summary of the scenario in one sentence."""
    dim: int
    frames: int
    """Suggested number of frames, that of the paper's data."""
    max_particles: int
    materials: tuple[Water | Sand, ...]
    """Materials of the blocks. Each appears at least once; further blocks draw one of them."""
    velocity: VelocityRanges
    salt: int
    """Number that the random generator gets besides the seed, so that scenarios of one seed differ."""
    blocks: tuple[int, int] = (1, 3)
    """Smallest and largest number of blocks."""
    fill: Span = (0.45, 0.95)
    """Number of particles of all blocks together, as a fraction of `max_particles`."""
    top: float = 1.0
    """Largest height of a block's top above the floor, as a fraction of the ceiling's height."""
    aspect: Span = (0.6, 1.6)
    """A block's sides relative to a cube of the same measure, before they are scaled to this measure."""
    ramps: tuple[int, int] = (0, 0)
    """Smallest and largest number of ramps. Ramps that find no place are left out, but never all."""
    ramp_shape: RampShape = _RAMPS


# Chosen so that the per-frame velocities of water_2d and sand_2d spread as in DeepMind's WaterDrop and Sand.
_WATER = VelocityRanges(horizontal=(-0.8, 0.8), vertical=(-0.8, 0.4))
_SAND = VelocityRanges(horizontal=(-3.0, 3.0), vertical=(-3.0, 1.0))

SAMPLERS: dict[str, Sampler] = {
    "water_2d": Sampler(
        text="One to three blocks of water fall, slosh and settle.",
        dim=2,
        frames=1000,
        max_particles=4000,
        materials=(Water(),),
        velocity=_WATER,
        top=0.7,
        salt=1,
    ),
    "water_ramps_2d": Sampler(
        text="Water runs over one to four random ramps.",
        dim=2,
        frames=600,
        max_particles=3300,
        materials=(Water(),),
        velocity=_WATER,
        ramps=(1, 4),
        salt=2,
    ),
    "sand_2d": Sampler(
        text="One to three blocks of sand fall into heaps.",
        dim=2,
        frames=320,
        max_particles=4000,
        materials=(Sand(),),
        velocity=_SAND,
        salt=3,
    ),
    "sand_ramps_2d": Sampler(
        text="Sand slides down one to four random ramps.",
        dim=2,
        frames=400,
        max_particles=3300,
        materials=(Sand(),),
        velocity=_SAND,
        ramps=(1, 4),
        salt=4,
    ),
    "water_3d": Sampler(
        text="One to three blocks of water fall and spread in 3D.",
        dim=3,
        frames=800,
        max_particles=4000,
        materials=(Water(),),
        velocity=_WATER,
        fill=(0.45, 0.9),
        top=0.7,
        salt=5,
    ),
    "sand_3d": Sampler(
        text="One to three blocks of sand fall into heaps in 3D.",
        dim=3,
        frames=350,
        max_particles=4000,
        materials=(Sand(),),
        velocity=_SAND,
        fill=(0.45, 0.9),
        salt=6,
    ),
    "water_sand_2d": Sampler(
        text="Blocks of water and of sand fall on each other.",
        dim=2,
        frames=500,
        max_particles=4000,
        materials=(Water(), DENSE_AS_WATER),
        velocity=_WATER,
        blocks=(2, 3),
        salt=7,
    ),
}


def markdown_table() -> str:
    """Return `SAMPLERS` as a Markdown table, one row for each scenario."""
    head = (
        "scenario",
        "D",
        "frames",
        "max particles",
        "materials",
        "blocks",
        "particles / max",
        "below",
        "aspect",
        "v_x, v_z [m/s]",
        "v_y [m/s]",
        "ramps",
        "ramp length [m]",
        "ramp thickness [m]",
        "ramp angle [deg]",
    )
    rows = [head, ("---",) * len(head), *(_row(name, sampler) for name, sampler in SAMPLERS.items())]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _row(name: str, sampler: Sampler) -> tuple[str, ...]:
    shape = sampler.ramp_shape
    ramps = ("0", "-", "-", "-")
    if sampler.ramps != (0, 0):
        angle = _span((-shape.steepest, shape.steepest))
        ramps = (_span(sampler.ramps), _span(shape.length), _span(shape.thickness), angle)
    return (
        f"`{name}`",
        str(sampler.dim),
        str(sampler.frames),
        str(sampler.max_particles),
        ", ".join(_named(material) for material in sampler.materials),
        _span(sampler.blocks),
        _span(sampler.fill),
        f"{sampler.top:g} of the height",
        _span(sampler.aspect),
        _span(sampler.velocity.horizontal),
        _span(sampler.velocity.vertical),
        *ramps,
    )


def _named(material: Water | Sand) -> str:
    usual = type(material)().density
    return material.kind + ("" if material.density == usual else f" of {material.density:g} kg/m^3")


def _span(pair: Span | tuple[int, int]) -> str:
    return f"{pair[0]:g} .. {pair[1]:g}"
