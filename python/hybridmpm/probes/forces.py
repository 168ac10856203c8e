"""Force and torque of the material on an obstacle or a wall."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import float64, whole
from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.errors import ConfigError
from hybridmpm.probes.probe import Floats, Probe, Probed
from hybridmpm.scene import Scene
from hybridmpm.scene.walls import WallFaces

_WALLS = tuple(WallFaces.model_fields)
"""Names of the walls, in the order of the core's forces."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Force(Probe):
    """Force of the material on an obstacle or a wall [N], in 2D per metre of depth.

    The mean over the latest frame, and in `record` over the time since the reading before. It is the sum of
    all impulses with which the solid changes the motion of the material, so that in a closed scene all forces
    together are the weight less the change of momentum. NaN where no frame has been simulated yet.
    """

    obstacle: int | None = None
    """Index into `Scene.obstacles`."""
    wall: str | None = None
    """Name of a wall, such as "y_lower" for the floor."""
    unit: ClassVar[str] = "N"
    is_mean: ClassVar[bool] = True

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        self._row(scene)

    def _row(self, scene: Scene) -> int:
        """Return the place of the solid among the forces of a frame."""
        if (self.obstacle is None) == (self.wall is None):
            raise ConfigError('give either an obstacle, by its index, or a wall, such as wall="y_lower"')
        walls = _WALLS[: 2 * scene.dim]
        if self.wall is not None:
            if self.wall not in walls:
                hint = did_you_mean(self.wall, walls)
                raise ConfigError(
                    f"wall must be one of {', '.join(walls)} in {scene.dim}D, got {self.wall!r}{hint}"
                )
            return walls.index(self.wall)
        if not scene.obstacles:
            raise ConfigError(f"obstacle {self.obstacle!r} does not exist: the scene has no obstacles")
        return len(walls) + whole("obstacle", self.obstacle, 0, len(scene.obstacles) - 1)

    def prepare(self, simulator: Probed) -> None:
        """See `Probe.prepare`; a `ConfigError` where the simulator has no forces."""
        simulator.keep_forces()

    def read(self, simulator: Probed) -> Floats:
        """Return the force, (D,).

        Raises
        ------
        ConfigError
            The simulator keeps no forces: `keep_forces` was not called, a network moves its particles,
            or may, or parts of the matter may sleep.
        """
        return simulator.frame_forces()[self._row(simulator.scene), : simulator.scene.dim]

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        simulator.keep_forces()
        return {"kind": "force", "row": self._row(simulator.scene), "marks": []}


@dataclass(frozen=True, eq=False, kw_only=True)
class Torque(Force):
    """Torque of the material on an obstacle or a wall about a point [N m], in 2D per metre of depth.

    As `Force` in all else. In 2D it is positive anticlockwise.
    """

    about: npt.ArrayLike
    """The point (D,) [m], which stays where it is; a hinge, for example."""
    unit: ClassVar[str] = "N m"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        super().check(scene)
        self._point(scene)

    def _point(self, scene: Scene) -> Floats:
        point = float64("about", self.about)
        if point.shape != (scene.dim,):
            raise ConfigError(f"about must be a point of {scene.dim} numbers, got {self.about!r}")
        return point

    def read(self, simulator: Probed) -> Floats:
        """Return the torque, () in 2D, else (3,); errors as of `Force.read`."""
        row, point = simulator.frame_forces()[self._row(simulator.scene)], self._point(simulator.scene)
        force, torque = np.split(row, [len(point)])
        if len(point) == 3:
            return np.asarray(torque - np.cross(point, force))
        return np.array(torque[0] - (point[0] * force[1] - point[1] * force[0]))

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        point = self._point(simulator.scene).tolist()
        return super().plain(simulator) | {"kind": "torque", "about": point, "marks": [[point]]}
