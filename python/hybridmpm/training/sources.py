"""Sources of the scenes of a training: scenarios, scene files with ranges, and data sets."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from hybridmpm import data, scenarios
from hybridmpm.data import metadata
from hybridmpm.errors import DataError
from hybridmpm.scenarios.trained_on import TrainedOn
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC

FEWEST = 16
"""Smallest number of particles, besides obstacles, of a scene for training."""
_DRAWN = 256
"""Number of scenes that are drawn to find the properties of all."""
_SEEDS = ("train", "valid")


@dataclass(frozen=True)
class Drawn:
    """Scenes that seeds draw, from a scenario or from a scene file with ranges."""

    scenario: str | None = None
    template: data.SceneTemplate | None = None

    @property
    def label(self) -> str:
        """The scenario; or the name of the file's scenes and a digest of the file."""
        if self.template is None:
            return self.scenario or ""
        plain = json.dumps(self.template.data, sort_keys=True, default=str)
        return f"{self.template.data.get('name', 'scene')} {_digest(plain.encode())}"

    @property
    def folder(self) -> str:
        """Name of the folder of its data."""
        return re.sub(r"[^\w.-]+", "-", self.label)

    def scene(self, seed: int) -> Scene:
        """Draw the scene of a seed; raises `SceneError` where none can be drawn."""
        return scenarios.get(self.label, seed) if self.template is None else self.template.draw(seed)

    def recipe(self, **settings: Any) -> data.Recipe:
        """Return the recipe of its trajectories with settings; errors as `hybridmpm.data.Recipe`."""
        return data.Recipe(scenario=self.scenario, template=self.template, **settings)

    def examples(self) -> Iterator[Scene]:
        """Yield scenes for training, which show what all of them have in common."""
        return map(self.scene, range(_DRAWN))


@dataclass(frozen=True)
class DataSet:
    """A data set in a folder, in a format of `hybridmpm.data`.

    Raises
    ------
    DataError
        The folder has no data set with trajectories for training and for validation, or no metadata.
    """

    folder: Path

    def __post_init__(self) -> None:
        found = data.detect(self.folder).splits(self.folder)
        for split in _SEEDS:
            if split not in found:
                raise DataError(
                    f"{self.folder} has no split {split!r}, but {', '.join(found)}: add "
                    "trajectories to it, e.g. by hybridmpm dataset generate"
                )
        metadata.read(self.folder)

    @property
    def label(self) -> str:
        """The name of its scenes, or of its folder, and a digest of its metadata."""
        about = metadata.read(self.folder)
        return f"{about.get('case', self.folder.name)} {_digest((self.folder / metadata.FILE).read_bytes())}"

    @property
    def seconds(self) -> float:
        """Time that its trajectories span [s]."""
        about = metadata.read(self.folder)
        return float(about["dt"] * about["sequence_length"])

    def examples(self) -> Iterator[Scene]:
        """Yield the scenes of all trajectories for training; errors as `read`."""
        return (scene_of(trajectory) for trajectory in self.read("train"))

    def read(self, split: str) -> Iterator[data.Trajectory]:
        """Yield the trajectories of a split.

        Raises
        ------
        DataError
            A file is damaged, or a trajectory has no scene, or too small a number of particles.
        """
        for trajectory in data.detect(self.folder).read(self.folder, split, None):
            check_particles(scene_of(trajectory), int((trajectory.types != KINEMATIC).sum()))
            yield trajectory


Source = Drawn | DataSet


def described(sources: Sequence[Source]) -> dict[str, Any]:
    """Return the fields `scenarios` and `scenes` of the description of a network for training on sources.

    Raises
    ------
    ConfigError
        The scenes differ in what one network must share.
    DataError
        A data set is damaged or comes without its scenes.
    """
    labels = tuple(source.label for source in sources)
    own = [source for source in sources if not (isinstance(source, Drawn) and source.template is None)]
    scenes: Iterable[Scene] = chain.from_iterable(source.examples() for source in sources)
    return {"scenarios": labels, "scenes": TrainedOn.of(scenes) if own else None}


def scene_of(trajectory: data.Trajectory) -> Scene:
    """Return the scene of a trajectory; raises `DataError` where there is none."""
    if trajectory.scene is None:
        raise DataError(
            f"{trajectory.place.file}: {trajectory.place.position} comes without its scene, which gives "
            "walls, gravity and materials; train on a data set that hybridmpm dataset generate made"
        )
    return trajectory.scene


def check_particles(scene: Scene, count: int) -> None:
    """Refuse a scene of too small a number of particles; raises `DataError`."""
    if count < FEWEST:
        raise DataError(
            f"{scene.title} has {count} particles, and training needs at least {FEWEST}: raise r_p, the "
            "resolution or the size of its bodies"
        )


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:8]
