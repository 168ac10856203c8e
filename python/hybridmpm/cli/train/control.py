"""`hybridmpm train control`: train the network of learned control."""

import dataclasses
import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hybridmpm import scenarios
from hybridmpm.cli.devices import device_option, require_torch, torch_device
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
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.data.splits import FIRST_VALID

if TYPE_CHECKING:
    import torch

    from hybridmpm.training.control.transport.trainer import TransportTrainer


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
    default=Path("data/pasts"),
    show_default=True,
    metavar="FOLDER",
    help="Folder of forward runs; a missing run is made from its seed.",
)
@scenes_option
@valid_option
@click.option(
    "--width",
    type=click.IntRange(4, 256),
    default=24,
    show_default=True,
    help="Channels of the network on its finest cells, a multiple of 4.",
)
@click.option(
    "--steps",
    type=click.IntRange(min=1),
    default=15_000,
    show_default=True,
    help="Number of training steps.",
)
@until_option
@click.option(
    "--batch",
    type=click.IntRange(1, 4096),
    default=16,
    show_default=True,
    help="Number of samples in a training step.",
)
@click.option(
    "--particles",
    type=click.IntRange(1, 4096),
    default=256,
    show_default=True,
    help="Number of particles of a sample whose ends are predicted.",
)
@click.option(
    "--flow",
    type=click.FloatRange(0, 1),
    default=0.7,
    show_default=True,
    help="Share of the samples on the way from noise to data; 0 trains for one evaluation alone.",
)
@click.option(
    "--spread",
    type=click.FloatRange(0, 100),
    default=0.0,
    show_default=True,
    help="Weight of the covariance of all ends in the loss, which keeps them from lying too close together.",
)
@click.option(
    "--bfloat16/--float32",
    default=False,
    help="Compute with numbers of 16 bits, which is quicker on processors that have such instructions.",
)
@learning_rate_option(1.5e-3)
@final_rate_option
@seed_option
@device_option
@threads_option
@finetune_option
@click.pass_context
def control(
    ctx: click.Context, /, *, names: tuple[str, ...], out: Path, threads: int | None, **options: Any
) -> None:
    """Train the network of the control method "learned".

    It learns from forward runs where the particles of a fluid came from, given what a sketch says of that.
    Samples are made by a process of their own, so training takes a second core. After an interruption the
    same command goes on from the last checkpoint in the folder --out, and gives the weights of an
    uninterrupted run. The folder also gets the losses, and errors on held-out scenes.
    """
    torch = require_torch()
    from hybridmpm.training import run  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control import pasts  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.transport.supply import Source, Supply  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.transport.trainer import TransportTrainer  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.transport.validation import held_out, log_unexplained  # noqa: PLC0415 - needs torch

    if threads is not None:
        torch.set_num_threads(threads)
    device = torch_device(torch, options["device"])
    file = out / run.CHECKPOINT
    out.mkdir(parents=True, exist_ok=True)
    if file.exists():
        trainer = TransportTrainer.load(file, device)
        there = {**dataclasses.asdict(trainer.spec), **dataclasses.asdict(trainer.settings)}
        refuse_other_options(ctx, there, trainer.spec.scenarios, names, file)
        about = told_before(file)
    else:
        trainer = _new(_spec(names, options), options, device)
        about = {**origin(of_checkpoint(options["finetune"])), "machine": machine_of(device)}
    # A later run may have more scenes.
    kinds = ", ".join(trainer.spec.scenarios)
    about["data"] = f"{options['scenes']} scenes of each of {kinds}, seeds from 0"
    training = range(options["scenes"])
    validation = range(FIRST_VALID, FIRST_VALID + options["valid"])
    make_missing(options["root"], trainer.spec.scenarios, (training, validation), pasts.prepare)
    groups = {name: pasts.read(options["root"], name, validation) for name in trainer.spec.scenarios}
    weights = sum(weight.numel() for weight in trainer.network.parameters())
    click.echo(f"{weights} parameters, {about['data']}, on {device}", err=True)
    source = Source(options["root"], training, trainer.spec, trainer.settings)
    with Supply(source, trainer.step_count) as supply:
        run_shown(
            trainer,
            out,
            step=lambda: trainer.step(*supply.take()),
            validate=partial(log_unexplained, trainer, out, held_out(groups, trainer.spec)),
            about=about,
            until=options["until"],
        )
    click.echo(f"wrote {file}, and losses and errors on held-out scenes beside it")


def _spec(names: tuple[str, ...], options: dict[str, Any]) -> TransportSpec:
    """Return the description of the network: that of the checkpoint to finetune, else by the options."""
    if options["finetune"] is not None:
        from hybridmpm.training import checkpoint  # noqa: PLC0415 - needs torch

        older = json.loads(checkpoint.read(options["finetune"])["spec"])
        spec = TransportSpec.from_dict(older, where=str(options["finetune"]))
        return dataclasses.replace(spec, scenarios=names or spec.scenarios)
    if not names:
        raise click.UsageError(f"Give at least one --scenario ({', '.join(scenarios.NAMES)}).")
    return TransportSpec(scenarios=names, width=options["width"])


def _new(spec: TransportSpec, options: dict[str, Any], device: "torch.device") -> "TransportTrainer":
    """Return a new trainer; with a checkpoint to finetune, one that has its averaged weights."""
    from hybridmpm.training.control.transport.trainer import (  # noqa: PLC0415 - needs torch
        TransportSettings,
        TransportTrainer,
    )

    fields = (field.name for field in dataclasses.fields(TransportSettings))
    trainer = TransportTrainer(spec, TransportSettings(**{name: options[name] for name in fields}), device)
    if options["finetune"] is not None:
        trainer.begin_with(TransportTrainer.load(options["finetune"], device).average.state_dict())
    return trainer
