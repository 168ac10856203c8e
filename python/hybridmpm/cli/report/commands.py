"""The commands that report on the library and its installation."""

import json

import click

from hybridmpm import scenarios as library
from hybridmpm.cli.report.installation import examine
from hybridmpm.scenarios.samplers import markdown_table
from hybridmpm.scene import Scene


@click.command()
@click.option("--ranges", is_flag=True, help="Print the ranges of the scenarios as a Markdown table.")
def scenarios(*, ranges: bool) -> None:
    """List the scenarios, kinds of random scenes."""
    if ranges:
        click.echo(markdown_table(), nl=False)
        return
    for name in library.NAMES:
        info = library.describe(name)
        limits = f"{info.dim}D  {info.frames:4d} frames  <= {info.max_particles} particles"
        click.echo(f"{name:15s} {limits}  {info.text}")


@click.command()
def schema() -> None:
    """Print the JSON Schema of scene files."""
    click.echo(json.dumps(Scene.json_schema(), indent=2))


@click.command()
@click.pass_context
def doctor(ctx: click.Context) -> None:
    """Report versions, processor and missing parts of this installation.

    The exit status is 1 if a part that is needed does not work.
    """
    findings = examine()
    for finding in findings:
        click.echo(f"{finding.subject:13s} {finding.state:8s} {finding.detail}")
    ctx.exit(1 if any(finding.state == "broken" for finding in findings) else 0)
