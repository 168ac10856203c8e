"""`hybridmpm train controlnet`: train the Fluid ControlNet of the paper."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from hybridmpm import scenarios
from hybridmpm.cli.train.common import (
    continued,
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
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.training.settings import ControlNetSettings

if TYPE_CHECKING:
    from hybridmpm.training.control.controlnet.trainer import ControlNetTrainer

_NODE_RADIUS = {2: 0.06, 3: 0.15}
"""Connectivity radius of control nodes by dimension [m]: of about 15 neighbours in fluid at rest."""


@click.command()
@training_options(
    ControlNetSettings,
    "data/nodes",
    "Folder of reversed cases; a missing case is made from its seed.",
    scenes_option,
    valid_option,
    click.option(
        "--latent", type=click.IntRange(1, 1024), default=48, show_default=True, help="Width of the network."
    ),
    click.option(
        "--layers", type=click.IntRange(1, 64), default=4, show_default=True, help="Message-passing layers."
    ),
)
@click.pass_context
def controlnet(ctx: click.Context, /, *, names: tuple[str, ...], threads: int | None, **options: Any) -> None:
    """Train the network of the control method "controlnet", on the CPU.

    It learns the forces that lead a fluid back to where it was 100 frames before, given a sketch of that
    state. After an interruption the same command continues from the last checkpoint in the folder --out, and
    gives the weights of an uninterrupted run. The folder also gets the losses, and errors on held-out scenes.
    """
    device = torch_device("cpu", threads)
    from hybridmpm.training.control.controlnet import cases  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.controlnet.trainer import (  # noqa: PLC0415
        ControlNetTrainer,
        log_unexplained,
    )

    trainer = continued(ctx, ControlNetTrainer.load)
    older = None if options["finetune"] is None else ControlNetTrainer.load(options["finetune"])
    if (source := trainer or older) is not None:
        names = source.spec.scenarios if trainer is not None else names or source.spec.scenarios
    training, validation = splits_of(options)
    make_missing(options["root"], required(names), (training, validation), cases.prepare)
    found = [case for name in names for case in cases.read(options["root"], name, training)]
    held_out = {name: cases.read(options["root"], name, validation) for name in names}
    trainer = trainer or _new(names, options, found, older)
    run_shown(
        trainer,
        ctx,
        step=partial(trainer.step, found),
        validate=partial(log_unexplained, trainer, options["out"], held_out),
        device=device,
        data=f"{len(found)} reversed cases of {len(training)} scenes of each of {', '.join(names)}",
        before=origin_of(options["finetune"]),
    )


def _new(
    names: tuple[str, ...], options: dict[str, Any], found: list[Any], older: "ControlNetTrainer | None"
) -> "ControlNetTrainer":
    """Return a new trainer, with the network and the averaged weights of an older one, if any."""
    from hybridmpm.training.control.controlnet.trainer import ControlNetTrainer  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.controlnet.windows import scale_of  # noqa: PLC0415

    settings = settings_of(ControlNetSettings, options)
    if older is not None:
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
