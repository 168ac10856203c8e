"""`hybridmpm simulate`: run a scene and write recordings, pictures, films and snapshots."""

import time
from pathlib import Path

import click
import numpy as np

from hybridmpm import export, scenarios, simulators
from hybridmpm._support import signals
from hybridmpm.cli.options import (
    check_targets,
    completing,
    model_option,
    r_c_option,
    scene_in,
    seed_option,
    solver_option,
    speed_option,
    substeps_option,
    targets_option,
    threads_option,
    width_option,
)
from hybridmpm.cli.progress import CountedProgress, progress
from hybridmpm.cli.run_film import RunFilm
from hybridmpm.coarse import coarse_table
from hybridmpm.mpm import MpmSolver, Substeps
from hybridmpm.physics.load import model_for
from hybridmpm.planner import AutoSolver
from hybridmpm.playing import play
from hybridmpm.recording import Recording, record
from hybridmpm.render import View
from hybridmpm.replaying import Run
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind, Simulator

_SETTINGS = ("scenario", "scene_file", "seed", "kind", "substeps", "coarse", "budget_ms", "r_c")
"""Options for scene and settings."""


@click.command()
@click.argument("scenario", required=False, shell_complete=completing(lambda: scenarios.NAMES))
@click.option(
    "--scene",
    "scene_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Scene file, .json or .yaml, to simulate instead of a scenario.",
)
@seed_option
@click.option(
    "--resume",
    "resume_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Snapshot that --save wrote, to continue with its scene and settings.",
)
@click.option(
    "--run",
    "run_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Run that the page saved, to compute again from its start with the sketches and pushes in it.",
)
@click.option(
    "--frames",
    type=click.IntRange(0, 1_000_000),
    help="Number of frames to simulate. Default: the number that the scene suggests, less those done "
    "before --resume, or all of --run.",
)
@substeps_option("cfl")
@click.option(
    "--coarse",
    metavar="NAME",
    shell_complete=completing(lambda: coarse_table().ratios),
    help="Coarse level, such as 1/16: MPM simulates this share of the particles, and all are shown.",
)
@click.option(
    "--budget-ms",
    type=float,
    help="Keep frames within this time [ms] by changing the coarse level, for mpm; see `hybridmpm plan`.",
)
@solver_option
@model_option
@r_c_option
@threads_option
@click.option(
    "--every",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Number of frames from one recorded state to the next.",
)
@targets_option
@click.option(
    "--save",
    "save_file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="File for a snapshot of the last state, for --resume; written also after Ctrl-C, SIGTERM, SIGHUP or "
    "a failed frame.",
)
@width_option(640)
@speed_option
@click.option(
    "--text",
    "text_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Text beside the picture of an .html page, in Markdown.",
)
@click.option(
    "--strip",
    type=click.IntRange(1, 12),
    default=1,
    show_default=True,
    help="Number of states side by side in a .png, evenly spread over the run.",
)
@click.option("--surface", is_flag=True, help="Write each .ply as a surface, as .obj and .glb always are.")
@click.pass_context
def simulate(
    ctx: click.Context,
    *,
    scenario: str | None,
    scene_file: Path | None,
    seed: int,
    resume_file: Path | None,
    run_file: Path | None,
    frames: int | None,
    substeps: Substeps,
    coarse: str | None,
    budget_ms: float | None,
    kind: Kind,
    model: str | None,
    r_c: float | None,
    threads: int,
    every: int,
    targets: tuple[Path, ...],
    save_file: Path | None,
    width: int,
    speed: float,
    text_file: Path | None,
    strip: int,
    surface: bool,
) -> None:
    """Simulate SCENARIO (see `hybridmpm scenarios`) or a scene file, --resume one, or repeat a --run.

    The suffix of each --out FILE decides its content: .npz has all recorded states, .usdc their particles,
    .gif or .mp4 a film, .png a picture of the last state, .ply or .vtp the particles of the last state, .obj
    or .glb their surface in 3D. A .png, .ply, .vtp, .obj or .glb name with %04d in it stands for a series of
    numbered files, one for each recorded state. An .html is a page that plays the simulation from its first
    state in any browser.
    Without --out and --save the run is timed, and nothing of it is kept.
    """
    style = export.Style(width=width, speed=speed, strip=strip, surface=surface)
    pages, targets = _pages_and_others(targets, text_file, style)
    if save_file is not None and not save_file.parent.is_dir():
        raise click.UsageError(f"--save: the folder {save_file.parent} does not exist.")
    run = None
    if run_file is not None:
        _refuse_beside(ctx, "--run computes", ("resume_file", *_SETTINGS))
        run = Run(run_file, threads=threads)
        solver = run.simulator
        if (frames := run.last if frames is None else frames) > run.last:
            raise click.UsageError(f"--frames must be at most {run.last}, where the run ends.")
    elif resume_file is not None:
        _refuse_beside(ctx, "--resume continues", _SETTINGS)
        solver = simulators.load(resume_file, model=model, threads=threads)
    elif budget_ms is not None:
        _refuse_beside_budget(ctx)
        solver = AutoSolver(_scene(scenario, scene_file, seed), budget_ms=budget_ms, threads=threads)
    else:
        _refuse_of_others(ctx, kind)
        scene = _scene(scenario, scene_file, seed)
        settings = {
            "substeps": substeps,
            "coarse": coarse,
            "model": model,
            "r_c": r_c,
        }
        taken = simulators.settings_of(kind)
        if "model" in taken:
            if model is None and scenario is None:
                raise click.UsageError("With --scene, choose a network by --model NAME.")
            settings["model"] = model_for(model, scenario)
        given = {name: value for name, value in settings.items() if name in taken}
        solver = simulators.make(kind, scene, threads=threads, **given)
    for page in pages:
        _write_page(solver, page, scenario or (scene_file or page).stem, text_file)
    if targets or save_file is not None or not pages:
        name = scenario or "fluid"
        _run(
            solver,
            frames,
            every=every,
            targets=targets,
            save_file=save_file,
            style=style,
            name=name,
            run=run,
        )


def _run(
    solver: Simulator,
    frames: int | None,
    *,
    every: int,
    targets: tuple[Path, ...],
    save_file: Path | None,
    style: export.Style,
    name: str,
    run: Run | None,
) -> None:
    """Simulate frames, by default those that the scene suggests, and write the files."""
    check_targets(targets, style, dim=solver.dim)
    frames = max(solver.scene.frames - solver.frame, 0) if frames is None else frames
    if not any(export.needs_history(target, style) for target in targets):
        every = max(frames, 1)
    if frames and not targets and save_file is None:
        click.echo(_what_is_discarded(frames, name), err=True)

    advance = None if run is None else run.advance
    began = time.perf_counter()
    with signals.raising_at_end():
        try:
            with progress(f"Simulating {frames} frames", frames) as bar:
                recording = record(solver, frames, every=every, on_progress=bar.update, advance=advance)
        finally:
            # A signal leaves the state after the last whole frame, and a failed frame that before it.
            if save_file is not None:
                with signals.whole():
                    solver.save(save_file)
                click.echo(f"saved frame {solver.frame} to {save_file}")
    seconds = time.perf_counter() - began
    click.echo(_summary(solver, frames, seconds))
    for target in targets:
        _write(target, recording, style, None if run is None else RunFilm(run, recording, style.width))


def _pages_and_others(
    targets: tuple[Path, ...], text_file: Path | None, style: export.Style
) -> tuple[list[Path], tuple[Path, ...]]:
    """Return the files that are pages that play, and the others, which are checked."""
    pages = [target for target in targets if target.suffix.lower() in (".html", ".htm")]
    others = tuple(target for target in targets if target not in pages)
    check_targets(others, style)
    if style.surface and not any(other.suffix.lower() == ".ply" for other in others):
        raise click.UsageError("--surface is for --out FILE.ply; .obj and .glb are surfaces without it.")
    if text_file is not None and not pages:
        raise click.UsageError("--text is for a page that plays: give --out FILE.html, too.")
    return pages, others


def _write_page(solver: Simulator, file: Path, name: str, text_file: Path | None) -> None:
    if not isinstance(solver, MpmSolver):
        raise click.UsageError(f"--out {file}: a page plays MPM alone; drop --solver and --budget-ms.")
    text = "" if text_file is None else text_file.read_text(encoding="utf-8")
    play(solver, file, name=solver.scene.name or name, text=text)
    click.echo(f"wrote {file}: {file.stat().st_size / 1e6:.2f} MB, plays in any browser")


def _what_is_discarded(frames: int, name: str) -> str:
    return (
        f"All states of these {frames} frames will be discarded: --out {name}.gif keeps a film of them, "
        f"--out {name}.npz the states, --save {name}.hmpm the last one to go on from."
    )


def _refuse_of_others(ctx: click.Context, kind: Kind) -> None:
    """Refuse options that the chosen simulator does not have."""
    taken = simulators.settings_of(kind)
    for param in ctx.command.params:
        name = param.name or ""
        takers = [other for other in simulators.SIMULATORS if name in simulators.settings_of(other)]
        given = ctx.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT
        if given and takers and name not in taken:
            hint = f"{param.get_error_hint(ctx)} is for --solver {' or '.join(takers)}"
            raise click.UsageError(f"{hint}, not for {kind}.")


def _refuse_beside(ctx: click.Context, what: str, settings: tuple[str, ...]) -> None:
    """Refuse options for scene and settings, which a snapshot or a run already has."""
    if given := _given(ctx, settings):
        raise click.UsageError(f"{what} with the scene and settings of its file; drop {given[0]}.")


def _refuse_beside_budget(ctx: click.Context) -> None:
    """Refuse settings that a budget chooses, and files of a solver whose coarse level depends on a clock."""
    if given := _given(ctx, ("kind", "substeps", "coarse", "model", "r_c")):
        raise click.UsageError(f"--budget-ms chooses the coarse level itself; drop {given[0]}.")
    if given := _given(ctx, ("save_file",)):
        raise click.UsageError(
            f"{given[0]} is not for --budget-ms, whose coarse level depends on a clock; use --out."
        )


def _given(ctx: click.Context, names: tuple[str, ...]) -> list[str]:
    """Return those of the options that were given, as messages call them."""
    return [
        param.get_error_hint(ctx)
        for param in ctx.command.params
        if param.name in names
        and ctx.get_parameter_source(param.name) is not click.core.ParameterSource.DEFAULT
    ]


def _scene(scenario: str | None, scene_file: Path | None, seed: int) -> Scene:
    if scenario is not None and scene_file is None:
        return scenarios.get(scenario, seed)
    if scene_file is not None and scenario is None:
        return scene_in(scene_file, seed)
    raise click.UsageError(
        f"Give a scenario ({', '.join(scenarios.NAMES)}), --scene FILE, --resume FILE or --run FILE."
    )


def _summary(solver: Simulator, frames: int, seconds: float) -> str:
    line = f"{solver.scene.name or 'scene'}: {solver.particle_count} particles, {frames} frames"
    if frames:
        line += f", {1e3 * seconds / frames:.2f} ms per frame"
    if frames and solver.last_frame:
        line += f", {solver.last_frame.substeps} substeps in the last"
    if isinstance(solver, MpmSolver) and solver.redone_frames:
        line += f", {len(solver.redone_frames)} frames done again at the safe step"
    if isinstance(solver, AutoSolver):
        levels = [solver.plan.name, *(f"{one.after} from frame {one.frame}" for one in solver.changes)]
        line += f"; method {', '.join(levels)}"
    if solver.log:
        line += f", {100 * solver.mpm_share:.0f} % of the frames by MPM"
    mass = solver.mass.sum(dtype=np.float64)
    fastest = np.linalg.norm(solver.velocities, axis=1).max(initial=0.0)
    return f"{line}; {mass:.4g} kg, fastest {fastest:.3g} m/s"


def _write(target: Path, recording: Recording, style: export.Style, view: View | None) -> None:
    with progress(f"Writing {target.name}", CountedProgress.STEPS) as bar:
        files = export.save(target, recording, style, view=view, on_progress=CountedProgress(bar))
        bar.finish()
    click.echo(f"wrote {files[0]}" + (f" to {files[-1].name}" if len(files) > 1 else ""))
