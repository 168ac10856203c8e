"""`hybridmpm dataset ...`: make, describe, draw and convert data sets of trajectories."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hybridmpm import data, export, scenarios
from hybridmpm.cli.options import RatioType, speed_option, substeps_option, width_option
from hybridmpm.cli.progress import CountedProgress, progress
from hybridmpm.data import metadata
from hybridmpm.data.view import recording_of, write_sheet
from hybridmpm.scene.particle_types import NAMES

if TYPE_CHECKING:
    from hybridmpm.data.generation.executors import Executor
    from hybridmpm.mpm import Substeps

_FOLDER = click.Path(file_okay=False, path_type=Path)
_FORMAT = click.Choice(list(data.FORMATS))
_SHEET_ROWS = 6
"""Number of trajectories on a sheet where --index names none."""


@click.group()
def dataset() -> None:
    """Make, describe, draw and convert data sets of trajectories (docs/guide/datasets.md)."""


@dataset.command()
@click.argument("scenario", required=False)
@click.option(
    "--scene",
    "scene_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Scene file with ranges, .yaml or .json, to draw scenes from instead of a scenario.",
)
@click.option(
    "--out",
    type=_FOLDER,
    required=True,
    metavar="DIR",
    help="Folder of the data set, which is completed.",
)
@click.option(
    "--trajectories", type=click.IntRange(min=0), required=True, help="Number of trajectories for training."
)
@click.option(
    "--valid",
    type=click.IntRange(min=0),
    help="Number of trajectories for validation. Default: a tenth of --trajectories, at least one.",
)
@click.option(
    "--test",
    type=click.IntRange(min=0),
    help="Number of trajectories for tests. Default: a tenth of --trajectories, at least one.",
)
@click.option(
    "--seed",
    type=int,
    default=0,
    show_default=True,
    help="First seed of each split, counted from the start of the split's seeds.",
)
@click.option(
    "--frames",
    type=click.IntRange(min=1),
    help="Number of frames to simulate. Default: the number that the scenes suggest; with --control 100.",
)
@click.option(
    "--stride",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Number of frames from one stored state to the next.",
)
@click.option(
    "--r-p",
    type=RatioType(),
    default=1.0,
    show_default=True,
    help="Number of particles over that of the scene, e.g. 1/1.75.",
)
@click.option(
    "--max-compression",
    type=float,
    help="Largest compression of water at rest, e.g. 0.01; it sets the stiffness of all water. Default: the "
    "stiffness of the scenes.",
)
@substeps_option(None, " Default: reference, but cfl with --max-compression.")
@click.option(
    "--force",
    type=float,
    default=0.0,
    show_default=True,
    help="Root mean square of a random acceleration that stirs the particles [m/s^2]; it is stored, too.",
)
@click.option(
    "--control",
    is_flag=True,
    help="Make examples of control: fluids that are led back to where they were, with sketches of that.",
)
@click.option(
    "--executor",
    type=click.Choice(["threads", "ray"]),
    default="threads",
    show_default=True,
    help="Simulate on threads of this process, or as tasks of a Ray cluster.",
)
@click.option(
    "--threads", type=click.IntRange(1, 1024), help="Number of threads. Default: the number of usable cores."
)
@click.option(
    "--ray-address",
    default="auto",
    show_default=True,
    help="Address of the Ray cluster; auto finds the one of this machine.",
)
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
    control: bool,
    executor: str,
    threads: int | None,
    ray_address: str,
) -> None:
    """Make a data set of SCENARIO (see `hybridmpm scenarios`) or of a scene file with ranges.

    After an interruption the same command makes the missing trajectories. With a larger number of
    trajectories it adds to the data set. The exit status is 1 if a simulation failed; all other trajectories
    are then in the data set.
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
        control=control,
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
        f"{counts}; {planned.done} of them are there. The others take up to {_size(planned.bytes_needed)}, "
        f"{_size(planned.bytes_between)} while their files are put together; "
        f"{_size(planned.bytes_free)} are free.",
        err=True,
    )


def _size(number: int) -> str:
    return f"{number / 1e9:.2f} GB" if number >= 10**8 else f"{number / 1e6:.1f} MB"


def _format_option(name: str, text: str) -> Callable[..., Any]:
    return click.option(name, f"{name.strip('-')}_format", type=_FORMAT, help=text)


_from_option = _format_option("--from", "Format of DIR. Default: the format that its files show.")


def _opened(folder: Path, name: str | None) -> data.Format:
    return data.detect(folder) if name is None else data.FORMATS[name]


@dataset.command()
@click.argument("folder", type=_FOLDER, metavar="DIR")
@_from_option
@click.option("--split", help="Split to read. Default: all splits.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def stats(*, folder: Path, from_format: str | None, split: str | None, as_json: bool) -> None:
    """Read the data set in DIR, check it, and print its statistics."""
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
        **({"control": dict(sorted(total.controls.items()))} if total.controls else {}),
        "digest": metadata.digest_of(digests),
    }


@dataset.command()
@click.argument("folder", type=_FOLDER, metavar="DIR")
@_from_option
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    metavar="FILE",
    help="File to write: .png, .gif or .mp4.",
)
@click.option("--split", help="Split of the trajectories. Default: train, or the first that exists.")
@click.option(
    "--index",
    type=click.IntRange(min=0),
    multiple=True,
    help="Number of a trajectory in its split, from 0 on; may be repeated for a .png.",
)
@click.option(
    "--moments",
    type=click.IntRange(1, 12),
    default=4,
    show_default=True,
    help="Number of pictures in a row of a .png.",
)
@width_option(320)
@speed_option
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
    """Draw trajectories of DIR: a .png is a sheet with a row for each, a .gif or .mp4 is a film of one.

    Rows of controlled trajectories begin with their sketch.
    """
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
        sketches = [None if one.control is None else one.control.picture for one in shown]
        write_sheet(out, recordings, labels, moments=moments, width=width, sketches=sketches)
    click.echo(f"wrote {out}")


@dataset.command()
@click.argument("folder", type=_FOLDER, metavar="DIR")
@_from_option
@click.option("--to", "to_format", type=_FORMAT, required=True, help="Format to write.")
@click.option("--out", type=_FOLDER, required=True, metavar="DIR", help="New folder to write.")
def convert(*, folder: Path, from_format: str | None, to_format: str, out: Path) -> None:
    """Write the data set in DIR in another format: positions keep their bits, types are translated."""
    form = _opened(folder, from_format)
    total = sum(form.count(folder, split) for split in form.splits(folder))
    with progress(f"Converting {total} trajectories", total) as bar:
        done = data.convert(folder, form, out, data.FORMATS[to_format], on_progress=bar.update)
    if done.lost:
        click.echo(f"the format {to_format} cannot store {', '.join(done.lost)}; left out", err=True)
    counts = ", ".join(f"{count} {split}" for split, count in done.trajectories.items())
    click.echo(f"wrote {counts} to {out} as {to_format}")
