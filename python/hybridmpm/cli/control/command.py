"""`hybridmpm control`: lead a scene along a sketch, and write what comes of it."""

import json
from pathlib import Path
from typing import Any, get_args

import click
import numpy as np

from hybridmpm import export, scenarios
from hybridmpm.cli.options import check_targets, seed_option, targets_option, threads_option
from hybridmpm.cli.progress import CountedProgress, progress
from hybridmpm.control import (
    METHODS,
    ControlledTrajectory,
    Following,
    Sketch,
    follow,
    parse_png,
    parse_strokes,
)
from hybridmpm.control.goal.region import Fill
from hybridmpm.errors import ConfigError, SketchError
from hybridmpm.mpm import MpmSolver
from hybridmpm.recording import Recording
from hybridmpm.scene import Scene


@click.command()
@click.argument("scene", metavar="SCENE")
@seed_option
@click.option(
    "--start",
    type=click.IntRange(0, 1_000_000),
    default=0,
    show_default=True,
    help="Number of frames that are simulated before the sketch begins.",
)
@click.option(
    "--sketch",
    "sketch_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    required=True,
    help="Sketch, .png or .json; see above.",
)
@click.option(
    "--method",
    type=click.Choice(["auto", *METHODS]),
    default="auto",
    show_default=True,
    help="Way to follow the sketch: guidance without weights (analytic), the paper's constant force "
    "(constant), towards where the fluid may have come from (backcast), a search on a coarse simulation "
    "(shooting), or no force (none).",
)
@click.option(
    "--frames",
    type=click.IntRange(1, 10_000),
    help="Number of frames in which the goal is to be reached. Default: from what the goal needs.",
)
@click.option(
    "--cap",
    type=float,
    default=15.0,
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
    help="What becomes of an oval larger than the fluid: it is filled evenly (even), or shrunk to the "
    "fluid's volume (shrink).",
)
@click.option(
    "--budget",
    type=float,
    help="Time for which shooting may search, in seconds. With it, auto may choose shooting.",
)
@threads_option
@targets_option
@click.pass_context
def control(
    ctx: click.Context,
    /,
    *,
    scene: str,
    seed: int,
    start: int,
    sketch_file: Path,
    threads: int,
    targets: tuple[Path, ...],
    **settings: Any,
) -> None:
    """Lead SCENE, a scenario or a scene file, along a sketch.

    The sketch is a PNG of a red arrow or a green outline on white, or a JSON file such as {"strokes":
    [{"points": [[0.3, 0.3], [0.6, 0.5]], "kind": "arrow"}]} with points in metres.

    Tells what the sketch needs and what was reached. The exit status is 1 where the goal is not reached.

    The suffix of each --out FILE decides its content: .npz has positions and forces of all frames, .gif or
    .mp4 a film, .png a picture of the last state, .ply or .vtp the particles of the last state.
    """
    check_targets(targets)
    sketch = _sketch(sketch_file)
    chosen = scenarios.get(scene, seed) if scene in scenarios.NAMES else _scene(scene)
    solver = MpmSolver(chosen, threads=threads)
    with progress(f"Simulating {start} frames", start) as bar:
        for _ in range(start):
            solver.advance(1)
            bar.update(1)
    following = follow(solver, sketch, **settings)
    guidance = following.guidance
    click.echo(f"method {guidance.method}: {guidance.reason}")
    click.echo(f"needs {guidance.needs()}")
    velocities = [following.placed(solver.velocities)]
    with progress(f"Following {guidance.total_frames} frames", guidance.total_frames) as bar:
        for _ in following:
            velocities.append(following.placed(solver.velocities))
            bar.update(1)
    result = following.result
    click.echo(f"reached {result.reached}")
    for target in targets:
        _write(target, following, result, np.stack(velocities))
    if not result.reached.goal:
        ctx.exit(1)


def _scene(name: str) -> Scene:
    if not Path(name).is_file():
        raise click.UsageError(
            f"SCENE must be a scene file or one of {', '.join(scenarios.NAMES)}, got {name!r}."
        )
    return Scene.load(Path(name))


def _sketch(file: Path) -> Sketch:
    """Read a sketch.

    Raises
    ------
    SketchError
        The file holds none; the message names it.
    """
    data = file.read_bytes()
    try:
        if file.suffix.lower() != ".json":
            return parse_png(data)
        try:
            content = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise SketchError(f"is not JSON: {error}") from None
        if not isinstance(content, dict) or set(content) != {"strokes"}:
            raise SketchError('must be an object {"strokes": [one stroke]}')
        return parse_strokes(content["strokes"])
    except ConfigError as error:
        raise SketchError(f"{file}: {error}") from error


def _write(target: Path, following: Following, result: ControlledTrajectory, velocities: Any) -> None:
    if target.suffix == ".npz":
        arrays = {
            name: getattr(result, name)
            for name in ("ids", "positions", "force", "mean_force", "centroids", "displacement")
        }
        np.savez_compressed(target, first_frame=result.first_frame, **arrays)
        click.echo(f"wrote {target}")
        return
    simulator = following.simulator
    known = np.isin(simulator.ids, result.ids)
    recording = Recording(
        scene=simulator.scene,
        ids=simulator.ids[known],
        types=simulator.materials[known],
        mass=simulator.mass[known],
        frames=result.first_frame + np.arange(result.frames + 1),
        positions=result.positions[:, np.isin(result.ids, simulator.ids)],
        velocities=velocities[:, np.isin(result.ids, simulator.ids)],
    )
    with progress(f"Writing {target.name}", CountedProgress.STEPS) as bar:
        files = export.save(target, recording, export.Style(), on_progress=CountedProgress(bar))
        bar.finish()
    click.echo(f"wrote {files[0]}" + (f" to {files[-1].name}" if len(files) > 1 else ""))
