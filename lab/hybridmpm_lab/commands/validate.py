"""`python -m hybridmpm_lab validate`: compare the solver with experiments and closed forms."""

from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab import validation
from hybridmpm_lab.validation import page


@click.command()
@click.argument("cases", nargs=-1, type=click.Choice(list(validation.CASES)), metavar="[CASE]...")
@click.option(
    "--out",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Folder to write a page of these cases to: README.md and charts.",
)
@click.pass_context
def validate(ctx: click.Context, cases: tuple[str, ...], out: Path | None) -> None:
    """Compare the solver with experiments and closed forms, and print each figure with its target.

    All cases are run if none is named. The exit status is 1 if a figure is outside its tolerance.
    """
    chosen = [name for name in validation.CASES if name in cases or not cases]
    outcomes = []
    with progress("Validating", len(chosen)) as bar:
        for name in chosen:
            case = validation.CASES[name]
            outcomes.append((name, case, case.run()))
            bar.update(1)
    for _, case, result in outcomes:
        click.echo(f"{case.title}\n{page.text_table(result.checks)}\n")
    if out is not None:
        page.write(out, outcomes)
        click.echo(f"wrote {out / 'README.md'} and its charts")
    failed = any(check.verdict == "FAIL" for _, _, result in outcomes for check in result.checks)
    ctx.exit(1 if failed else 0)
