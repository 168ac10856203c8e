"""`hybridmpm plan`: which coarse level simulates a scene within an error or a time."""

import json
from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.cli.options import completing, seed_option
from hybridmpm.errors import ConfigError
from hybridmpm.planner import plan as planned
from hybridmpm.planner.calibration import MEASURES
from hybridmpm.scene import Scene


@click.command()
@click.argument("scene_name", metavar="SCENE", shell_complete=completing(lambda: scenarios.NAMES))
@seed_option
@click.option(
    "--max-error", type=float, help="Largest mean error: answer the quickest coarse level within it."
)
@click.option(
    "--budget-ms",
    type=float,
    help="Longest time of a frame [ms]: answer the most accurate coarse level within it.",
)
@click.option(
    "--measure",
    type=click.Choice(list(MEASURES)),
    default="grid_rmse",
    show_default=True,
    help="Measure of the error.",
)
@click.option(
    "--calibration",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="File of times that `hybridmpm calibrate` wrote. Default: the user's own, else the library's.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the plan as JSON.")
def plan(
    *,
    scene_name: str,
    seed: int,
    max_error: float | None,
    budget_ms: float | None,
    measure: str,
    calibration: Path | None,
    as_json: bool,
) -> None:
    """Choose the coarse level for SCENE, a scenario or a scene file (.json, .yaml).

    Give --max-error or --budget-ms. The answer tells the coarse level with its settings, what it is expected to err
    and to take, which one comes next, and why.
    """
    found = planned(
        _scene(scene_name, seed),
        max_error=max_error,
        budget_ms=budget_ms,
        measure=measure,
        calibration=calibration,
    )
    if as_json:
        click.echo(json.dumps(found.to_dict(), indent=1))
        return
    click.echo(found.reason)
    moduli = ", ".join(f"{factor:.3g}" for factor in found.moduli)
    click.echo(
        f"simulator {found.simulator}{f', model {found.model}' if found.model else ''}; r_p {found.r_p:.4g}, "
        f"about {found.particles} particles{', carrying all others' if found.show_all else ''}"
    )
    click.echo(f"grid {found.resolution} cells/m, about {found.substeps} substeps, moduli times {moduli}")
    for note in found.notes:
        click.echo(f"- {note}")


def _scene(name: str, seed: int) -> Scene:
    if name in scenarios.NAMES:
        return scenarios.get(name, seed)
    if Path(name).exists():
        return Scene.load(Path(name))
    raise ConfigError(f"{name} is neither a file nor a scenario; there are {', '.join(scenarios.NAMES)}")
