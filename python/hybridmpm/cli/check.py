"""`hybridmpm check`: findings about a scene before its first frame."""

import json

import click

from hybridmpm import checking, scenarios
from hybridmpm.checking import SceneCheck
from hybridmpm.cli.options import completing, scene_of, seed_option, substeps_option, threads_option
from hybridmpm.coarse import coarse_table
from hybridmpm.errors import SceneError
from hybridmpm.mpm import MpmSolver, Substeps
from hybridmpm.scene import Scene


@click.command()
@click.argument("scene", shell_complete=completing(lambda: scenarios.NAMES))
@seed_option
@substeps_option("cfl")
@click.option(
    "--coarse",
    metavar="NAME",
    shell_complete=completing(lambda: coarse_table().ratios),
    help="Coarse level to check, such as 1/16.",
)
@threads_option
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
@click.pass_context
def check(
    ctx: click.Context,
    *,
    scene: str,
    seed: int,
    substeps: Substeps,
    coarse: str | None,
    threads: int,
    as_json: bool,
) -> None:
    """Check whether SCENE runs stably, its cost, and what to change.

    SCENE is a file, .json or .yaml, or the name of a scenario. A few frames are tried. The exit status is 1
    if the scene cannot run, or not stably.
    """
    try:
        made = scene_of(scene, seed)
    except SceneError as error:
        _refused(scene, error, as_json=as_json)
        ctx.exit(1)
    found = _checked(made, substeps=substeps, coarse=coarse, threads=threads)
    click.echo(json.dumps(found.to_dict(), indent=2) if as_json else str(found))
    ctx.exit(0 if found.ok else 1)


def _checked(scene: Scene, *, substeps: Substeps, coarse: str | None, threads: int) -> SceneCheck:
    """Check a scene with the settings of the solver."""
    if substeps == "cfl" and coarse is None and threads == 1:
        return checking.check(scene)
    return checking.check_with(
        scene, lambda: MpmSolver(scene, substeps=substeps, coarse=coarse, threads=threads)
    )


def _refused(scene: str, error: SceneError, *, as_json: bool) -> None:
    """Print all faults of an invalid scene."""
    faults = [{"severity": "error", "field": field, "problem": text} for field, text in error.problems] or [
        {"severity": "error", "field": "", "problem": str(error)}
    ]
    if as_json:
        click.echo(json.dumps({"scene": scene, "ok": False, "findings": faults}, indent=2))
        return
    click.echo(f"{scene}: no valid scene; {len(faults)} fault{'s' * (len(faults) > 1)}")
    for fault in faults:
        where = f"{fault['field']}: " if fault["field"] else ""
        click.echo(f"  error: {where}{fault['problem']}")
