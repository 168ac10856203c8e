"""`play`: a simulation as one file that any browser plays, without a server and without a network.

The file contains the compiled solver as a WebAssembly module, which computes the bits of the native one, and
the state that it begins with.
"""

import base64
import gzip
import html
import json
import re
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm.playing.text import html_of
from hybridmpm.scene import Scene
from hybridmpm.scene.obstacles import Obstacle

_MOST_SOLID_POINTS = 12_000
"""Most points that show one obstacle."""
_HEIGHT = 560
"""Height [px] of a page within a notebook."""


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
    source: Scene | MpmSolver, path: str | Path | None = None, *, name: str = "", text: str = ""
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

    Raises
    ------
    ConfigError
        `source` is neither a scene nor an MPM solver, or in coarse mode; or the path is no .html file.
    """
    solver = MpmSolver(source) if isinstance(source, Scene) else source
    if not isinstance(solver, MpmSolver):
        raise ConfigError(
            f"a page plays a Scene or an MpmSolver, got {type(source).__name__}: networks run on servers only"
        )
    if solver.r_p < 1:
        raise ConfigError("a page plays all particles of a scene: make the solver without `coarse` and `r_p`")
    page = PlayingPage(_page(solver, name or f"{solver.particle_count} particles in {solver.dim}D", text))
    if path is not None:
        page.save(path)
    return page


def _page(solver: MpmSolver, name: str, text: str) -> str:
    scene = solver.scene
    space = "space" if scene.dim == 3 else "plane"
    step, solids = _solids(scene)
    about = {
        "lower": scene.walls.lower,
        "upper": scene.walls.upper,
        "types": [material.type_id for material in scene.materials],
        "spacing": scene.spacing,
        "solids": solids,
        "solidStep": step,
    }
    width, height = (b - a for a, b in zip(scene.walls.lower[:2], scene.walls.upper[:2], strict=True))
    parts = {
        "version": _core.__version__,
        "name": html.escape(name),
        "aspect": f"{width / height:.4g}" if scene.dim == 2 else "1.333",
        "hidden": "" if text.strip() else "hidden",
        "lesson": html_of(text),
        "scene": json.dumps(about).replace("<", "\\u003c"),
        "start": _packed(solver.start_file()),
        "module": _stored(f"{space}.wasm.gz"),
        "module-exact": _stored(f"{space}-exact.wasm.gz"),
        "worker": _asset("worker.js").decode(),
        "player": _asset("player.js").decode(),
    }
    return re.sub(r"\{\{([a-z-]+)\}\}", lambda place: parts[place[1]], _asset("page.html").decode())


def _solids(scene: Scene) -> tuple[float, list[dict[str, Any]]]:
    """Return points that fill the obstacles, or their surfaces in 3D, and the distance between them [m]."""
    lower, upper = np.array(scene.walls.lower), np.array(scene.walls.upper)
    step = max(scene.spacing, float(np.prod(upper - lower) / 200_000) ** (1 / scene.dim))
    axes = [np.arange(a + step / 2, b, step) for a, b in zip(lower, upper, strict=True)]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, scene.dim).astype(np.float32)
    solids = [
        {
            "obstacle": index,
            "moves": obstacle.motion is not None,
            "points": base64.b64encode(_points(obstacle, lattice, step).astype("<f4").tobytes()).decode(),
        }
        for index, obstacle in enumerate(scene.obstacles)
    ]
    return step, solids


def _points(obstacle: Obstacle, lattice: npt.NDArray[np.float32], step: float) -> npt.NDArray[np.float32]:
    distance = obstacle.to_native().signed_distance(lattice)
    inside = distance <= 0
    if lattice.shape[1] == 3:
        inside &= distance > -1.5 * step
    points = lattice[inside]
    return points[:: -(-len(points) // _MOST_SOLID_POINTS) or 1]


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def _stored(name: str) -> str:
    return base64.b64encode(_asset(name)).decode()


def _asset(name: str) -> bytes:
    return (resources.files(__package__) / name).read_bytes()
