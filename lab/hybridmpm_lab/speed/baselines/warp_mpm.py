"""MLS-MPM in plain Warp, whose kernels run on one thread of a CPU, or on a GPU.

Dense grid, quadratic B-splines, APIC, float32. Materials, constants and walls are those of `taichi_mpm`.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene
from hybridmpm_lab.speed.baselines.constants import Constants
from hybridmpm_lab.speed.baselines.warp_kernels import kernels

wp.config.log_level = wp.LOG_WARNING

NAME = f"warp {wp.__version__}"
WAYS = {"cpu": {"plain": 1}, "cuda": {"captured": 0}}
"""Threads of the CPU by device, and by the way in which a solver runs.

"captured": the launches of a frame are one graph of CUDA, which spares the CPU's part of each.
"""


def start(device: str) -> None:
    """Start Warp; raises `ConfigError` where it cannot use a device of `WAYS`."""
    wp.init()
    if device == "cuda" and not wp.is_cuda_available():
        raise ConfigError(f"{NAME} finds no GPU of CUDA; choose the device cpu")


class Solver(Constants):
    """MLS-MPM for water or sand on Warp; parameters, methods and limits are `taichi_mpm.Solver`'s."""

    def __init__(self, scene: Scene, *, substeps: int, device: str, way: str) -> None:
        super().__init__(scene, substeps)
        self._device = device
        made = kernels(scene.dim, water=self.water)
        s = made.Setting()
        for name in (
            "dt",
            "dx",
            "per_dx",
            "resolution",
            "friction",
            "bulk_modulus",
            "tension",
            "mu",
            "lam",
            "alpha",
            "slow",
        ):
            setattr(s, name, getattr(self, name))
        s.keeps_volume, s.gravity = int(self.volume_correction), made.vec(*scene.gravity)
        s.lowest, s.highest = made.ivec(*self.lowest), made.ivec(*self.highest)
        particles = scene.sample()
        count, nodes = len(particles.x), scene.resolution**scene.dim

        def zeros(size: int, dtype: Any = wp.float32) -> Any:
            return wp.zeros(size, dtype=dtype, device=device)

        self._x, self._v = zeros(count, made.vec), zeros(count, made.vec)
        self._C, self._F, self._tau = (zeros(count, made.mat) for _ in range(3))
        self._J, self._gain = zeros(count), zeros(count)
        mass, volume = (
            wp.array(one, dtype=wp.float32, device=device) for one in (particles.mass, particles.volume)
        )
        grid_v, grid_m = zeros(nodes, made.vec), zeros(nodes)
        grid, state = [grid_v, grid_m], [self._x, self._v, self._C]
        calls = (
            ("clear", nodes, grid),
            ("scatter", count, [*state, self._tau, self._J, mass, volume, *grid, s]),
            ("update", nodes, [*grid, s]),
            ("gather", count, [*state, self._F, self._tau, self._J, self._gain, grid_v, s]),
        )
        # Recorded launches spare Python's part of each.
        self._launches = [
            wp.launch(getattr(made, name), dim=size, inputs=inputs, device=device, record_cmd=True)
            for name, size, inputs in calls
        ]
        self._is_captured = way == "captured"
        self._frame: Any = None

    def load(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        affine: npt.NDArray[np.float32],
        volume_ratio: npt.NDArray[np.float32],
    ) -> None:
        """Take over a state, as `taichi_mpm.Solver.load` does."""
        fields = (self._x, self._v, self._C, self._J, self._F, self._tau)
        values = (x, v, affine, volume_ratio, *self.sand_state(volume_ratio))
        for field, value in zip(fields, values, strict=True):
            field.assign(value)
        self._gain.zero_()

    def advance(self, frames: int) -> None:
        """Advance by whole frames, and wait until they are computed."""
        for _ in range(frames):
            if self._frame is not None:
                wp.capture_launch(self._frame)
                continue
            self._launch_frame()  # before a capture, which must not compile
            if self._is_captured:
                with wp.ScopedCapture(device=self._device) as capture:
                    self._launch_frame()
                self._frame = capture.graph
        wp.synchronize_device(self._device)

    def _launch_frame(self) -> None:
        for _ in range(self.substeps):
            for launch in self._launches:
                launch.launch()

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Positions (N, D) [m], a copy."""
        x: npt.NDArray[np.float32] = self._x.numpy().copy()
        return x
