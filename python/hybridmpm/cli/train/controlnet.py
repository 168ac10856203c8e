"""`hybridmpm train controlnet`: train the Fluid ControlNet of the paper."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from hybridmpm.cli.train.common import (
    continued,
    dataset_option,
    make_missing,
    origin_of,
    run_shown,
    scenes_option,
    settings_of,
    sources_of,
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
    dataset_option,
)
@click.pass_context
def controlnet(ctx: click.Context, /, *, threads: int | None, **options: Any) -> None:
    """Train the network of the control method "controlnet", on the CPU.

    It learns the forces that lead a fluid back to where it was 100 frames before, given a sketch of that
    state. A data set must be one of `hybridmpm dataset generate --control`, with 100 frames. After an
    interruption the same command continues from the last checkpoint in the folder --out, and gives the
    weights of an uninterrupted run. The folder also gets the losses, and errors on held-out scenes.
    """
    device = torch_device("cpu", threads)
    from hybridmpm.training.control.controlnet import cases  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.controlnet.trainer import (  # noqa: PLC0415
        ControlNetTrainer,
        log_unexplained,
    )
    from hybridmpm.training.sources import Drawn, described  # noqa: PLC0415

    root, (training, validation) = options["root"], splits_of(options)
    trainer = continued(ctx, ControlNetTrainer.load)
    older = None if trainer or options["finetune"] is None else ControlNetTrainer.load(options["finetune"])
    before = trainer or older
    sources = sources_of(options, before and before.spec)
    scenes = described(sources)
    drawn = [source for source in sources if isinstance(source, Drawn)]
    make_missing(root, drawn, (training, validation), cases.prepare)
    found = [case for source in sources for case in cases.read(root, source, training, "train")]
    held_out = {source.label: cases.read(root, source, validation, "valid") for source in sources}
    trainer = trainer or _new(scenes, options, found, older)
    run_shown(
        trainer,
        ctx,
        step=partial(trainer.step, found),
        validate=partial(log_unexplained, trainer, options["out"], held_out),
        device=device,
        data=f"{len(found)} reversed cases of {len(training)} scenes of each of {', '.join(held_out)}"
        if drawn
        else f"{len(found)} examples of {', '.join(held_out)}",
        before=origin_of(options["finetune"]),
    )


def _new(
    scenes: dict[str, Any], options: dict[str, Any], found: list[Any], older: "ControlNetTrainer | None"
) -> "ControlNetTrainer":
    """Return a new trainer, with the network and the averaged weights of an older one, if any."""
    from hybridmpm.training.control.controlnet.trainer import ControlNetTrainer  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.controlnet.windows import scale_of  # noqa: PLC0415

    settings = settings_of(ControlNetSettings, options)
    if older is not None:
        spec = dataclasses.replace(older.spec, **scenes)
        trainer = ControlNetTrainer(spec, settings, older.scale)
        trainer.begin_with(older.average.state_dict())
        return trainer
    spec = NetworkSpec(
        **scenes,
        latent=options["latent"],
        layers=options["layers"],
        hidden_layers=1,
        radius=1.0,
    )
    spec = dataclasses.replace(spec, radius=_NODE_RADIUS[spec.dim])
    return ControlNetTrainer(spec, settings, scale_of(found))
