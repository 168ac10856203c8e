"""`hybridmpm scenarios`, `schema` and `doctor`: reports on the library and its installation."""

import importlib.metadata
import importlib.util
import json
import platform
import shutil
import sys
from dataclasses import dataclass

import click

from hybridmpm import _core
from hybridmpm import scenarios as library
from hybridmpm._support.machine import cpu_model, usable_cores
from hybridmpm.errors import ExportError, SimulationError
from hybridmpm.export.pictures import require_encoder
from hybridmpm.mpm import MpmSolver
from hybridmpm.scenarios import water_2d
from hybridmpm.scenarios.samplers import markdown_table
from hybridmpm.scene import Scene

_LIBRARIES = ("numpy", "pydantic", "pillow", "click", "pyyaml")
"""Distributions that the package needs."""
_EXTRAS = (
    ("shape files", "shapes", ("contourpy", "svgpathtools", "trimesh")),
    ("surfaces", "surfaces", ("pysplashsurf",)),
    ("USD", "usd", ("pxr",)),
)
"""What needs an extra, its name, and its modules."""
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")


@dataclass(frozen=True)
class Finding:
    """One line of the report."""

    subject: str
    state: str
    """"ok", "missing" (optional and absent) or "broken" (required and not working)."""
    detail: str
    """Version or location; of a missing or broken part the remedy or the error."""


def examine() -> list[Finding]:
    """Return the findings on all parts of the installation, within a second; a fault is a finding, too."""
    return [
        Finding("hybridmpm", "ok", f"{_core.__version__}, solver version {_core.SOLVER_VERSION}"),
        Finding("python", "ok", f"{platform.python_version()} ({sys.executable})"),
        *(Finding(name, "ok", importlib.metadata.version(name)) for name in _LIBRARIES),
        Finding("platform", "ok", platform.platform()),
        Finding("processor", "ok", cpu_model()),
        Finding("threads", "ok", f"{usable_cores()} can run at once; a solver uses 1 by default"),
        Finding("cpu features", "ok", ", ".join(_core.cpu_features()) or "none that matter here"),
        _solver_works(),
        _encoder(),
        *(_extra(*extra) for extra in _EXTRAS),
        _service(),
        _browser(),
    ]


def _solver_works() -> Finding:
    try:
        solver = MpmSolver(water_2d(0))
        solver.advance(10)
    except SimulationError as error:
        return Finding("solver", "broken", str(error))
    return Finding("solver", "ok", f"moved {solver.particle_count} particles of water for 10 frames")


def _encoder() -> Finding:
    try:
        path = require_encoder().get_ffmpeg_exe()
    except (ExportError, RuntimeError):
        return Finding("mp4 encoder", "missing", "pip install 'hybridmpm[video]'; GIF works without")
    return Finding("mp4 encoder", "ok", path)


def _extra(subject: str, extra: str, packages: tuple[str, ...]) -> Finding:
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        return Finding(subject, "missing", f"pip install 'hybridmpm[{extra}]', for {', '.join(missing)}")
    return Finding(subject, "ok", ", ".join(packages))


def _service() -> Finding:
    if importlib.util.find_spec("hybridmpm_service") is None:
        return Finding("service", "missing", "pip install 'hybridmpm[service]', for `hybridmpm serve`")
    try:
        version = importlib.metadata.version("hybridmpm-service")
    except importlib.metadata.PackageNotFoundError:
        version = "importable, but not installed"
    return Finding("service", "ok", version)


def _browser() -> Finding:
    for name in _BROWSERS:
        path = shutil.which(name)
        if path:
            return Finding("chromium", "ok", path)
    return Finding("chromium", "missing", "only the browser tests need it; Debian's package is chromium")


@click.command()
@click.option("--ranges", is_flag=True, help="Print the ranges of the scenarios as a Markdown table.")
def scenarios(*, ranges: bool) -> None:
    """List the scenarios, kinds of random scenes."""
    if ranges:
        click.echo(markdown_table(), nl=False)
        return
    for name in library.NAMES:
        info = library.describe(name)
        limits = f"{info.dim}D  {info.frames:4d} frames  <= {info.max_particles} particles"
        click.echo(f"{name:15s} {limits}  {info.text}")


@click.command()
def schema() -> None:
    """Print the JSON Schema of scene files."""
    click.echo(json.dumps(Scene.json_schema(), indent=2))


@click.command()
@click.pass_context
def doctor(ctx: click.Context) -> None:
    """Report versions, processor and missing parts of this installation.

    The exit status is 1 if a part that is needed does not work.
    """
    findings = examine()
    for finding in findings:
        click.echo(f"{finding.subject:13s} {finding.state:8s} {finding.detail}")
    ctx.exit(1 if any(finding.state == "broken" for finding in findings) else 0)
