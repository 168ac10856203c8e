"""MLS-MPM in plain Warp, whose kernels run on one thread of a CPU.

Dense grid, quadratic B-splines, APIC, float32. Materials, constants and walls are those of `taichi_mpm`.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

from hybridmpm.scene import Scene, Water
from hybridmpm_lab.speed.baselines.conventions import checked_material, sand_constants
from hybridmpm_lab.speed.baselines.warp_kernels import kernels

wp.config.log_level = wp.LOG_WARNING

NAME = f"warp {wp.__version__}"
SETTINGS = {"plain": 1}
"""Threads by the way in which a solver runs."""


def start() -> None:
    """Start Warp."""
    wp.init()


class Solver:
    """MLS-MPM for water or sand on Warp's CPU; parameters, methods and limits are `taichi_mpm.Solver`'s."""

    def __init__(self, scene: Scene, *, substeps: int, setting: str) -> None:
        material = checked_material(scene, "Warp")
        del setting  # there is one
        self._substeps = substeps
        made = kernels(scene.dim, water=isinstance(material, Water))
        self._vec, self._mat = made.vec, made.mat
        self._dim = scene.dim
        s = made.Setting()
        s.dt, s.dx, s.per_dx = scene.frame_dt / substeps, scene.dx, float(scene.resolution)
        s.resolution, s.gravity = scene.resolution, made.vec(*scene.gravity)
        s.lowest = made.ivec(*(math.floor(w * scene.resolution + 1e-6) for w in scene.walls.lower))
        s.highest = made.ivec(*(math.ceil(w * scene.resolution - 1e-6) for w in scene.walls.upper))
        s.friction = material.wall_friction if scene.walls.friction is None else scene.walls.friction
        if isinstance(material, Water):
            s.bulk_modulus, s.tension = material.stiffness(scene.potential_drop), material.tension
            self._stiffness = 0.0
        else:
            mu, lam, alpha = sand_constants(material)
            s.mu, s.lam, s.alpha = mu, lam, alpha
            s.keeps_volume = int(material.volume_correction)
            self._stiffness = 2 * mu + scene.dim * lam
        particles = scene.sample()
        count, nodes = len(particles.x), scene.resolution**scene.dim

        def array(values: Any, dtype: Any = wp.float32) -> Any:
            return wp.array(values, dtype=dtype, device="cpu")

        still = np.zeros((count, scene.dim, scene.dim), dtype=np.float32)
        self._x, self._v = array(particles.x, self._vec), array(particles.v, self._vec)
        self._C, self._F, self._tau = (array(still, self._mat) for _ in range(3))
        self._J, self._gain = (array(np.zeros(count, dtype=np.float32)) for _ in range(2))
        mass, volume = array(particles.mass), array(particles.volume)
        grid_v = wp.zeros(nodes, dtype=self._vec, device="cpu")
        grid_m = wp.zeros(nodes, dtype=wp.float32, device="cpu")
        grid, state = [grid_v, grid_m], [self._x, self._v, self._C]
        calls = (
            ("clear", nodes, grid),
            ("scatter", count, [*state, self._tau, self._J, mass, volume, *grid, s]),
            ("update", nodes, [*grid, s]),
            ("gather", count, [*state, self._F, self._tau, self._J, self._gain, grid_v, s]),
        )
        # Recorded launches spare Python's part of each.
        self._launches = [
            wp.launch(getattr(made, name), dim=size, inputs=inputs, device="cpu", record_cmd=True)
            for name, size, inputs in calls
        ]
        self.load(particles.x, particles.v, still, np.ones(count, dtype=np.float32))

    def load(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        affine: npt.NDArray[np.float32],
        volume_ratio: npt.NDArray[np.float32],
    ) -> None:
        """Take over a state, as `taichi_mpm.Solver.load` does."""
        for field, values in ((self._x, x), (self._v, v), (self._C, affine), (self._J, volume_ratio)):
            field.assign(values)
        # Sand bears no tension.
        strain = np.minimum(np.log(volume_ratio), 0)[:, None, None] * np.eye(self._dim) / self._dim
        self._F.assign((np.exp(strain) * np.eye(self._dim)).astype(np.float32))
        self._tau.assign((self._stiffness * strain).astype(np.float32))
        self._gain.zero_()

    def advance(self, frames: int) -> None:
        """Advance by whole frames."""
        for _ in range(frames * self._substeps):
            for launch in self._launches:
                launch.launch()

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Positions (N, D) [m], a copy."""
        x: npt.NDArray[np.float32] = self._x.numpy().copy()
        return x
