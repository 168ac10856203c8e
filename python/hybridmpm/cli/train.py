"""`hybridmpm train ...`: networks from data that their seeds make."""

import dataclasses
import json
import math
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from hybridmpm import scenarios
from hybridmpm._support.machine import cpu_model, usable_cores
from hybridmpm.cli.devices import require_torch, torch_device
from hybridmpm.cli.progress import progress
from hybridmpm.cli.types import RatioType
from hybridmpm.errors import ConfigError
from hybridmpm.physics.spec import NetworkSpec

if TYPE_CHECKING:
    import torch

    from hybridmpm.training.physics.datasets import Amount
    from hybridmpm.training.physics.trainer import Trainer

_SPACINGS = {2: 2.5, 3: 1.8}
"""Default connectivity radius in spacings: fewer neighbours than the paper's, which are what costs."""


@click.group()
def train() -> None:
    """Train networks; needs torch: pip install 'hybridmpm[train]'."""


@train.command()
@click.option(
    "--scenario",
    "names",
    type=click.Choice(scenarios.NAMES),
    multiple=True,
    help="What to learn; repeat it for one network that serves several.",
)
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, metavar="FOLDER")
@click.option(
    "--data",
    "root",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("data"),
    show_default=True,
    metavar="FOLDER",
    help="Data sets; made there from their seeds if missing.",
)
@click.option("--latent", type=click.IntRange(1, 1024), default=48, show_default=True)
@click.option("--layers", type=click.IntRange(1, 64), default=3, show_default=True, help="Message passings.")
@click.option("--hidden-layers", type=click.IntRange(1, 8), default=1, show_default=True, help="Of each MLP.")
@click.option("--radius", type=float, help="Of neighbours [m]. Default: 2.5 spacings in 2D, 1.8 in 3D.")
@click.option("--r-p", type=RatioType(), default=1 / 8, show_default="1/8", help="Ratio of particles kept.")
@click.option("--r-t", type=click.IntRange(1, 64), default=4, show_default=True, help="Frames a step.")
@click.option(
    "--relaxations",
    type=click.IntRange(0, 16),
    default=3,
    show_default=True,
    help="Of density, after each step; the paper's network has none.",
)
@click.option("--steps", type=click.IntRange(min=1), default=100_000, show_default=True)
@click.option(
    "--until",
    type=click.IntRange(min=1),
    help="Stop after this step, with the schedule of --steps; a later run goes on.",
)
@click.option("--batch", type=click.IntRange(1, 4096), default=2, show_default=True, help="Windows a step.")
@click.option(
    "--unroll",
    type=click.IntRange(1, 32),
    default=3,
    show_default=True,
    help="Network steps that the loss follows in the end.",
)
@click.option(
    "--noise",
    type=click.FloatRange(0, 1),
    default=0.1,
    show_default=True,
    help="On the inputs, over the velocity's standard deviation.",
)
@click.option("--learning-rate", type=float, default=1e-3, show_default=True)
@click.option("--final-rate", type=float, default=3e-5, show_default=True, help="It decays exponentially.")
@click.option(
    "--trajectories",
    type=click.IntRange(1, 100_000),
    default=200,
    show_default=True,
    help="Of each scenario.",
)
@click.option("--frames", type=click.IntRange(min=1), default=400, show_default=True, help="Of a trajectory.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)
@click.option(
    "--device", default="auto", show_default=True, help="cpu, cuda, or auto: cuda where there is one."
)
@click.option("--threads", type=click.IntRange(1, 1024), help="Of torch on the CPU. Default: torch's choice.")
@click.option(
    "--finetune",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="CHECKPOINT",
    help="Begin with these weights, whose network it takes over.",
)
@click.pass_context
def physics(
    ctx: click.Context, /, *, names: tuple[str, ...], out: Path, threads: int | None, **options: Any
) -> None:
    """Train a learned simulator on SCENARIO.

    The same command goes on from the last checkpoint in the folder, and gives the weights that an
    uninterrupted run does. Losses and rollouts on held-out scenes are logged there.
    """
    torch = require_torch()
    from hybridmpm.training import checkpoint, run  # noqa: PLC0415 - needs torch
    from hybridmpm.training.physics import datasets  # noqa: PLC0415 - needs torch

    if threads is not None:
        torch.set_num_threads(threads)
    device = torch_device(torch, options["device"])
    amount = datasets.Amount(train=options["trajectories"], frames=options["frames"])
    file = out / run.CHECKPOINT
    out.mkdir(parents=True, exist_ok=True)
    if file.exists():
        trainer = checkpoint.load(file, device)
        _refuse_other_options(ctx, trainer, names, options, file)
        about = dict(checkpoint.read(file)["about"])
        _make_data(options["root"], trainer.spec, amount)
    else:
        spec = _spec(names, options)
        _make_data(options["root"], spec, amount)
        trainer = _new(spec, options, device)
        about = {
            **_origin(options["finetune"]),
            "data": _described(spec, amount),
            "machine": f"{cpu_model()}, {usable_cores()} cores" if device.type == "cpu" else str(device),
        }
    training = datasets.trajectories(options["root"], trainer.spec, "train")
    held_out = list(datasets.held_out(options["root"], trainer.spec))
    weights = sum(weight.numel() for weight in trainer.simulator.parameters())
    click.echo(f"{weights} parameters, {len(training)} trajectories, on {device}", err=True)
    with progress("Training", trainer.settings.steps) as bar:
        bar.update(trainer.step_count)

        def show(_trainer: "Trainer", loss: float) -> None:
            if sys.stderr.isatty():
                bar.label = f"Training, loss {loss:.4f}"
            bar.update(1)

        run.train(
            trainer,
            out,
            training,
            held_out,
            about=about,
            rhythm=run.Rhythm(),
            on_step=show,
            until=options["until"],
        )
    click.echo(f"wrote {file}, and losses and rollouts beside it")


def _origin(finetuned: Path | None) -> dict[str, str]:
    """Return what makes these weights: this command, after that of the weights it begins with."""
    this = shlex.join(["hybridmpm", *sys.argv[1:]])
    if finetuned is None:
        return {"command": this}
    from hybridmpm.training import checkpoint  # noqa: PLC0415 - needs torch

    older = checkpoint.read(finetuned)
    steps, seconds = checkpoint.spent(older)
    return {
        "command": f"{older['about']['command']} --until {older['step']}; {this}",
        "steps_before": str(steps),
        "seconds_before": f"{seconds:.1f}",
    }


def _spec(names: tuple[str, ...], options: dict[str, Any]) -> NetworkSpec:
    """Build the network's description; a network to finetune gives its own, but for the scenarios."""
    if options["finetune"] is not None:
        from hybridmpm.training import checkpoint  # noqa: PLC0415 - needs torch

        older = checkpoint.read(options["finetune"])
        spec = NetworkSpec.from_dict(json.loads(older["spec"]), where=str(options["finetune"]))
        return dataclasses.replace(spec, scenarios=names or spec.scenarios)
    if not names:
        raise click.UsageError(f"Give at least one --scenario ({', '.join(scenarios.NAMES)}).")
    shape = {key: options[key] for key in ("latent", "layers", "hidden_layers", "r_p", "r_t", "relaxations")}
    radius = options["radius"]
    if radius is None:
        bare = NetworkSpec(scenarios=names, radius=1.0, **shape)
        radius = round(_SPACINGS[bare.dim] * bare.spacing, 6)
    return NetworkSpec(scenarios=names, radius=radius, **shape)


def _new(spec: NetworkSpec, options: dict[str, Any], device: "torch.device") -> "Trainer":
    """Begin a training; a network to finetune keeps its scales, which its weights were made for."""
    from hybridmpm.training import checkpoint  # noqa: PLC0415 - needs torch
    from hybridmpm.training.physics import datasets  # noqa: PLC0415 - needs torch
    from hybridmpm.training.physics.scales import normalization  # noqa: PLC0415
    from hybridmpm.training.physics.trainer import Trainer, TrainingSettings  # noqa: PLC0415

    fields = (field.name for field in dataclasses.fields(TrainingSettings))
    settings = TrainingSettings(**{name: options[name] for name in fields})
    if options["finetune"] is None:
        training = datasets.trajectories(options["root"], spec, "train")
        return Trainer(spec, normalization(training, spec, settings.noise), settings, device)
    older = checkpoint.load(options["finetune"], device)
    trainer = Trainer(spec, older.simulator.scales, settings, device)
    trainer.simulator.load_state_dict(older.simulator.state_dict())
    return trainer


def _make_data(root: Path, spec: NetworkSpec, amount: "Amount") -> None:
    from hybridmpm.training.physics import datasets  # noqa: PLC0415 - needs torch

    for scenario in spec.scenarios:
        one = dataclasses.replace(spec, scenarios=(scenario,))
        missing = datasets.missing(root, one, amount)
        if missing:
            with progress(f"Simulating {scenario}", missing) as bar:
                datasets.prepare(root, one, amount, bar.update)


def _described(spec: NetworkSpec, amount: "Amount") -> str:
    kinds = ", ".join(spec.scenarios)
    return f"{amount.train} trajectories of {amount.frames} frames of each of {kinds}, seeds from 0"


def _refuse_other_options(
    ctx: click.Context, trainer: "Trainer", names: tuple[str, ...], options: dict[str, Any], file: Path
) -> None:
    """Refuse an option that differs from what the run began with."""
    there = {**dataclasses.asdict(trainer.spec), **dataclasses.asdict(trainer.settings), "scenarios": names}
    if names and set(names) != set(trainer.spec.scenarios):
        known = ", ".join(trainer.spec.scenarios)
        raise ConfigError(f"{file} was trained on {known}, not on {', '.join(names)}; choose another --out")
    for key, value in options.items():
        given = ctx.get_parameter_source(key) is ParameterSource.COMMANDLINE
        if given and key in there and not math.isclose(there[key], value):
            flag = "--" + key.replace("_", "-")
            text = f"has {flag} {there[key]}, not {value}; leave it out or choose another --out"
            raise ConfigError(f"{file} {text}")
