"""`hybridmpm train control`: train the network of learned control."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from hybridmpm.cli.train.common import (
    continued,
    device_option,
    make_missing,
    origin_of,
    required,
    run_shown,
    scenes_option,
    settings_of,
    splits_of,
    torch_device,
    training_options,
    valid_option,
)
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.training.settings import TransportSettings

if TYPE_CHECKING:
    from hybridmpm.training.control.transport.trainer import TransportTrainer
    from hybridmpm.training.devices import Device


@click.command()
@training_options(
    TransportSettings,
    "data/pasts",
    "Folder of forward runs; a missing run is made from its seed.",
    scenes_option,
    valid_option,
    click.option(
        "--width",
        type=click.IntRange(4, 256),
        default=24,
        show_default=True,
        help="Channels of the network on its finest cells, a multiple of 4.",
    ),
    device_option,
)
@click.pass_context
def control(ctx: click.Context, /, *, names: tuple[str, ...], threads: int | None, **options: Any) -> None:
    """Train the network of the control method "learned".

    Forward runs show where the particles of a fluid came from; the network learns to predict that from a
    state and a sketch. Samples are made by a second process. After an interruption the same command continues
    from the last checkpoint in the folder --out, and gives the weights of an uninterrupted run. The folder
    also gets the losses, and errors on held-out scenes.
    """
    device = torch_device(options["device"], threads)
    from hybridmpm.training.control import pasts  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.transport.supply import Source, Supply  # noqa: PLC0415
    from hybridmpm.training.control.transport.trainer import (  # noqa: PLC0415
        TransportTrainer,
        held_out,
        log_unexplained,
    )

    trainer = continued(ctx, partial(TransportTrainer.load, device=device)) or _new(names, options, device)
    spec, (training, validation) = trainer.spec, splits_of(options)
    make_missing(options["root"], spec.scenarios, (training, validation), pasts.prepare)
    groups = {name: pasts.read(options["root"], name, validation) for name in spec.scenarios}
    with Supply(Source(options["root"], training, spec, trainer.settings), trainer.step_count) as supply:
        run_shown(
            trainer,
            ctx,
            step=lambda: trainer.step(*supply.take()),
            validate=partial(log_unexplained, trainer, options["out"], held_out(groups, spec)),
            device=device,
            data=f"{len(training)} scenes of each of {', '.join(spec.scenarios)}, seeds from 0",
            before=origin_of(options["finetune"]),
        )


def _new(names: tuple[str, ...], options: dict[str, Any], device: "Device") -> "TransportTrainer":
    """Return a new trainer; with a checkpoint to finetune, one with its network and averaged weights."""
    from hybridmpm.training.control.transport.trainer import TransportTrainer  # noqa: PLC0415 - needs torch

    settings = settings_of(TransportSettings, options)
    if options["finetune"] is None:
        return TransportTrainer(
            TransportSpec(scenarios=required(names), width=options["width"]), settings, device
        )
    older = TransportTrainer.load(options["finetune"], device)
    spec = dataclasses.replace(older.spec, scenarios=names or older.spec.scenarios)
    trainer = TransportTrainer(spec, settings, device)
    trainer.begin_with(older.average.state_dict())
    return trainer
