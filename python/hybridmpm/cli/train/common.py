"""Options and steps that all commands of `hybridmpm train` share."""

import dataclasses
import math
import shlex
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click
from click.core import ParameterSource

from hybridmpm import scenarios
from hybridmpm._core import SOLVER_VERSION
from hybridmpm._support.machine import cpu_model, usable_cores
from hybridmpm.cli.progress import progress
from hybridmpm.data import SceneTemplate
from hybridmpm.data.splits import FIRST_TEST, FIRST_VALID
from hybridmpm.errors import ConfigError
from hybridmpm.training.settings import Settings

if TYPE_CHECKING:
    from hybridmpm.training.devices import Device
    from hybridmpm.training.sources import Drawn, Source
    from hybridmpm.training.trainable import Trainable

F = TypeVar("F", bound=Callable[..., Any])
S = TypeVar("S", bound=Settings)
T = TypeVar("T", bound="Trainable[Any]")

device_option = click.option(
    "--device",
    default="auto",
    show_default=True,
    help="Device of torch: cpu, cuda, or auto, which is cuda where there is one.",
)
_SMOOTH = 0.98
"""Share of the shown loss that a step keeps."""
_CHECKPOINT = "Checkpoint whose weights, network and scales this training begins with."


def training_options(
    kind: type[Settings], root: str, content: str, *more: Callable[[F], F], finetune: str = _CHECKPOINT
) -> Callable[[F], F]:
    """Return the options of a training.

    Parameters
    ----------
    kind : type
        Settings of the training; each field is an option.
    root : str
        Default folder of the data.
    content : str
        Help on this folder.
    more : click options
        Options of the network and of the data.
    finetune : str
        Help on --finetune.
    """
    folder = click.Path(file_okay=False, path_type=Path)
    options: list[Callable[[F], F]] = [
        click.option(
            "--scenario",
            "names",
            type=click.Choice(scenarios.NAMES),
            multiple=True,
            help="Scenario to train on; may be repeated for a network that serves several.",
        ),
        click.option(
            "--scene",
            "files",
            type=click.Path(exists=True, dir_okay=False, path_type=Path),
            multiple=True,
            metavar="FILE",
            help="Scene file, .yaml or .json, to train on; it may have ranges from which each seed draws "
            "(docs/guide/datasets.md). May be repeated.",
        ),
        click.option(
            "--out",
            type=folder,
            required=True,
            metavar="FOLDER",
            help="Folder of the checkpoint and the logs. A training in it is continued.",
        ),
        click.option(
            "--data",
            "root",
            type=folder,
            default=Path(root),
            show_default=True,
            metavar="FOLDER",
            help=content,
        ),
        *more,
        *(_option(field) for field in dataclasses.fields(kind)),
        click.option(
            "--until",
            type=click.IntRange(min=1),
            help="Training step after which this run stops; a later run continues the schedule of --steps.",
        ),
        click.option(
            "--threads",
            type=click.IntRange(1, 1024),
            help="Number of torch's threads on the CPU. Default: torch's choice.",
        ),
        click.option(
            "--finetune",
            type=click.Path(dir_okay=False, path_type=Path),
            metavar="NETWORK",
            help=finetune,
        ),
    ]

    def decorate(command: F) -> F:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def _option(field: dataclasses.Field[Any]) -> Callable[[F], F]:
    """Return the option of a setting."""
    low, high = field.metadata["low"], field.metadata["high"]
    kinds: dict[Any, Any] = {bool: bool, int: click.IntRange(low, high), float: click.FloatRange(low, high)}
    return click.option(
        "--" + field.name.replace("_", "-"),
        type=kinds[field.type],
        is_flag=field.type is bool,
        default=field.default,
        show_default=True,
        help=field.metadata["text"],
    )


dataset_option = click.option(
    "--dataset",
    "folders",
    type=click.Path(file_okay=False, path_type=Path),
    multiple=True,
    metavar="DIR",
    help="Data set of `hybridmpm dataset generate` to train on; may be repeated.",
)
scenes_option = click.option(
    "--scenes",
    type=click.IntRange(1, FIRST_VALID),
    default=2000,
    show_default=True,
    help="Number of scenes of each scenario for training.",
)
valid_option = click.option(
    "--valid",
    type=click.IntRange(1, FIRST_TEST - FIRST_VALID),
    default=100,
    show_default=True,
    help="Number of scenes of each scenario for validation.",
)


def settings_of(kind: type[S], options: Mapping[str, Any]) -> S:
    """Return the settings that the options of a command give."""
    return kind(**{field.name: options[field.name] for field in dataclasses.fields(kind)})


def torch_device(name: str, threads: int | None = None) -> "Device":
    """Return torch's device of a name, and set the number of torch's threads if it is given.

    Raises
    ------
    ConfigError
        Torch is not installed, or the device cannot be used.
    """
    try:
        from hybridmpm.training import devices  # noqa: PLC0415 - needs torch
    except ImportError:
        raise ConfigError("training needs torch; install it with: pip install 'hybridmpm[train]'") from None
    return devices.usable(name, threads)


def sources_of(options: Mapping[str, Any], older: Any = None) -> "list[Source]":
    """Return the sources of scenes that options name; without any, the scenarios of an older network.

    Raises
    ------
    UsageError
        There is none, or the older network was trained on other scenes than those of scenarios.
    DataError, SceneError
        A data set or a scene file is damaged or lacks something.
    """
    from hybridmpm.training.sources import DataSet, Drawn  # noqa: PLC0415 - needs torch

    found: list[Source] = [Drawn(scenario=name) for name in options["names"]]
    found += [Drawn(template=SceneTemplate.load(file)) for file in options["files"]]
    found += [DataSet(folder) for folder in options["folders"]]
    if found:
        return found
    if older is not None and older.scenes is None:
        return [Drawn(scenario=name) for name in older.scenarios]
    if older is not None:
        raise click.UsageError(
            f"The network was trained on {', '.join(older.scenarios)}: give their --scene or --dataset "
            "again, or others."
        )
    raise click.UsageError(
        "Give at least one --scenario, --scene FILE or --dataset DIR. Scenarios are "
        f"{', '.join(scenarios.NAMES)}."
    )


def splits_of(options: Mapping[str, Any]) -> tuple[range, range]:
    """Return the seeds of the scenes for training and for validation."""
    return range(options["scenes"]), range(FIRST_VALID, FIRST_VALID + options["valid"])


def make_missing(
    root: Path,
    sources: "Sequence[Drawn]",
    splits: Collection[range],
    prepare: "Callable[[Path, Drawn, range, Callable[[int], object]], object]",
) -> None:
    """Make the missing files of sources and seeds by `prepare`, with a bar of progress."""
    from hybridmpm.training.control import scene_files  # noqa: PLC0415 - needs torch

    for source in sources:
        for seeds in splits:
            if count := scene_files.missing(root, source, seeds):
                with progress(f"Simulating {source.label}", count) as bar:
                    prepare(root, source, seeds, bar.update)


def continued(ctx: click.Context, load: Callable[[Path], T]) -> T | None:
    """Return the trainer of the checkpoint in the folder --out, which is made where missing.

    Raises
    ------
    ConfigError
        An option differs from the checkpoint.
    """
    from hybridmpm.training import run  # noqa: PLC0415 - needs torch

    out: Path = ctx.params["out"]
    out.mkdir(parents=True, exist_ok=True)
    file = out / run.CHECKPOINT
    if not file.exists():
        return None
    trainer: Any = load(file)
    there = {**dataclasses.asdict(trainer.spec), **dataclasses.asdict(trainer.settings)}
    labels, known = [one.label for one in sources_of(ctx.params, trainer.spec)], trainer.spec.scenarios
    if set(labels) != set(known):
        raise ConfigError(
            f"{file} was trained on {', '.join(known)}, not on {', '.join(labels)}; choose another --out"
        )
    del there["scenes"]  # another option has this name
    refuse_other_options(ctx, there, file, instead="leave it out or choose another --out")
    return cast("T", trainer)


def is_given(ctx: click.Context, key: str) -> bool:
    """Whether an option is on the command line."""
    return ctx.get_parameter_source(key) is ParameterSource.COMMANDLINE


def refuse_other_options(ctx: click.Context, there: Mapping[str, Any], file: Path, *, instead: str) -> None:
    """Refuse an option whose value differs from that of a checkpoint.

    Parameters
    ----------
    ctx : Context
        Context of the command, with the options that were given.
    there : mapping
        Values of the checkpoint, by the names of the options.
    file : Path
        The checkpoint.
    instead : str
        End of the message: the remedy.

    Raises
    ------
    ConfigError
        The message names the option and both values.
    """
    for key, value in ctx.params.items():
        if is_given(ctx, key) and key in there and not math.isclose(there[key], value):
            flag = "--" + key.replace("_", "-")
            raise ConfigError(f"{file} has {flag} {there[key]}, not {value}; {instead}")


def run_shown(
    trainer: "Trainable[Any]",
    ctx: click.Context,
    *,
    step: Callable[[], float],
    validate: Callable[[], object],
    device: "Device",
    data: str,
    before: Mapping[str, str] | None = None,
) -> None:
    """Run a training in the folder --out with a bar of progress; see `training.run.train`.

    Parameters
    ----------
    trainer : Trainable
    ctx : Context
        Context of the command.
    step, validate : callable
        As for `training.run.train`.
    device : Device
    data : str
        Text about the data.
    before : mapping, optional
        Result of `checkpoint.origin_of` for the weights that the training began with.
    """
    from hybridmpm.training import checkpoint, run  # noqa: PLC0415 - needs torch

    out: Path = ctx.params["out"]
    file = out / run.CHECKPOINT
    if file.exists():
        about = dict(checkpoint.read(file)["about"])
        about["solver_versions"] = checkpoint.with_this_solver(about)
    else:
        command = shlex.join(["hybridmpm", *sys.argv[1:]])
        machine = f"{cpu_model()}, {usable_cores()} cores" if device.type == "cpu" else str(device)
        about = {"solver_versions": str(SOLVER_VERSION), **(before or {}), "machine": machine}
        about["command"] = command if before is None else f"{before['command']}; {command}"
    about["data"] = data
    click.echo(f"{trainer.parameters} parameters, {data}, on {device}", err=True)
    last = min(trainer.last_step, ctx.params["until"] or trainer.last_step)
    mean = math.nan
    with progress("Training", last, done=trainer.step_count) as bar:

        def show(loss: float) -> None:
            nonlocal mean
            mean = loss if math.isnan(mean) else _SMOOTH * mean + (1 - _SMOOTH) * loss
            bar.label = f"Training, loss {mean:.4f}"
            bar.update(1)

        try:
            run.train(
                trainer,
                out,
                step=step,
                validate=validate,
                about=about,
                on_step=show,
                until=ctx.params["until"],
            )
        except KeyboardInterrupt:
            click.echo(
                f"\nstopped after step {trainer.step_count}; the same command goes on from there", err=True
            )
            raise
    click.echo(f"wrote {file}, and losses and validation beside it")


def origin_of(file: Path | None) -> dict[str, str] | None:
    """Return the origin of the weights of a checkpoint; None without one."""
    from hybridmpm.training import checkpoint  # noqa: PLC0415 - needs torch

    return None if file is None else checkpoint.origin_of(checkpoint.read(file))
