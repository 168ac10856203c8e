"""What all trainings have in common: their common options, and folders of trainings that have begun."""

import math
import shlex
import sys
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from hybridmpm._core import SOLVER_VERSION
from hybridmpm._support.machine import cpu_model, usable_cores
from hybridmpm.cli.progress import progress
from hybridmpm.data.splits import FIRST_TEST, FIRST_VALID
from hybridmpm.errors import ConfigError

if TYPE_CHECKING:
    import torch

    from hybridmpm.training.run import Trainee

FC = TypeVar("FC", bound=Callable[..., Any] | click.Command)

out_option = click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    metavar="FOLDER",
    help="Folder of the checkpoint and the logs, a new or a begun one.",
)
until_option = click.option(
    "--until",
    type=click.IntRange(min=1),
    help="Training step after which this run stops; a later run goes on with the schedule of --steps.",
)
seed_option = click.option(
    "--seed",
    type=click.IntRange(0, 2**32 - 1),
    default=0,
    show_default=True,
    help="Seed of the initial weights and of all draws in training.",
)
threads_option = click.option(
    "--threads",
    type=click.IntRange(1, 1024),
    help="Number of torch's threads on the CPU. Default: torch's choice.",
)
finetune_option = click.option(
    "--finetune",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="CHECKPOINT",
    help="Checkpoint whose weights, network and scales this training begins with.",
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
    help="Number of scenes of each scenario that the network is held against, now and then.",
)
final_rate_option = click.option(
    "--final-rate",
    type=float,
    default=3e-5,
    show_default=True,
    help="Learning rate at the end; it falls by a cosine.",
)


def learning_rate_option(default: float) -> Callable[[FC], FC]:
    """Return the option of the largest learning rate."""
    return click.option(
        "--learning-rate", type=float, default=default, show_default=True, help="Largest learning rate."
    )


def make_missing(
    root: Path,
    names: Collection[str],
    splits: Collection[range],
    prepare: Callable[[Path, str, range, Callable[[int], object]], object],
) -> None:
    """Make the missing files of scenarios and seeds by `prepare`, with a bar of progress."""
    from hybridmpm.training.control import scene_files  # noqa: PLC0415 - needs torch

    for scenario in names:
        for seeds in splits:
            if count := scene_files.missing(root, scenario, seeds):
                with progress(f"Simulating {scenario}", count) as bar:
                    prepare(root, scenario, seeds, bar.update)


def origin(before: Mapping[str, str] | None) -> dict[str, str]:
    """Return the command that makes the weights and the versions of the solvers of its data.

    Parameters
    ----------
    before : mapping, optional
        What `checkpoint.origin_of` tells of the weights that the training begins with. Their command comes
        first.
    """
    this = shlex.join(["hybridmpm", *sys.argv[1:]])
    if before is None:
        return {"command": this, "solver_versions": str(SOLVER_VERSION)}
    return {**before, "command": f"{before['command']}; {this}"}


def of_checkpoint(file: Path | None) -> dict[str, str] | None:
    """Return what a checkpoint tells of the weights that a training begins with; None without one."""
    from hybridmpm.training import checkpoint  # noqa: PLC0415 - needs torch

    return None if file is None else checkpoint.origin_of(checkpoint.read(file))


def told_before(file: Path) -> dict[str, str]:
    """Return what a checkpoint tells of its training, with this solver among those that made its data."""
    from hybridmpm.training import checkpoint  # noqa: PLC0415 - needs torch

    about = dict(checkpoint.read(file)["about"])
    return about | {"solver_versions": checkpoint.with_this_solver(about)}


def machine_of(device: "torch.device") -> str:
    """Return what a training is told to have run on."""
    return f"{cpu_model()}, {usable_cores()} cores" if device.type == "cpu" else str(device)


def refuse_other_options(
    ctx: click.Context,
    there: Mapping[str, Any],
    trained_on: Collection[str],
    names: tuple[str, ...],
    file: Path,
    *,
    instead: str = "leave it out or choose another --out",
) -> None:
    """Refuse an option whose value differs from the one that the training began with.

    Parameters
    ----------
    ctx : Context
        Of the command, for the options that were given.
    there : mapping
        Values of a checkpoint, by the names of the options.
    trained_on : collection of str
        Its scenarios.
    names : tuple of str
        Scenarios that were given.
    file : Path
        The checkpoint.
    instead : str
        What to do, for the message.

    Raises
    ------
    ConfigError
        The message names the option and both values.
    """
    if names and set(names) != set(trained_on):
        known = ", ".join(trained_on)
        raise ConfigError(f"{file} was trained on {known}, not on {', '.join(names)}; choose another --out")
    for key, value in ctx.params.items():
        given = ctx.get_parameter_source(key) is ParameterSource.COMMANDLINE
        if given and key in there and not math.isclose(there[key], value):
            flag = "--" + key.replace("_", "-")
            text = f"has {flag} {there[key]}, not {value}; {instead}"
            raise ConfigError(f"{file} {text}")


def run_shown(
    trainer: "Trainee",
    out: Path,
    *,
    step: Callable[[], float],
    validate: Callable[[], object],
    about: Mapping[str, str],
    until: int | None,
) -> None:
    """Run a training with a bar of progress; see `training.run.train`."""
    from hybridmpm.training import run  # noqa: PLC0415 - needs torch

    with progress("Training", trainer.last_step) as bar:
        bar.update(trainer.step_count)

        def show(loss: float) -> None:
            if sys.stderr.isatty():
                bar.label = f"Training, loss {loss:.4f}"
            bar.update(1)

        run.train(
            trainer,
            out,
            step=step,
            validate=validate,
            about=about,
            rhythm=run.Rhythm(),
            on_step=show,
            until=until,
        )
