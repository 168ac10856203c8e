"""Command-line options that several commands share, and types of options."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm import export, scenarios, simulators
from hybridmpm.data.template import SceneTemplate
from hybridmpm.errors import ConfigError, ExportError
from hybridmpm.mpm import Substeps
from hybridmpm.physics import models
from hybridmpm.physics.load import ZERO
from hybridmpm.scene import Scene


class RatioType(click.ParamType[float, object]):
    """A number, or the ratio of two numbers: 0.25 or 1/1.75."""

    name = "number or a/b"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number; fails for other text and for a ratio with 0 below."""
        above, slash, below = str(value).partition("/")
        try:
            return float(above) / float(below) if slash else float(above)
        except (ValueError, ZeroDivisionError):
            self.fail(f"{value!r} is no number such as 0.25 or 1/1.75", param, ctx)


class SubstepsType(click.ParamType[Substeps, object]):
    """A rule for the number of substeps in a frame, or this number."""

    name = "cfl|reference|INT"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Substeps:
        """Return the rule or the number; fails for other text."""
        match value:
            case "cfl":
                return "cfl"
            case "reference":
                return "reference"
        try:
            return int(str(value))
        except ValueError:
            self.fail(f"{value!r} is none of cfl, reference or a whole number", param, ctx)


def substeps_option(default: str | None, more: str = "") -> Callable[..., Any]:
    """Return the option for the rule of substeps, with its default and more help."""
    return click.option(
        "--substeps",
        type=SubstepsType(),
        default=default,
        show_default=True,
        help="Substeps in a frame: as few as the CFL bound allows (cfl), by the ground truth's rule "
        f"(reference), or a fixed number.{more}",
    )


seed_option = click.option(
    "--seed",
    type=int,
    default=0,
    show_default=True,
    help="Seed of the scenario, or of a scene file with ranges.",
)
"""Seed that a scene is drawn from."""


def completing(names: Callable[[], Iterable[str]]) -> Callable[..., list[str]]:
    """Return the completion of a name in a shell, for the `shell_complete` of an argument or an option.

    `names` is called only for a completion.
    """
    return lambda _ctx, _param, incomplete: [name for name in names() if name.startswith(incomplete)]


model_option = click.option(
    "--model",
    metavar="NAME",
    shell_complete=completing(lambda: [*models(), ZERO]),
    help="Name of the network, or its .onnx file, for a simulator that has one; zero is free fall. Default: "
    "the first network that serves the scenario.",
)
"""Network of a simulator."""

r_c_option = click.option(
    "--r-c",
    type=click.FloatRange(-1, 1),
    help="Mean cosine between the accelerations of two successive time windows below which MPM takes over, "
    "for the hybrid simulator. Default: the cosine is not among the guards.",
)
"""Threshold of the safeguard."""

threads_option = click.option(
    "--threads",
    type=click.IntRange(1, 1024),
    default=1,
    show_default=True,
    help="Number of threads; the result does not depend on it.",
)
"""Threads of one simulator."""

solver_option = click.option(
    "--solver",
    "kind",
    type=click.Choice(list(simulators.SIMULATORS)),
    default="mpm",
    show_default=True,
    help="Simulator: the MPM solver (mpm), a network alone (neural), or a network from which MPM takes over "
    "at an alarm (hybrid).",
)
"""Kind of the simulator; `model_option` belongs to it."""

targets_option = click.option(
    "--out",
    "targets",
    type=click.Path(dir_okay=False, path_type=Path),
    multiple=True,
    metavar="FILE",
    help="File to write; its suffix decides the content, see above. May be repeated.",
)
"""Files to write; check them by `check_targets` before there is anything to write."""


def width_option(default: int) -> Callable[..., Any]:
    """Return the option for the width of pictures, with its default."""
    return click.option(
        "--width",
        type=click.IntRange(64, 4096),
        default=default,
        show_default=True,
        help="Width of a picture [pixels].",
    )


speed_option = click.option(
    "--speed",
    type=click.FloatRange(0.01, 10),
    default=1.0,
    show_default=True,
    help="Simulated seconds in a second of film.",
)
"""Speed of films."""


def scene_of(name: str, seed: int) -> Scene:
    """Return the scene of a scenario and a seed, or of a scene file, where that has ranges the seed's.

    Raises
    ------
    ConfigError
        `name` is neither; the message lists the scenarios. Or the file has no valid scene.
    """
    if name in scenarios.NAMES:
        return scenarios.get(name, seed)
    if not Path(name).is_file():
        known = ", ".join(scenarios.NAMES)
        raise ConfigError(
            f"{name} is neither a file nor a scenario: give a .json or .yaml file, or one of {known}"
        )
    return scene_in(Path(name), seed)


def scene_in(path: Path, seed: int) -> Scene:
    """Return the scene of a file; that of a seed, with a note, where the file has ranges."""
    if not SceneTemplate.is_in(path):
        return Scene.load(path)
    click.echo(f"{path} has ranges; this is its scene of seed {seed}, and --seed draws others.", err=True)
    return SceneTemplate.load(path).draw(seed)


def check_targets(
    targets: Sequence[Path], style: export.Style | None = None, *, dim: int | None = None
) -> None:
    """Refuse files of `targets_option` that nothing could be written to; see `export.check_target`.

    Raises
    ------
    UsageError
        A suffix is unknown, a folder does not exist, a package for the format is missing, or a surface is
        asked for in 2D.
    """
    for target in targets:
        try:
            export.check_target(target, style, dim=dim)
        except ExportError as error:
            raise click.UsageError(f"--out: {error}.") from None
