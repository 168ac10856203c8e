"""`hybridmpm dataset ...`: make, describe, draw and convert sets of trajectories."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hybridmpm import data, export, scenarios
from hybridmpm.cli.progress import CountedProgress, progress
from hybridmpm.cli.simulate import SubstepsType
from hybridmpm.cli.types import RatioType
from hybridmpm.data import metadata
from hybridmpm.data.view import recording_of, write_sheet
from hybridmpm.scene.particle_types import NAMES

if TYPE_CHECKING:
    from hybridmpm.data.generation.executors import Executor
    from hybridmpm.mpm import Substeps

_FOLDER = click.Path(file_okay=False, path_type=Path)
_FORMAT = click.Choice(list(data.FORMATS))
_SHEET_ROWS = 6


@click.group()
def dataset() -> None:
    """Make, describe, draw and convert data sets of trajectories (docs/datasets.md)."""


@dataset.command()
@click.argument("scenario", required=False)
@click.option(
    "--scene",
    "scene_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Draw scenes from this .yaml with ranges instead of a scenario.",
)
@click.option("--out", type=_FOLDER, required=True, metavar="DIR", help="Where it goes, or goes on.")
@click.option("--trajectories", type=click.IntRange(min=0), required=True, help="For training.")
@click.option("--valid", type=click.IntRange(min=0), help="For validation. Default: a tenth, at least one.")
@click.option("--test", type=click.IntRange(min=0), help="For tests. Default: a tenth, at least one.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the first trajectory of each split.")
@click.option("--frames", type=click.IntRange(min=1), help="To simulate. Default: what the scenes suggest.")
@click.option(
    "--stride", type=click.IntRange(min=1), default=1, show_default=True, help="Frames between states kept."
)
@click.option("--r-p", type=RatioType(), default=1.0, show_default=True, help="Ratio of particles kept.")
@click.option("--max-compression", type=float, help="Of all water at rest, e.g. 0.01: its stiffness.")
@click.option(
    "--substeps", type=SubstepsType(), help="As in simulate. Default: reference; cfl with --max-compression."
)
@click.option("--force", type=float, default=0.0, help="Stir by a random acceleration [m/s^2], stored too.")
@click.option("--executor", type=click.Choice(["threads", "ray"]), default="threads", show_default=True)
@click.option("--threads", type=click.IntRange(1, 1024), help="Trajectories at a time. Default: all cores.")
@click.option("--ray-address", default="auto", show_default=True, help="Of the cluster of --executor ray.")
@click.pass_context
def generate(
    ctx: click.Context,
    *,
    scenario: str | None,
    scene_file: Path | None,
    out: Path,
    trajectories: int,
    valid: int | None,
    test: int | None,
    seed: int,
    frames: int | None,
    stride: int,
    r_p: float,
    max_compression: float | None,
    substeps: "Substeps | None",
    force: float,
    executor: str,
    threads: int | None,
    ray_address: str,
) -> None:
    """Make a data set of SCENARIO (see `hybridmpm scenarios`) or of a scene file with ranges.

    The same command goes on with what was interrupted, and with a larger number adds to what is there. Exit
    status 1 if a simulation failed; all others are then in the data set.
    """
    if (scenario is None) == (scene_file is None):
        raise click.UsageError(f"Give a scenario ({', '.join(scenarios.NAMES)}) or --scene FILE.")
    recipe = data.Recipe(
        scenario=scenario,
        template=None if scene_file is None else data.SceneTemplate.load(scene_file),
        frames=frames,
        stride=stride,
        r_p=r_p,
        max_compression=max_compression,
        substeps=substeps or ("reference" if max_compression is None else "cfl"),
        force=force,
    )
    tenth = max(1, trajectories // 10)
    seeds = data.Seeds(
        train=trajectories,
        valid=tenth if valid is None else valid,
        test=tenth if test is None else test,
        first=seed,
    )
    workers: Executor = data.RayTasks(ray_address) if executor == "ray" else data.Threads(threads)
    planned = data.plan(recipe, out, seeds)
    _announce(planned)
    with progress(f"Making {len(planned.todo)} trajectories", len(planned.todo)) as bar:
        report = data.generate(planned, executor=workers, on_progress=bar.update)
    for number, message in report.failed.items():
        click.echo(f"seed {number} failed: {message}", err=True)
    click.echo(f"{out}: {planned.done + report.made} trajectories, {report.made} of them new")
    ctx.exit(1 if report.failed else 0)


def _announce(planned: data.Plan) -> None:
    for message in planned.damaged:
        click.echo(f"{message}; it is made anew", err=True)
    counts = ", ".join(f"{count} {split}" for split, count in planned.seeds.counts().items())
    click.echo(
        f"{counts}; {planned.done} are there. The others take up to {_size(planned.bytes_needed)}, "
        f"{_size(planned.bytes_between)} while they are put together; {_size(planned.bytes_free)} are free.",
        err=True,
    )


def _size(number: int) -> str:
    return f"{number / 1e9:.2f} GB" if number >= 10**8 else f"{number / 1e6:.1f} MB"


def _format_option(name: str, text: str) -> Callable[..., Any]:
    return click.option(name, f"{name.strip('-')}_format", type=_FORMAT, help=text)


_from_option = _format_option("--from", "Format of DIR, where its files do not tell.")


def _opened(folder: Path, name: str | None) -> data.Format:
    return data.detect(folder) if name is None else data.FORMATS[name]


@dataset.command()
@click.argument("folder", type=_FOLDER, metavar="DIR")
@_from_option
@click.option("--split", help="Only this one.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def stats(*, folder: Path, from_format: str | None, split: str | None, as_json: bool) -> None:
    """Read a data set once, check it, and print its statistics."""
    form = _opened(folder, from_format)
    found = {}
    for name in [split] if split else form.splits(folder):
        digests: list[str] = []
        total = data.Statistics()
        with progress(f"Reading {name}", form.count(folder, name)) as bar:
            for trajectory in form.read(folder, name, None):
                total.add(trajectory)
                digests.append(trajectory.digest)
                bar.update(1)
        found[name] = _summary(total, digests)
    if as_json:
        click.echo(json.dumps(found, indent=1))
        return
    for name, summary in found.items():
        click.echo(f"{name} ({form.name})")
        for key, value in summary.items():
            click.echo(f"  {key:16s} {value}")


def _summary(total: data.Statistics, digests: list[str]) -> dict[str, Any]:
    return {
        "trajectories": total.trajectories,
        "dim": total.dim,
        "states": [min(total.states, default=0), max(total.states, default=0)],
        "particles": [min(total.particles, default=0), max(total.particles, default=0)],
        "types": {NAMES[number]: count for number, count in sorted(total.types.items())},
        **total.metadata(),
        "digest": metadata.digest_of(digests),
    }


@dataset.command()
@click.argument("folder", type=_FOLDER, metavar="DIR")
@_from_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), required=True, metavar="FILE")
@click.option("--split", help="Default: the first there is, train if possible.")
@click.option("--index", type=click.IntRange(min=0), multiple=True, help="Of a trajectory; may be repeated.")
@click.option(
    "--moments", type=click.IntRange(1, 12), default=4, show_default=True, help="In a row of a .png."
)
@click.option("--width", type=click.IntRange(64, 4096), default=320, show_default=True, help="Of a picture.")
@click.option("--speed", type=click.FloatRange(0.01, 10), default=1.0, show_default=True, help="Of a film.")
def view(
    *,
    folder: Path,
    from_format: str | None,
    out: Path,
    split: str | None,
    index: tuple[int, ...],
    moments: int,
    width: int,
    speed: float,
) -> None:
    """Draw trajectories: a .png is a sheet with one row each, a .gif or .mp4 a film of one."""
    film = out.suffix.lower() in {".gif", ".mp4"}
    if out.suffix.lower() != ".png" and not film:
        raise click.UsageError(f"--out: files end in .png, .gif or .mp4; got {out.name!r}.")
    if film and len(index) > 1:
        raise click.UsageError("--index: a film shows one trajectory; write a .png for several.")
    export.check_target(out)
    form, about = _opened(folder, from_format), metadata.read(folder)
    splits = form.splits(folder)
    split = split or splits[0]
    numbers = list(index) or list(range(1 if film else min(_SHEET_ROWS, form.count(folder, split))))
    shown = list(form.read(folder, split, numbers))
    recordings = [recording_of(trajectory, about) for trajectory in shown]
    if film:
        with progress(f"Writing {out.name}", CountedProgress.STEPS) as bar:
            style = export.Style(width=width, speed=speed)
            export.save(out, recordings[0], style, on_progress=CountedProgress(bar))
            bar.finish()
    else:
        labels = [
            f"{split} {number}" if one.seed is None else f"seed {one.seed}"
            for number, one in zip(numbers, shown, strict=True)
        ]
        write_sheet(out, recordings, labels, moments=moments, width=width)
    click.echo(f"wrote {out}")


@dataset.command()
@click.argument("folder", type=_FOLDER, metavar="DIR")
@_from_option
@click.option("--to", "to_format", type=_FORMAT, required=True, help="Format to write.")
@click.option("--out", type=_FOLDER, required=True, metavar="DIR", help="A new folder.")
def convert(*, folder: Path, from_format: str | None, to_format: str, out: Path) -> None:
    """Write a data set in another format; positions keep their bits, particle types are translated."""
    form = _opened(folder, from_format)
    total = sum(form.count(folder, split) for split in form.splits(folder))
    with progress(f"Converting {total} trajectories", total) as bar:
        done = data.convert(folder, form, out, data.FORMATS[to_format], on_progress=bar.update)
    if done.lost:
        click.echo(f"{to_format} cannot hold {', '.join(done.lost)}; left out", err=True)
    counts = ", ".join(f"{count} {split}" for split, count in done.trajectories.items())
    click.echo(f"wrote {counts} to {out} as {to_format}")
