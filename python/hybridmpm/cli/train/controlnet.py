"""`hybridmpm train controlnet`: train the Fluid ControlNet of the paper."""

import dataclasses
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hybridmpm import scenarios
from hybridmpm.cli.devices import require_torch
from hybridmpm.cli.train.begun import (
    final_rate_option,
    finetune_option,
    learning_rate_option,
    machine_of,
    make_missing,
    of_checkpoint,
    origin,
    out_option,
    refuse_other_options,
    run_shown,
    scenes_option,
    seed_option,
    threads_option,
    told_before,
    until_option,
    valid_option,
)
from hybridmpm.data.splits import FIRST_VALID
from hybridmpm.physics.spec import NetworkSpec

if TYPE_CHECKING:
    from hybridmpm.training.control.controlnet.trainer import ControlNetTrainer

_NODE_RADIUS = {2: 0.06, 3: 0.15}
"""Connectivity radius of control nodes by dimension [m]: of about 15 neighbours in fluid at rest."""


@click.command()
@click.option(
    "--scenario",
    "names",
    type=click.Choice(scenarios.NAMES),
    multiple=True,
    help="Scenario to train on, without obstacles; may be repeated for a network that serves several.",
)
@out_option
@click.option(
    "--data",
    "root",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("data/nodes"),
    show_default=True,
    metavar="FOLDER",
    help="Folder of reversed cases; a missing case is made from its seed.",
)
@scenes_option
@valid_option
@click.option(
    "--latent", type=click.IntRange(1, 1024), default=48, show_default=True, help="Width of the network."
)
@click.option(
    "--layers", type=click.IntRange(1, 64), default=4, show_default=True, help="Message-passing layers."
)
@click.option(
    "--steps", type=click.IntRange(min=1), default=15_000, show_default=True, help="Number of training steps."
)
@until_option
@click.option(
    "--batch",
    type=click.IntRange(1, 4096),
    default=8,
    show_default=True,
    help="Number of samples in a training step.",
)
@learning_rate_option(1e-3)
@final_rate_option
@seed_option
@threads_option
@finetune_option
@click.pass_context
def controlnet(
    ctx: click.Context, /, *, names: tuple[str, ...], out: Path, threads: int | None, **options: Any
) -> None:
    """Train the network of the control method "controlnet", on the CPU.

    It learns the forces that lead a fluid back to where it was 100 frames before, given the sketch that
    stands for that. After an interruption the same command goes on from the last checkpoint in the folder
    --out, and gives the weights of an uninterrupted run. The folder also gets the losses, and errors on
    held-out scenes.
    """
    torch = require_torch()
    from hybridmpm.training import run  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.controlnet import cases  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.controlnet.trainer import ControlNetTrainer  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.controlnet.validation import log_unexplained  # noqa: PLC0415

    if threads is not None:
        torch.set_num_threads(threads)
    file = out / run.CHECKPOINT
    out.mkdir(parents=True, exist_ok=True)
    begun = ControlNetTrainer.load(file) if file.exists() else None
    if begun is not None:
        there = {**dataclasses.asdict(begun.spec), **dataclasses.asdict(begun.settings)}
        refuse_other_options(ctx, there, begun.spec.scenarios, names, file)
        names = begun.spec.scenarios
    elif options["finetune"] is not None:
        names = names or ControlNetTrainer.load(options["finetune"]).spec.scenarios
    elif not names:
        raise click.UsageError(f"Give at least one --scenario ({', '.join(scenarios.NAMES)}).")
    training = range(options["scenes"])
    validation = range(FIRST_VALID, FIRST_VALID + options["valid"])
    make_missing(options["root"], names, (training, validation), cases.prepare)
    found = [case for name in names for case in cases.read(options["root"], name, training)]
    held_out = {name: cases.read(options["root"], name, validation) for name in names}
    trainer = begun or _new(names, options, found)
    about = (
        told_before(file)
        if begun is not None
        else {
            **origin(of_checkpoint(options["finetune"])),
            "data": f"reversed cases of {options['scenes']} scenes of each of {', '.join(names)}",
            "machine": machine_of(torch.device("cpu")),
        }
    )
    weights = sum(weight.numel() for weight in trainer.network.parameters())
    click.echo(f"{weights} parameters, {len(found)} cases", err=True)
    run_shown(
        trainer,
        out,
        step=partial(trainer.step, found),
        validate=partial(log_unexplained, trainer, out, held_out),
        about=about,
        until=options["until"],
    )
    click.echo(f"wrote {file}, and losses and errors on held-out scenes beside it")


def _new(names: tuple[str, ...], options: dict[str, Any], found: list[Any]) -> "ControlNetTrainer":
    """Return a new trainer; with a checkpoint to finetune, one that has its averaged weights and its size."""
    from hybridmpm.training.control.controlnet.trainer import (  # noqa: PLC0415 - needs torch
        ControlNetSettings,
        ControlNetTrainer,
    )
    from hybridmpm.training.control.controlnet.windows import scale_of  # noqa: PLC0415 - needs torch

    fields = (field.name for field in dataclasses.fields(ControlNetSettings))
    settings = ControlNetSettings(**{name: options[name] for name in fields})
    if options["finetune"] is not None:
        older = ControlNetTrainer.load(options["finetune"])
        spec = dataclasses.replace(older.spec, scenarios=names)
        trainer = ControlNetTrainer(spec, settings, older.scale)
        trainer.begin_with(older.average.state_dict())
        return trainer
    spec = NetworkSpec(
        scenarios=names,
        latent=options["latent"],
        layers=options["layers"],
        hidden_layers=1,
        radius=_NODE_RADIUS[scenarios.get(names[0], 0).dim],
    )
    return ControlNetTrainer(spec, settings, scale_of(found))
