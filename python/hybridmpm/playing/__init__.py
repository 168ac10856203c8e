"""`play`: a simulation as one file that any browser plays, without a server and without a network.

The file contains the compiled solver as a WebAssembly module, which computes the bits of the native one, and
the state that it begins with.
"""

import base64
import functools
import gzip
import html
import json
import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.files import replacing
from hybridmpm.control import Guidance, Sequence
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm.playing.text import html_of
from hybridmpm.playing.ways import drawn, legs_of, ways_file
from hybridmpm.probes import Probe
from hybridmpm.probes.series import checked_probe
from hybridmpm.scene import Scene
from hybridmpm.scene.obstacles import Obstacle

__all__ = ["MODULES", "PlayingPage", "drawing_of_bodies", "module", "play", "ways_file"]

MODULES = ("plane", "plane-exact", "space", "space-exact")
"""Names of the compiled solvers."""
_MOST_SOLID_POINTS = 12_000
"""Most points that show one obstacle."""
_HEIGHT = 560
"""Height [px] of a page within a notebook."""
_READ_EVERY = 0.01
"""Time from one reading of the probes to the next [s]."""


class PlayingPage:
    """A page that plays a simulation: an HTML file, or the output of a cell in a notebook."""

    def __init__(self, page: str) -> None:
        self.html = page
        """The whole page, which loads nothing from elsewhere."""

    def save(self, path: str | Path) -> Path:
        """Write the page to a file.

        Raises
        ------
        ConfigError
            The suffix is not .html or .htm.
        ExportError
            The file cannot be written.
        """
        file = Path(path)
        if file.suffix.lower() not in (".html", ".htm"):
            raise ConfigError(f"a page that plays must be an .html file, got {str(path)!r}")
        with replacing(file) as part:
            part.write_text(self.html, encoding="utf-8")
        return file

    def _repr_html_(self) -> str:
        """Return the page as a frame of its own, which notebooks show and exported notebooks keep."""
        return (
            f'<iframe sandbox="allow-scripts" style="width: 100%; height: {_HEIGHT}px; border: 0" '
            f'srcdoc="{html.escape(self.html)}"></iframe>'
        )


def play(
    source: Scene | MpmSolver,
    path: str | Path | None = None,
    *,
    name: str = "",
    text: str = "",
    guidance: Guidance | Sequence | None = None,
    probes: Mapping[str, Probe] | None = None,
) -> PlayingPage:
    """Return a page that plays a simulation in any browser; write it where a path is given.

    The page goes on from the state of `source` with the bits of `MpmSolver.advance`: both have the same
    digest after the same frame. In it, a drag pushes the material.

    Parameters
    ----------
    source : Scene or MpmSolver
        A scene is played from its beginning, a solver from its present state.
    path : str or Path, optional
        File to write, .html.
    name : str
        Title of the page; the scene's dimension and number of particles if empty.
    text : str
        Text beside the picture, in Markdown (CommonMark) without pictures and without HTML of its own.
    guidance : Guidance or Sequence, optional
        Sketch that the material follows, from `control.prepare`, in the frames for which it was planned; or
        several in turn, from `control.prepare_keyframes`. A copy of the solver goes the way to the last one
        first, because each is planned from the state in its first frame. So a hand on the page moves the
        material, but not the plans.
    probes : mapping, optional
        Probes by name, whose readings the page draws as charts: every 10 ms, forces as means of these.

    Raises
    ------
    ConfigError
        `source` is neither a scene nor an MPM solver, the path is no .html file, a probe does not fit into
        the scene or is one of your own, or the method of the guidance is none that pages have.
    """
    solver = MpmSolver(source) if isinstance(source, Scene) else source
    if not isinstance(solver, MpmSolver):
        raise ConfigError(
            f"a page plays a Scene or an MpmSolver, got {type(source).__name__}: networks run on servers only"
        )
    for probe in (probes or {}).values():
        checked_probe(probe).check(solver.scene)
    about = _about(solver, probes or {})
    about["sketches"], ways = [], b""
    if guidance is not None:
        legs = legs_of(guidance, solver)
        ways = ways_file(legs, guidance.first_frame, guidance.total_frames)
        ends = [start for start, _ in legs[1:]] + [guidance.total_frames]
        about["sketches"] = [
            {
                "first": guidance.first_frame + start,
                "last": guidance.first_frame + end,
                "lines": drawn(leg),
                "isArrow": leg.sketch.kind == "arrow",
            }
            for (start, leg), end in zip(legs, ends, strict=True)
        ]
    title = name or f"{solver.particle_count} particles in {solver.dim}D"
    page = PlayingPage(_page(solver, title, text, about, ways))
    if path is not None:
        page.save(path)
    return page


def _about(solver: MpmSolver, probes: Mapping[str, Probe]) -> dict[str, Any]:
    """Return what the page has to know besides the start file, as plain data."""
    scene = solver.scene
    step, lattice = _lattice(scene)
    solids = [
        {
            "obstacle": index,
            "moves": obstacle.motion is not None,
            "points": _as_numbers(_points(obstacle, lattice, step)),
        }
        for index, obstacle in enumerate(scene.obstacles)
    ]
    return {
        "lower": scene.walls.lower,
        "upper": scene.walls.upper,
        "gravity": scene.gravity,
        "unit": max(scene.size),
        "frameDt": scene.frame_dt,
        "types": [material.type_id for material in scene.materials],
        "spacing": solver.particle_spacing,
        "simulatedSpacing": solver.pressure_samples().spacing,
        "solids": solids,
        "rigid": [body.solid() for body in scene.rigid],
        "solidStep": step,
        "moves": any(solid["moves"] for solid in solids),
        "probes": [{"name": name, "unit": one.unit, **one.plain(solver)} for name, one in probes.items()],
        "readEvery": max(1, round(_READ_EVERY / scene.frame_dt)),
    }


def _page(solver: MpmSolver, name: str, text: str, about: dict[str, Any], ways: bytes) -> str:
    scene = solver.scene
    space = "space" if scene.dim == 3 else "plane"
    width, height = (b - a for a, b in zip(scene.walls.lower[:2], scene.walls.upper[:2], strict=True))
    parts = {
        "version": _core.__version__,
        "name": html.escape(name),
        "aspect": f"{width / height:.4g}" if scene.dim == 2 else "1.333",
        "hidden": "" if text.strip() else "hidden",
        "bare": "" if text.strip() or about["probes"] else "hidden",
        "lesson": html_of(text),
        "scene": json.dumps(about).replace("<", "\\u003c"),
        "start": _packed(solver.start_file()),
        "ways": _packed(ways),
        "module": _as_text(module(space)),
        "module-exact": _as_text(module(f"{space}-exact")),
        "worker": "\n".join(_asset(name).decode() for name in ("readings.js", "worker.js")),
        # Without rigid bodies nothing of their drawing is called.
        "player": "\n".join(
            [
                _asset("charts.js").decode(),
                *([_inlined(drawing_of_bodies())] if about["rigid"] else []),
                _asset("player.js").decode(),
            ]
        ),
    }
    return re.sub(r"\{\{([a-z-]+)\}\}", lambda place: parts[place[1]], _asset("page.html").decode())


def _lattice(scene: Scene) -> tuple[float, npt.NDArray[np.float32]]:
    """Return the distance between the points that show solids [m], and a lattice (N, D) of these."""
    lower, upper = np.array(scene.walls.lower), np.array(scene.walls.upper)
    step = max(scene.spacing, float(np.prod(upper - lower) / 200_000) ** (1 / scene.dim))
    axes = [np.arange(a + step / 2, b, step) for a, b in zip(lower, upper, strict=True)]
    return step, np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, scene.dim).astype(
        np.float32
    )


def _points(solid: Obstacle, lattice: npt.NDArray[np.float32], step: float) -> npt.NDArray[np.float32]:
    """Return points that fill a solid, or its surface in 3D [m]."""
    distance = solid.to_native().signed_distance(lattice)
    inside = distance <= 0
    if lattice.shape[1] == 3:
        inside &= distance > -1.5 * step
    points = lattice[inside]
    return points[:: -(-len(points) // _MOST_SOLID_POINTS) or 1]


@functools.cache
def module(name: str) -> bytes:
    """Return a compiled solver for browsers, packed by gzip.

    Parameters
    ----------
    name : str
        "plane" in 2D or "space" in 3D, with "-exact" for browsers that round products of vectors.

    Raises
    ------
    ConfigError
        There is no such module.
    """
    if name not in MODULES:
        raise ConfigError(f"there is no module {name!r}, only {', '.join(MODULES)}")
    return _asset(f"{name}.wasm.gz")


def drawing_of_bodies() -> str:
    """Return the module of JavaScript that draws rigid bodies, which the page of the service uses as well."""
    return _asset("bodies.js").decode()


def _inlined(module: str) -> str:
    """Return a module of JavaScript without imports as a part of a script, which has what it exports."""
    names = ", ".join(re.findall(r"^export (?:const|function) (\w+)", module, flags=re.MULTILINE))
    body = re.sub(r"^export ", "", module, flags=re.MULTILINE)
    return f"const {{ {names} }} = (() => {{\n{body}\nreturn {{ {names} }};\n}})();"


def _packed(data: bytes) -> str:
    return _as_text(gzip.compress(data, 9, mtime=0))


def _as_text(data: bytes) -> str:
    """Return bytes as text that may stand in a script element: Python's base 85, with a comma for `<`."""
    return base64.b85encode(data).decode().replace("<", ",")


def _as_numbers(values: npt.NDArray[np.floating]) -> str:
    return _as_text(values.astype("<f4").tobytes())


def _asset(name: str) -> bytes:
    return (resources.files(__package__) / name).read_bytes()
