"""`Recipe`: what the trajectories of a data set have in common; with a seed it determines one of them."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from hybridmpm import scenarios
from hybridmpm._native import __version__
from hybridmpm._support.arguments import whole
from hybridmpm.data.template import SceneTemplate
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import Substeps
from hybridmpm.scene import Scene, Water

MAX_FORCE = 1000.0
"""[m/s^2]; beyond a hundred times gravity nothing is a fluid in a box."""
_MAX_FRAMES = 1_000_000
_LEAST_STATES = 3
"""Accelerations need three states."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How a seed becomes a trajectory.

    Raises
    ------
    ConfigError
        A setting is out of range; `SceneError` where it is the scene's.
    """

    scenario: str | None = None
    """Name of a scenario; None with `template`."""
    template: SceneTemplate | None = None
    frames: int | None = None
    """Frames simulated; what the scenario or the template suggests if None."""
    stride: int = 1
    """Frames between two states kept; it divides `frames`."""
    r_p: float = 1.0
    """Ratio of the particles to those of the scene, in (0, 1]."""
    max_compression: float | None = None
    """Of all water at rest, in (0, 0.5]; the scene's own stiffness if None."""
    substeps: Substeps = "reference"
    """As in `MpmSolver`; "reference" is the ground truth's rule."""
    force: float = 0.0
    """Root mean square [m/s^2] of a smooth random acceleration that stirs all particles and is stored."""

    def __post_init__(self) -> None:
        if (self.scenario is None) == (self.template is None):
            raise ConfigError("a recipe needs a scenario or a scene template, and only one of them")
        whole("stride", self.stride, 1, _MAX_FRAMES)
        frames = whole("frames", self._suggested() if self.frames is None else self.frames, 1, _MAX_FRAMES)
        object.__setattr__(self, "frames", frames)
        if frames % self.stride or frames // self.stride + 1 < _LEAST_STATES:
            raise ConfigError(
                f"frames must be a multiple of the stride, {self.stride}, at least twice, got {frames}"
            )
        if not (0.0 < self.r_p <= 1.0):
            raise ConfigError(f"r_p must be in (0, 1], got {self.r_p}")
        if not (math.isfinite(self.force) and 0.0 <= self.force <= MAX_FORCE):
            raise ConfigError(f"force must be in [0, {MAX_FORCE:g}] m/s^2, got {self.force}")
        if self.force and self.stride > 1:
            raise ConfigError("force needs stride 1: a row of it acts over one frame")
        self.scene(0)

    @property
    def states(self) -> int:
        """States of a trajectory, the start among them: T + 1."""
        return whole("frames", self.frames, 1, _MAX_FRAMES) // self.stride + 1

    @property
    def name(self) -> str:
        """Name of the scenario or of the template's scenes."""
        return self.scenario or str(self.template and self.template.data.get("name", "scene"))

    def scene(self, seed: int) -> Scene:
        """Draw the scene of a seed; raises `SceneError`."""
        if self.template is not None:
            scene = self.template.draw(seed)
        else:
            scene = scenarios.get(self.scenario or "", seed)
        return scene if self.max_compression is None else _stiffened(scene, self.max_compression)

    def to_dict(self) -> dict[str, Any]:
        """Plain data: equal for recipes, of this version, that give the same trajectories."""
        return {"hybridmpm": __version__, **dataclasses.asdict(self)}

    def _suggested(self) -> int:
        if self.scenario is not None:
            return scenarios.describe(self.scenario).frames
        return self.scene(0).frames


def _stiffened(scene: Scene, max_compression: float) -> Scene:
    """Give all water of a scene the stiffness of `max_compression`, checking it anew."""
    bodies = []
    for body in scene.bodies:
        plain = body.model_dump(exclude_none=True)
        if isinstance(body.material, Water):
            plain["material"].pop("bulk_modulus", None)
            plain["material"]["max_compression"] = max_compression
        bodies.append(plain)
    return Scene.parse({**scene.model_dump(exclude_none=True), "bodies": bodies})
