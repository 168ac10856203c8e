"""Reversed cases on control nodes: where the nodes are, where they were before, and the sketch."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.control import Sketch
from hybridmpm.control.diffusion.network import picture_of
from hybridmpm.control.diffusion.nodes import Nodes
from hybridmpm.control.reversal import SHORTEST_ARROW, arrow_of, oval_of
from hybridmpm.errors import DataError, SketchError
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import SAND, WATER
from hybridmpm.training.control import pasts, scene_files
from hybridmpm.training.control.pasts import STATES, STRIDE, Past
from hybridmpm.training.sources import DataSet, Drawn, Source

FRAMES = 100
"""Frames of control, as in the paper."""
_CASES = 4
"""Cases of a past, which start at different times."""
_NEAREST = 0.03
"""Distance that the centre of mass goes at least [m]; with less a sketch would ask for nothing."""
_SALT = 2**23
"""Number that the generator of a past's cases gets besides the seed."""
_COLUMNS = ("x", "v", "end", "types", "picture", "oval")


@dataclass(frozen=True, eq=False)
class NodeCase:
    """A fluid on K control nodes in D dimensions that is to go back to where it was T frames ago."""

    x: npt.NDArray[np.float32]
    """Positions when control starts (K, D) [m]."""
    v: npt.NDArray[np.float32]
    """Velocities when control starts (K, D) [m/s]."""
    end: npt.NDArray[np.float32]
    """Positions T frames before (K, D) [m], where control is to lead the nodes."""
    types: npt.NDArray[np.int64]
    """Particle types (K,)."""
    picture: npt.NDArray[np.uint8]
    """Picture of the sketch for the network (3, 64, 64)."""
    oval: npt.NDArray[np.bool_]
    """Whether the sketch is an oval, ()."""
    scene: Scene

    @property
    def is_arrow(self) -> bool:
        """Whether the sketch is an arrow."""
        return not bool(self.oval)

    @property
    def seconds(self) -> float:
        """Time of control [s]."""
        return FRAMES * self.scene.frame_dt


def prepare(
    root: Path,
    source: Drawn,
    seeds: Sequence[int],
    on_progress: Callable[[int], object] = lambda _count: None,
) -> None:
    """Make the missing cases of a source in a folder of it; see `scene_files.prepare`."""

    def columns(scene: Scene, seed: int) -> scene_files.Columns:
        return columns_of(Past.simulated(scene), seed)

    scene_files.prepare(root, source, seeds, columns, on_progress)


def read(root: Path, source: Source, seeds: Sequence[int], split: str) -> list[NodeCase]:
    """Return the cases of some seeds, up to four of each; or the examples of a split of a data set.

    Raises
    ------
    DataError
        A file is damaged, there is none at all, or the examples are of another number of frames.
    """
    if isinstance(source, DataSet):
        return list(map(of_example, pasts.read_examples(source, split)))
    return [
        _from(case, source.scene(seed))
        for seed, columns in scene_files.read(root, source, seeds, _COLUMNS)
        for case in zip(*(columns[name] for name in _COLUMNS), strict=True)
    ]


def of_example(past: Past) -> NodeCase:
    """Return an example of control as a case; raises `DataError` where it is of other frames, or a run."""
    if past.sketch is None or past.stride != FRAMES:
        raise DataError(
            f"controlnet is trained on examples of {FRAMES} frames, got {past.stride}: make them by "
            f"hybridmpm dataset generate --control --frames {FRAMES}"
        )
    return _from(_columns_of_case(past, 1, 0, past.sketch), past.scene)


def _from(columns: Iterable[npt.NDArray[Any]], scene: Scene) -> NodeCase:
    return NodeCase(scene=scene, **dict(zip(_COLUMNS, columns, strict=True)))


def columns_of(past: Past, seed: int) -> scene_files.Columns:
    """Return the cases of a past, as rows of arrays; their starts and sketches are drawn from a seed.

    Raises
    ------
    SketchError
        The fluid hardly moves, so that no sketch would ask for anything.
    """
    rng = np.random.default_rng([_SALT, seed])
    strides = FRAMES // STRIDE
    starts = rng.choice(np.arange(strides, STATES), _CASES, replace=False)
    kinds = rng.random(_CASES) < 0.5
    rows = [row for start, arrow in zip(starts, kinds, strict=True) for row in _case(past, int(start), arrow)]
    if not rows:
        raise SketchError("the fluid hardly moves")
    return {name: np.stack(column) for name, column in zip(_COLUMNS, zip(*rows, strict=True), strict=True)}


def _case(past: Past, start: int, arrow: np.bool_) -> Iterator[tuple[npt.NDArray[np.generic], ...]]:
    """Return the only case that begins at a state, or none where the centre of mass hardly moves."""
    first = start - FRAMES // STRIDE
    weight, end = past.state(start).weight, past.positions(first)
    distance = float(np.linalg.norm(weight @ (end - past.positions(start))))
    if distance < _NEAREST:
        return
    walls, is_oval = past.scene.walls, not arrow or distance < SHORTEST_ARROW
    if is_oval:
        sketch: Sketch = oval_of(end.astype(np.float32), weight, walls)
    else:
        way = np.stack([past.positions(index) for index in range(start, first - 1, -1)])
        sketch = arrow_of(way.astype(np.float32), weight, walls)
    yield _columns_of_case(past, start, first, sketch)


def _columns_of_case(
    past: Past, start: int, first: int, sketch: Sketch
) -> tuple[npt.NDArray[np.generic], ...]:
    """Return the columns of the case that leads from a state to an earlier one."""
    state = past.state(start)
    nodes = Nodes.of(state.x, past.mass, np.where(state.sand, SAND, WATER).astype(np.uint8))
    places = [nodes.gathered(one).astype(np.float32) for one in (state.x, state.v, past.positions(first))]
    return (*places, nodes.types, picture_of(sketch), np.array(sketch.kind == "ellipse"))
