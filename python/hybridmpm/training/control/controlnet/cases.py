"""Reversed control on control nodes: where they are, which forces act on them, and the sketch."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hybridmpm import scenarios
from hybridmpm.control import reversed_from_seed
from hybridmpm.control.diffusion.network import picture_of
from hybridmpm.control.diffusion.nodes import Nodes
from hybridmpm.scene import Scene
from hybridmpm.training.control import scene_files

FRAMES = 100
"""Frames of control, as in the paper."""
_COLUMNS = ("x", "v", "force", "types", "picture", "oval")


@dataclass(frozen=True, eq=False)
class NodeCase:
    """One reversed case on K control nodes in D dimensions, of T frames."""

    x: npt.NDArray[np.float32]
    """Positions before each frame (T, K, D) [m]."""
    v: npt.NDArray[np.float32]
    """Velocities before each frame (T, K, D) [m/s]."""
    force: npt.NDArray[np.float32]
    """Smoothed accelerations besides gravity in each frame (T, K, D) [m/s^2]."""
    types: npt.NDArray[np.int64]
    """Particle types (K,)."""
    picture: npt.NDArray[np.uint8]
    """The sketch as the network sees it (3, 64, 64)."""
    oval: npt.NDArray[np.bool_]
    """Whether the sketch is an oval, ()."""
    scene: Scene

    @property
    def is_arrow(self) -> bool:
        """Whether the sketch is an arrow."""
        return not bool(self.oval)


def prepare(
    root: Path,
    scenario: str,
    seeds: Sequence[int],
    on_progress: Callable[[int], object] = lambda _count: None,
) -> None:
    """Make the missing cases of a scenario in a folder of it; see `scene_files.prepare`."""
    scene_files.prepare(root, scenario, seeds, _columns, on_progress)


def read(root: Path, scenario: str, seeds: Sequence[int]) -> list[NodeCase]:
    """Return the cases of some seeds, without those that could not be simulated.

    Raises
    ------
    DataError
        A file is damaged, or there is none at all.
    """
    return [
        NodeCase(scene=scenarios.get(scenario, seed), **columns)
        for seed, columns in scene_files.read(root, scenario, seeds, _COLUMNS)
    ]


def _columns(scenario: str, seed: int) -> scene_files.Columns:
    case = reversed_from_seed(scenario, seed, frames=FRAMES)
    start = case.positions[0].astype(np.float64)
    nodes = Nodes.of(start, case.mass.astype(np.float64), case.simulator().materials)
    x = np.stack([nodes.gathered(state) for state in case.positions])
    moved = np.diff(x, axis=0) / case.scene.frame_dt
    v = np.concatenate([nodes.gathered(case.velocities)[None], moved[:-1]])
    force = np.stack([nodes.gathered(one) for one in case.smoothed_forces])
    return {
        "x": x[:-1].astype(np.float32),
        "v": v.astype(np.float32),
        "force": force.astype(np.float32),
        "types": nodes.types,
        "picture": picture_of(case.sketch),
        "oval": np.array(case.kind == "oval"),
    }
