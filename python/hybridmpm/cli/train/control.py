"""`hybridmpm train control`: train the network of learned control."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from hybridmpm.cli.train.common import (
    continued,
    dataset_option,
    device_option,
    make_missing,
    run_shown,
    scenes_option,
    settings_of,
    sources_of,
    splits_of,
    torch_device,
    training_options,
    valid_option,
)
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.training.settings import TransportSettings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hybridmpm.training.control.transport.beginning import Beginning
    from hybridmpm.training.control.transport.trainer import TransportTrainer
    from hybridmpm.training.devices import Device
    from hybridmpm.training.sources import Source


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
    dataset_option,
    device_option,
    finetune="Checkpoint, .onnx file or name of a network of the library, with whose shape and weights this "
    "training begins.",
)
@click.pass_context
def control(ctx: click.Context, /, *, threads: int | None, **options: Any) -> None:
    """Train the network of the control method "learned".

    Forward runs show where the particles of a fluid came from; the network learns to predict that from a
    state and a sketch. A data set must be one of `hybridmpm dataset generate --control`. Samples are made by
    a second process. After an interruption the same command continues from the last checkpoint in the folder
    --out, and gives the weights of an uninterrupted run. The folder also gets the losses, and errors on
    held-out scenes.
    """
    device = torch_device(options["device"], threads)
    from hybridmpm.training.control import pasts  # noqa: PLC0415 - needs torch
    from hybridmpm.training.control.transport.beginning import Beginning  # noqa: PLC0415
    from hybridmpm.training.control.transport.supply import Stock, Supply, pasts_of  # noqa: PLC0415
    from hybridmpm.training.control.transport.trainer import (  # noqa: PLC0415
        TransportTrainer,
        held_out,
        log_unexplained,
    )
    from hybridmpm.training.control.transport.windows import check_frame, check_pasts  # noqa: PLC0415
    from hybridmpm.training.sources import Drawn  # noqa: PLC0415

    root, (training, validation) = options["root"], splits_of(options)
    trainer = continued(ctx, partial(TransportTrainer.load, device=device))
    beginning = None if options["finetune"] is None else Beginning.read(options["finetune"])
    older = trainer.spec if trainer else beginning.spec if beginning else None
    sources = sources_of(options, older)
    trainer = trainer or _new(sources, options, beginning, device)
    spec = trainer.spec
    if drawn := [source for source in sources if isinstance(source, Drawn)]:
        check_frame(spec.trained_on.frame_dt, shortest=spec.shortest, longest=spec.longest)
    make_missing(root, drawn, (training, validation), pasts.prepare)
    groups = {source.label: pasts_of(root, source, validation, "valid") for source in sources}
    for group in groups.values():
        check_pasts(group, shortest=spec.shortest, longest=spec.longest)
    stock = Stock(root, sources, training, spec, trainer.settings)
    with Supply(stock, trainer.step_count) as supply:
        run_shown(
            trainer,
            ctx,
            step=lambda: trainer.step(*supply.take()),
            validate=partial(log_unexplained, trainer, options["out"], held_out(groups, spec)),
            device=device,
            data=f"{len(training)} scenes of each of {', '.join(spec.scenarios)}, seeds from 0"
            if len(drawn) == len(sources)
            else ", ".join(spec.scenarios),
            before=None if beginning is None else beginning.origin,
        )


def _new(
    sources: "Sequence[Source]", options: dict[str, Any], beginning: "Beginning | None", device: "Device"
) -> "TransportTrainer":
    """Return a new trainer; with a beginning, one with its network and weights."""
    from hybridmpm.training.control.transport.trainer import TransportTrainer  # noqa: PLC0415 - needs torch
    from hybridmpm.training.sources import DataSet, described  # noqa: PLC0415

    settings = settings_of(TransportSettings, options)
    scenes = described(sources)
    times = [
        (source.seconds,) if isinstance(source, DataSet) else (TransportSpec.shortest, TransportSpec.longest)
        for source in sources
    ]
    scenes |= {"shortest": min(one[0] for one in times), "longest": max(one[-1] for one in times)}
    if beginning is None:
        return TransportTrainer(TransportSpec(**scenes, width=options["width"]), settings, device)
    spec = dataclasses.replace(beginning.spec, **scenes)
    trainer = TransportTrainer(spec, settings, device)
    trainer.begin_with(beginning.weights_for(spec, str(options["finetune"])))
    return trainer
