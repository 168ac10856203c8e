"""`hybridmpm plan`: choose the method that simulates a scene within an error or a time."""

import json
from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.cli.options import completing, scene_of, seed_option
from hybridmpm.planner import plan as planned
from hybridmpm.planner.calibration import MEASURES


@click.command()
@click.argument("scene_name", metavar="SCENE", shell_complete=completing(lambda: scenarios.NAMES))
@seed_option
@click.option("--max-error", type=float, help="Largest mean error: choose the fastest method within it.")
@click.option(
    "--budget-ms",
    type=float,
    help="Longest time of a frame [ms]: choose the most accurate method within it.",
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
    """Choose the method for SCENE, a scenario or a scene file (.json, .yaml).

    Give --max-error or --budget-ms. Prints the method with its settings, its expected error and time, the
    runner-up, and the reason.
    """
    found = planned(
        scene_of(scene_name, seed),
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
        f"about {found.particles} particles{', all particles shown' if found.show_all else ''}"
    )
    click.echo(f"grid {found.resolution} cells/m, about {found.substeps} substeps, moduli times {moduli}")
    for note in found.notes:
        click.echo(f"- {note}")
