"""`hybridmpm train physics`: train a learned simulator on data sets, which are made where missing."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from hybridmpm.cli.options import RatioType
from hybridmpm.cli.progress import progress
from hybridmpm.cli.train.common import (
    continued,
    dataset_option,
    device_option,
    is_given,
    refuse_other_options,
    run_shown,
    settings_of,
    sources_of,
    torch_device,
    training_options,
)
from hybridmpm.errors import ConfigError
from hybridmpm.physics.spec import GRID_CELLS, RADIUS_SPACINGS, NetworkSpec
from hybridmpm.training.settings import TrainingSettings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hybridmpm.training.devices import Device
    from hybridmpm.training.physics.beginning import Beginning
    from hybridmpm.training.physics.trainer import Trainer
    from hybridmpm.training.sources import Source

_SHAPE = ("latent", "layers", "hidden_layers", "radius", "r_p", "r_t", "grid_cells")
"""Options that weights are made for."""
_CELLS = {2: 32, 3: 0}
"""Default number of cells of the grid branch along an axis, by dimension. In 3D the branch takes time and
does not lower the error (docs/results/hybrid.md)."""


@click.command()
@training_options(
    TrainingSettings,
    "data",
    "Folder of the data sets; a missing data set is made from its seeds.",
    click.option(
        "--latent",
        type=click.IntRange(1, 1024),
        default=48,
        show_default=True,
        help="Width of the network's latent vectors.",
    ),
    click.option(
        "--layers",
        type=click.IntRange(1, 64),
        default=3,
        show_default=True,
        help="Number of message-passing layers.",
    ),
    click.option(
        "--hidden-layers",
        type=click.IntRange(1, 8),
        default=1,
        show_default=True,
        help="Number of hidden layers of each perceptron.",
    ),
    click.option(
        "--radius",
        type=float,
        help="Largest distance of neighbours [m]. Default: 2.5 spacings in 2D, 1.8 in 3D.",
    ),
    click.option(
        "--r-p",
        type=RatioType(),
        default=1 / 8,
        show_default="1/8",
        help="Number of particles over that of the scene.",
    ),
    click.option(
        "--r-t",
        type=click.IntRange(1, 64),
        default=4,
        show_default=True,
        help="Number of frames in a step of the network.",
    ),
    click.option(
        "--grid-cells",
        type=click.IntRange(0, GRID_CELLS[1]),
        help="Number of cells along each axis of a grid by which far particles act on each other; 0 is "
        "without, as in the paper. Default: 32 in 2D, 0 in 3D.",
    ),
    click.option(
        "--trajectories",
        type=click.IntRange(1, 100_000),
        default=200,
        show_default=True,
        help="Number of trajectories of each scenario for training.",
    ),
    click.option(
        "--frames",
        type=click.IntRange(min=1),
        default=400,
        show_default=True,
        help="Number of frames of a trajectory.",
    ),
    dataset_option,
    device_option,
    finetune="Checkpoint, .onnx file or name of a network of the library, whose weights, shape and scales "
    "this training begins with.",
)
@click.pass_context
def physics(ctx: click.Context, /, *, threads: int | None, **options: Any) -> None:
    """Train a learned simulator on scenarios, on scenes of your own, or on data sets.

    After an interruption the same command continues from the last checkpoint in the folder --out, and gives
    the weights of an uninterrupted run. The folder also gets the losses, and rollouts on held-out scenes.
    The number of particles and of frames in a step of a data set are those of the network, if --r-p and --r-t
    are absent; with fewer frames in its states, --r-t may be a multiple of that.
    """
    device = torch_device(options["device"], threads)
    from hybridmpm.training.physics import datasets  # noqa: PLC0415 - needs torch
    from hybridmpm.training.physics.beginning import Beginning  # noqa: PLC0415
    from hybridmpm.training.physics.rollouts import log_rollouts  # noqa: PLC0415
    from hybridmpm.training.physics.scales import normalization  # noqa: PLC0415
    from hybridmpm.training.physics.trainer import Trainer  # noqa: PLC0415
    from hybridmpm.training.physics.windows import Windows  # noqa: PLC0415
    from hybridmpm.training.sources import Drawn  # noqa: PLC0415

    root, amount = options["root"], datasets.Amount(train=options["trajectories"], frames=options["frames"])
    trainer = continued(ctx, partial(Trainer.load, device=device))
    beginning = None if trainer or options["finetune"] is None else Beginning.read(options["finetune"])
    older = trainer.spec if trainer else beginning.simulator.spec if beginning else None
    sources = sources_of(options, older)
    spec = trainer.spec if trainer else _spec(ctx, sources, beginning)
    for source in sources:
        if isinstance(source, Drawn) and (missing := datasets.missing(root, source, spec, amount)):
            with progress(f"Simulating {source.label}", missing) as bar:
                datasets.prepare(root, source, spec, amount, bar.update)
    training = [one for source in sources for one in datasets.trajectories(root, source, spec, "train")]
    held_out = [next(datasets.trajectories(root, source, spec, "valid")) for source in sources]
    settings = trainer.settings if trainer else settings_of(TrainingSettings, options)
    windows = Windows(training, settings.unroll, step_dt=spec.step_dt)
    if beginning is not None:
        trainer = _finetuned(spec, beginning, settings, device)
    elif trainer is None:
        trainer = Trainer(spec, normalization(training, spec, settings.noise), settings, device)
    run_shown(
        trainer,
        ctx,
        step=partial(trainer.step, windows),
        validate=partial(log_rollouts, trainer, options["out"], held_out),
        device=device,
        data=f"{len(training)} trajectories of {', '.join(spec.scenarios)}",
        before=None if beginning is None else beginning.origin,
    )


def _spec(ctx: click.Context, sources: "Sequence[Source]", beginning: "Beginning | None") -> NetworkSpec:
    """Return the description of the network: by the options, or that of the weights it begins with."""
    from hybridmpm.training.physics import datasets  # noqa: PLC0415 - needs torch
    from hybridmpm.training.sources import DataSet, described  # noqa: PLC0415

    options = ctx.params
    scenes = described(sources)
    if beginning is not None:
        older = beginning.simulator.spec
        there = {key: getattr(older, key) for key in _SHAPE}
        refuse_other_options(ctx, there, options["finetune"], instead="leave it out or leave out --finetune")
        spec = dataclasses.replace(older, **scenes)
        if (spec.dim, spec.frame_dt) != (older.dim, older.frame_dt):
            raise ConfigError(
                f"{options['finetune']} is for {older.dim}D and frames of {older.frame_dt:g} s; the scenes "
                f"are in {spec.dim}D with frames of {spec.frame_dt:g} s: leave out --finetune"
            )
        return spec
    shape = {key: options[key] for key in _SHAPE}
    for source in sources:
        if isinstance(source, DataSet):
            r_p, stride = datasets.ratio_and_stride(source)
            if not is_given(ctx, "r_p"):
                shape["r_p"] = r_p
            if not is_given(ctx, "r_t") and shape["r_t"] % stride:
                shape["r_t"] = stride
    bare = NetworkSpec(**scenes, **shape | {"radius": 1.0, "grid_cells": 0})
    if shape["radius"] is None:
        shape["radius"] = round(RADIUS_SPACINGS[bare.dim] * bare.spacing, 6)
    if shape["grid_cells"] is None:
        shape["grid_cells"] = _CELLS[bare.dim]
    return NetworkSpec(**scenes, **shape)


def _finetuned(
    spec: NetworkSpec, beginning: "Beginning", settings: TrainingSettings, device: "Device"
) -> "Trainer":
    """Return a new trainer with the weights and scales of an older network."""
    from hybridmpm.training.physics.trainer import Trainer  # noqa: PLC0415 - needs torch

    scales = beginning.simulator.scales
    if beginning.noise > 0:
        # The other scales belong to the weights; this one says how much noise is drawn.
        noise_std = scales.noise_std * settings.noise / beginning.noise
        scales = dataclasses.replace(scales, noise_std=noise_std)
    trainer = Trainer(spec, scales, settings, device)
    trainer.simulator.load_state_dict(beginning.simulator.state_dict())
    return trainer
