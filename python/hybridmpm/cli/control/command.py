"""`hybridmpm control`: let a scene follow a sketch, and write the result to files."""

from pathlib import Path
from typing import Any, get_args

import click
import numpy as np

from hybridmpm import export, scenarios, simulators
from hybridmpm._support.files import replacing
from hybridmpm.cli.control.film import ControlFilm
from hybridmpm.cli.control.run import ControlRun, run_control
from hybridmpm.cli.control.sketch_file import sketch_of
from hybridmpm.cli.options import (
    check_targets,
    model_option,
    scene_of,
    seed_option,
    solver_option,
    speed_option,
    targets_option,
    threads_option,
    width_option,
)
from hybridmpm.cli.progress import CountedProgress, progress
from hybridmpm.control import METHODS, Who
from hybridmpm.control.goal.region import Fill
from hybridmpm.control.guidance import DEFAULT_CAP
from hybridmpm.errors import SketchError
from hybridmpm.physics.load import ZERO, model_for
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind, Simulator


@click.command()
@click.argument("scene", metavar="SCENE")
@seed_option
@click.option(
    "--start",
    type=click.IntRange(0, 1_000_000),
    default=0,
    show_default=True,
    help="Number of frames before the sketch is followed.",
)
@click.option(
    "--after",
    type=click.IntRange(0, 1_000_000),
    default=0,
    show_default=True,
    help="Number of frames after those of the sketch, without force.",
)
@solver_option
@model_option
@click.option(
    "--sketch",
    "sketch_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    required=True,
    help="Sketch, a picture (.png, .jpg, .webp) or .json; see above.",
)
@click.option(
    "--method",
    type=click.Choice(["auto", *METHODS]),
    default="auto",
    show_default=True,
    help="Method of following the sketch: guidance without weights (analytic), the paper's constant force "
    "(constant), towards where a network says that the fluid may have come from (learned), the paper's "
    "generated forces (controlnet), or no force (none).",
)
@click.option(
    "--frames",
    type=click.IntRange(1, 10_000),
    help="Number of frames in which the goal is to be reached. Default: from what the goal needs.",
)
@click.option(
    "--cap",
    type=float,
    default=DEFAULT_CAP,
    show_default=True,
    help="Largest acceleration of a particle, in units of 9.81 m/s^2.",
)
@click.option(
    "--hold",
    type=click.IntRange(0, 10_000),
    default=0,
    show_default=True,
    help="Number of frames for which the goal is kept after it was reached.",
)
@click.option(
    "--fill",
    type=click.Choice(get_args(Fill)),
    default="even",
    show_default=True,
    help="Filling of an oval larger than the fluid: evenly (even), or after it is shrunk to the "
    "fluid's volume (shrink).",
)
@click.option(
    "--who",
    metavar="BODY|MATERIAL|FILE",
    help="Who is led: the index of a body, a material, or a sketch over the particles. Default: all.",
)
@threads_option
@targets_option
@width_option(640)
@speed_option
@click.option(
    "--fps",
    type=click.IntRange(1, 50),
    default=50,
    show_default=True,
    help="Pictures in a second of film; fewer make a smaller file.",
)
@click.pass_context
def control(
    ctx: click.Context,
    /,
    *,
    scene: str,
    seed: int,
    start: int,
    after: int,
    kind: Kind,
    model: str | None,
    sketch_file: Path,
    threads: int,
    targets: tuple[Path, ...],
    width: int,
    speed: float,
    fps: int,
    **settings: Any,
) -> None:
    """Let SCENE, a scenario or a scene file, follow a sketch.

    The sketch is a PNG of a red arrow or a green outline on white, or a JSON file such as {"strokes":
    [{"points": [[0.3, 0.3], [0.6, 0.5]], "kind": "arrow"}]} with points in metres. The fluid writes {"text":
    "WATER", "center": [0.5, 0.5], "height": 0.2}, and fills the dark parts of {"picture": "logo.png", ...} or
    an SVG path {"path": "M0 0 L9 0 ...", ...}; in 3D also the closed surface {"file": "torus.stl", ...}.
    {"keyframes": [{..., "frames": 120, "hold": 40}, ...]} are followed in turn.

    Prints the acceleration that the sketch needs and the goal that was reached; with --solver hybrid also the
    simulator of each frame, and why. The exit status is 1 if the goal is not reached; of a learned plan,
    which does not fill an oval, if the centre of mass is farther off than 1 % of the world's longest side.

    The suffix of each --out FILE decides its content: .npz has positions, forces and simulators of all
    frames, .gif or .mp4 a film with the sketch, .png a picture of the last state, .ply or .vtp the particles
    of the last state, .obj or .glb their surface in 3D.
    """
    style = export.Style(width=width, speed=speed, fps=fps)
    drawn_in = scene_of(scene, seed)
    check_targets(targets, style, dim=drawn_in.dim)
    sketch = sketch_of(sketch_file, drawn_in.size)
    if settings["who"] is not None:
        settings["who"] = _who(settings["who"], drawn_in.size)
    simulator = _simulator(drawn_in, scene if scene in scenarios.NAMES else None, kind, model, threads)
    network = "free fall" if model == ZERO else "the network"
    run = run_control(
        simulator, sketch, start=start, after=after, network=network, report=click.echo, settings=settings
    )
    if run.log:
        for line in run.summary():
            click.echo(line)
    for target in targets:
        _write(target, run, style)
    if not run.is_reached:
        click.echo(
            "exit status 1: the middle must be within 1 % of the world, and 95 % of the mass in a region"
        )
        ctx.exit(1)


def _simulator(scene: Scene, scenario: str | None, kind: Kind, model: str | None, threads: int) -> Simulator:
    if "model" in simulators.settings_of(kind):
        model = model_for(model, scenario)
    return simulators.make(kind, scene, model=model, threads=threads)


def _who(text: str, size: tuple[float, ...]) -> Who:
    """Return who is led, from a number, the name of a material or a file with a sketch."""
    if text.isdecimal():
        return int(text)
    if not (Path(text).suffix and Path(text).is_file()):
        return text
    if isinstance(sketch := sketch_of(Path(text), size), list):
        raise SketchError(f"{text}: one sketch chooses who is led, not several in turn")
    return sketch


def _write(target: Path, run: ControlRun, style: export.Style) -> None:
    recording, led = run.recording, run.led
    if target.suffix == ".npz":
        arrays = {name: getattr(led, name) for name in ("force", "mean_force", "centroids", "displacement")}
        with replacing(target) as part, part.open("wb") as file:
            np.savez_compressed(
                file,
                ids=recording.ids,
                frames=recording.frames,
                positions=recording.positions,
                simulated_by=np.array(run.simulated_by),
                first_frame=run.first,
                force_ids=led.ids,
                **arrays,
            )
        click.echo(f"wrote {target}")
        return
    view = None if target.suffix.lower() in export.GEOMETRY else ControlFilm(run, style.width)
    with progress(f"Writing {target.name}", CountedProgress.STEPS) as bar:
        files = export.save(target, recording, style, view=view, on_progress=CountedProgress(bar))
        bar.finish()
    click.echo(f"wrote {files[0]}" + (f" to {files[-1].name}" if len(files) > 1 else ""))
