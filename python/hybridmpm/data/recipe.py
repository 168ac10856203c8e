"""`Recipe`: what all trajectories of a data set have in common. Recipe and seed determine a trajectory."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from hybridmpm import scenarios
from hybridmpm._core import SOLVER_VERSION, __version__
from hybridmpm._support.arguments import whole
from hybridmpm.control.reversal import DEFAULT_FRAMES, MAX_DRAWN_FRAMES
from hybridmpm.data.template import SceneTemplate
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import Substeps
from hybridmpm.scene import Scene, Water

MAX_FORCE = 1000.0
"""Largest random acceleration [m/s^2], a hundred times gravity."""
_MAX_FRAMES = 1_000_000
_MIN_STATES = 3
"""Smallest number of states of a trajectory, since an acceleration needs three."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Recipe by which a seed becomes a trajectory.

    Raises
    ------
    ConfigError
        A setting is out of range. If the scene refuses it, this is a `SceneError`.
    """

    scenario: str | None = None
    """Name of the scenario that the scenes are drawn from; None with `template`."""
    template: SceneTemplate | None = None
    """Template that the scenes are drawn from; None with `scenario`."""
    frames: int | None = None
    """Number of frames to simulate; if None, the number that the scenario or the template suggests."""
    stride: int = 1
    """Number of frames from one stored state to the next; it divides `frames`."""
    r_p: float = 1.0
    """Number of particles over that of the scene, in (0, 1]."""
    max_compression: float | None = None
    """`Water.max_compression` of all water, in (0, 0.5]; if None, water has the stiffness of the scene."""
    substeps: Substeps = "reference"
    """Rule for substeps, as in `MpmSolver`; "reference" is the rule of the ground truth."""
    force: float = 0.0
    """Root mean square [m/s^2] of a smooth random acceleration that stirs all particles and is stored."""
    control: bool = False
    """Whether the trajectories are reversed cases of control (`control.reversed_from_seed`) of `frames`
    frames; 100 if that is None."""

    def __post_init__(self) -> None:
        if (self.scenario is None) == (self.template is None):
            raise ConfigError("a recipe needs a scenario or a scene template, and only one of them")
        whole("stride", self.stride, 1, _MAX_FRAMES)
        most = MAX_DRAWN_FRAMES if self.control else _MAX_FRAMES
        frames = whole("frames", self._suggested() if self.frames is None else self.frames, 1, most)
        object.__setattr__(self, "frames", frames)
        if frames % self.stride or frames // self.stride + 1 < _MIN_STATES:
            raise ConfigError(
                f"frames must be a multiple of the stride, {self.stride}, at least twice, got {frames}"
            )
        if not (0.0 < self.r_p <= 1.0):
            raise ConfigError(f"r_p must be in (0, 1], got {self.r_p}")
        if not (math.isfinite(self.force) and 0.0 <= self.force <= MAX_FORCE):
            raise ConfigError(f"force must be in [0, {MAX_FORCE:g}] m/s^2, got {self.force}")
        if self.force and self.stride > 1:
            raise ConfigError("force needs stride 1: each row of the stored force acts over one frame")
        if self.control and (self.force or self.stride > 1):
            raise ConfigError(
                "control needs stride 1 and no random force, since the force that controls is stored for "
                f"each frame; got stride {self.stride} and force {self.force:g}"
            )
        self.scene(0)

    @property
    def states(self) -> int:
        """Number T + 1 of states of a trajectory, the start included."""
        return whole("frames", self.frames, 1, _MAX_FRAMES) // self.stride + 1

    @property
    def name(self) -> str:
        """Name of the scenario or of the template's scenes."""
        return self.scenario or str(self.template and self.template.data.get("name", "scene"))

    def scene(self, seed: int) -> Scene:
        """Draw the scene of a seed; raises `SceneError` where none can be drawn."""
        if self.template is not None:
            scene = self.template.draw(seed)
        else:
            scene = scenarios.get(self.scenario or "", seed)
        return scene if self.max_compression is None else _stiffened(scene, self.max_compression)

    def to_dict(self) -> dict[str, Any]:
        """Return the recipe and the versions of library and solver as plain data."""
        return {"hybridmpm": __version__, "solver_version": SOLVER_VERSION, **dataclasses.asdict(self)}

    def _suggested(self) -> int:
        if self.control:
            return DEFAULT_FRAMES
        if self.scenario is not None:
            return scenarios.describe(self.scenario).frames
        return self.scene(0).frames


def _stiffened(scene: Scene, max_compression: float) -> Scene:
    """Return the scene with all its water at the stiffness of `max_compression`; raises `SceneError`."""
    bodies = []
    for body in scene.bodies:
        plain = body.model_dump(exclude_none=True)
        if isinstance(body.material, Water):
            plain["material"].pop("bulk_modulus", None)
            plain["material"]["max_compression"] = max_compression
        bodies.append(plain)
    return Scene.parse({**scene.model_dump(exclude_none=True), "bodies": bodies})
