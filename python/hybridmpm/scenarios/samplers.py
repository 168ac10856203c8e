"""The ranges that the scenarios draw from, in one table; docs/scenarios.md shows the same table."""

from dataclasses import dataclass

from hybridmpm.scenarios.placement import RampShape, Span

_RAMPS = RampShape(length=(0.15, 0.35), thickness=(0.02, 0.03), steepest=50.0)


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Ranges of the initial velocity of a block."""

    horizontal: Span
    """Along x, and along z in 3D [m/s]."""
    vertical: Span
    """Along y, upwards [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Sampler:
    """Ranges of one scenario; pairs of floats are the ends of uniform distributions."""

    text: str
    dim: int
    frames: int
    """Suggested length, that of the paper's data."""
    max_particles: int
    materials: tuple[str, ...]
    """Each appears at least once; further blocks draw one of them."""
    motion: Motion
    salt: int
    """Keeps scenarios apart that are drawn with one seed."""
    blocks: tuple[int, int] = (1, 3)
    """Least and most."""
    fill: Span = (0.45, 0.95)
    """Particles of all blocks together, as a share of `max_particles`."""
    top: float = 1.0
    """Height that no block reaches above, as a share of the distance between floor and ceiling."""
    aspect: Span = (0.6, 1.6)
    """Sides relative to a cube of the same measure, before they are rescaled to it."""
    ramps: tuple[int, int] = (0, 0)
    """Least and most; those that find no room are left out, but never all."""
    ramp_shape: RampShape = _RAMPS


# Chosen so that the per-frame velocities of water_2d and sand_2d spread as in DeepMind's WaterDrop and Sand.
_WATER = Motion(horizontal=(-0.8, 0.8), vertical=(-0.8, 0.4))
_SAND = Motion(horizontal=(-3.0, 3.0), vertical=(-3.0, 1.0))

SAMPLERS: dict[str, Sampler] = {
    "water_2d": Sampler(
        text="One to three blocks of water fall, slosh and settle.",
        dim=2,
        frames=1000,
        max_particles=4000,
        materials=("water",),
        motion=_WATER,
        top=0.7,
        salt=1,
    ),
    "water_ramps_2d": Sampler(
        text="Water runs over one to four random ramps.",
        dim=2,
        frames=600,
        max_particles=3300,
        materials=("water",),
        motion=_WATER,
        ramps=(1, 4),
        salt=2,
    ),
    "sand_2d": Sampler(
        text="One to three blocks of sand fall into heaps.",
        dim=2,
        frames=320,
        max_particles=4000,
        materials=("sand",),
        motion=_SAND,
        salt=3,
    ),
    "sand_ramps_2d": Sampler(
        text="Sand slides down one to four random ramps.",
        dim=2,
        frames=400,
        max_particles=3300,
        materials=("sand",),
        motion=_SAND,
        ramps=(1, 4),
        salt=4,
    ),
    "water_3d": Sampler(
        text="One to three blocks of water fall and spread in 3D.",
        dim=3,
        frames=800,
        max_particles=4000,
        materials=("water",),
        motion=_WATER,
        fill=(0.45, 0.9),
        top=0.7,
        salt=5,
    ),
    "sand_3d": Sampler(
        text="One to three blocks of sand fall into heaps in 3D.",
        dim=3,
        frames=350,
        max_particles=4000,
        materials=("sand",),
        motion=_SAND,
        fill=(0.45, 0.9),
        salt=6,
    ),
    "water_sand_2d": Sampler(
        text="Blocks of water and of sand fall on each other.",
        dim=2,
        frames=500,
        max_particles=4000,
        materials=("water", "sand"),
        motion=_WATER,
        blocks=(2, 3),
        salt=7,
    ),
}


def markdown_table() -> str:
    """Write `SAMPLERS` as a Markdown table, one scenario a row."""
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
        ", ".join(sampler.materials),
        _span(sampler.blocks),
        _span(sampler.fill),
        f"{sampler.top:g} of the height",
        _span(sampler.aspect),
        _span(sampler.motion.horizontal),
        _span(sampler.motion.vertical),
        *ramps,
    )


def _span(pair: Span | tuple[int, int]) -> str:
    return f"{pair[0]:g} .. {pair[1]:g}"
