"""MLS-MPM in plain Taichi, after its examples mpm88 and mpm3d; the same kernels run on its fork quadrants.

Dense grid, quadratic B-splines, APIC, float32:
https://github.com/taichi-dev/taichi/tree/v1.7.4/python/taichi/examples/simulation

Materials and constants are those of rust/mpm, water without its volume correction. Walls are those of the
examples: they act on the nodes at or beyond them, not at their true position.
"""

import contextlib
import io
import os

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene
from hybridmpm_lab.speed.baselines.constants import LOSS, SMALLEST_STRETCH, Constants

# Taichi greets when imported, asks its server for news when started, and comments on a redirected stdout.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "False")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")
os.environ.setdefault("TI_ENABLE_PYBUF", "0")
os.environ.setdefault("QD_ENABLE_PYBUF", "0")
import taichi as ti

NAME = f"{ti.__name__} " + ".".join(str(part) for part in ti.__version__)
WAYS = {"cpu": {"serial": 1, "serial_scatter": 2, "atomic": 2}, "cuda": {"atomic": 0}}
"""Threads of the CPU by device, and by the way in which the loops of a solver run.

"serial": each loop runs on one thread, which lets Taichi add to the grid without atomics. "atomic": each loop
runs on all threads, as in the examples. "serial_scatter": the loop that adds to the grid runs on one thread,
the others on all.
"""


def start(device: str) -> None:
    """Start Taichi afresh on a device of `WAYS`; solvers made before are void.

    Raises
    ------
    ConfigError
        Taichi cannot use the device.
    """
    arch = getattr(ti, device)
    with contextlib.redirect_stdout(io.StringIO()):  # it announces its backend
        ti.init(arch=arch, default_fp=ti.f32, cpu_max_num_threads=2, log_level=ti.ERROR)
    if device == "cuda" and ti.cfg.arch != arch:  # it takes the CPU then
        raise ConfigError(f"{NAME} finds no GPU of CUDA; choose the device cpu")


@ti.data_oriented
class Solver(Constants):
    """MLS-MPM for water or sand on Taichi; call `start` once before the first.

    Parameters and errors are those of `Constants`, a device, and one of its `WAYS`. N is the number of
    particles, D the dimension.
    """

    def __init__(self, scene: Scene, *, substeps: int, device: str, way: str) -> None:
        del device  # that of `start`
        super().__init__(scene, substeps)
        self._serial, self._serial_scatter = way == "serial", way != "atomic"
        self._gravity = ti.Vector(scene.gravity)
        # Nodes that particles between the walls can touch: sweeping no others is faster.
        self._first, self._end = [i - 2 for i in self.lowest], [i + 3 for i in self.highest]
        particles = scene.sample()
        n, dim = particles.x.shape
        self._count = n
        self._x, self._v = ti.Vector.field(dim, float, n), ti.Vector.field(dim, float, n)
        self._C = ti.Matrix.field(dim, dim, float, n)
        self._mass, self._volume = ti.field(float, n), ti.field(float, n)
        if self.water:
            self._J = ti.field(float, n)
        else:
            self._F, self._tau = (ti.Matrix.field(dim, dim, float, n) for _ in range(2))
            self._volume_gain = ti.field(float, n)
        # Velocity and mass of a node side by side: faster than two arrays.
        self._grid_v, self._grid_m = ti.Vector.field(dim, float), ti.field(float)
        nodes = ti.root.dense(ti.ij if dim == 2 else ti.ijk, scene.resolution)
        nodes.place(self._grid_v, self._grid_m)
        self._mass.from_numpy(particles.mass)
        self._volume.from_numpy(particles.volume)

    def load(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        affine: npt.NDArray[np.float32],
        volume_ratio: npt.NDArray[np.float32],
    ) -> None:
        """Take over positions [m], velocities [m/s], APIC matrices C [1/s] and J [-].

        Sand starts at F = J^(1/D) I: its shear and the volume that it gained are lost.
        """
        self._x.from_numpy(x)
        self._v.from_numpy(v)
        self._C.from_numpy(affine)
        if self.water:
            self._J.from_numpy(volume_ratio)
        else:
            F, tau = self.sand_state(volume_ratio)
            self._F.from_numpy(F)
            self._tau.from_numpy(tau)
            self._volume_gain.fill(0)

    def advance(self, frames: int) -> None:
        """Advance by whole frames, and wait until they are computed."""
        for _ in range(frames * self.substeps):
            self._substep()
        ti.sync()

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Positions (N, D) [m], a copy."""
        x: npt.NDArray[np.float32] = self._x.to_numpy()
        return x

    @ti.kernel
    def _substep(self):  # noqa: C901 - loops are parallel only at this level
        ti.loop_config(serialize=self._serial)
        for i in range(self._first[0], self._end[0]):
            for j in range(self._first[1], self._end[1]):
                if ti.static(self.dim == 2):
                    self._clear(ti.Vector([i, j]))
                else:
                    for k in range(self._first[2], self._end[2]):
                        self._clear(ti.Vector([i, j, k]))
        ti.loop_config(serialize=self._serial_scatter)
        for p in range(self._count):
            self._scatter(p)
        ti.loop_config(serialize=self._serial)
        for i in range(self._first[0], self._end[0]):
            for j in range(self._first[1], self._end[1]):
                if ti.static(self.dim == 2):
                    self._update(ti.Vector([i, j]))
                else:
                    for k in range(self._first[2], self._end[2]):
                        self._update(ti.Vector([i, j, k]))
        ti.loop_config(serialize=self._serial)
        for p in range(self._count):
            self._gather(p)

    @ti.func
    def _clear(self, node):
        self._grid_v[node] = ti.zero(self._grid_v[node])
        self._grid_m[node] = 0

    @ti.func
    def _scatter(self, p):
        base = int(self._x[p] * self.per_dx - 0.5)
        fx = self._x[p] * self.per_dx - base
        w = [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1) ** 2, 0.5 * (fx - 0.5) ** 2]
        tau = ti.Matrix.zero(float, self.dim, self.dim)
        if ti.static(self.water):
            tau = ti.Matrix.identity(float, self.dim) * self._water_stress(self._J[p])
        else:
            tau = self._tau[p]
        factor = self.dt * 4 * self.per_dx**2 * self._volume[p]
        affine = self._mass[p] * self._C[p] - factor * tau
        momentum = self._mass[p] * self._v[p]
        for offset in ti.static(ti.grouped(ti.ndrange(*[3] * self.dim))):
            dpos = (offset - fx) * self.dx
            weight = 1.0
            for i in ti.static(range(self.dim)):
                weight *= w[offset[i]][i]
            self._grid_v[base + offset] += weight * (momentum + affine @ dpos)
            self._grid_m[base + offset] += weight * self._mass[p]

    @ti.func
    def _water_stress(self, J):
        tau = self.bulk_modulus * J * (J - 1)
        return ti.select(J > 1, self.tension * tau, tau)

    @ti.func
    def _update(self, node):
        if self._grid_m[node] > 0:
            v = self._grid_v[node] / self._grid_m[node] + self.dt * self._gravity
            for i in ti.static(range(self.dim)):
                push = 0.0
                if node[i] <= self.lowest[i]:
                    push = ti.max(0, -v[i])
                if node[i] >= self.highest[i]:
                    push = ti.max(0, v[i])
                if push > 0:
                    v[i] = 0
                    if ti.static(self.friction > 0):
                        v *= ti.max(0, 1 - self.friction * push / ti.max(v.norm(), 1e-20))
            self._grid_v[node] = v

    @ti.func
    def _gather(self, p):
        base = int(self._x[p] * self.per_dx - 0.5)
        fx = self._x[p] * self.per_dx - base
        w = [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1) ** 2, 0.5 * (fx - 0.5) ** 2]
        v, C = ti.zero(self._v[p]), ti.zero(self._C[p])
        for offset in ti.static(ti.grouped(ti.ndrange(*[3] * self.dim))):
            weight = 1.0
            for i in ti.static(range(self.dim)):
                weight *= w[offset[i]][i]
            g_v = weight * self._grid_v[base + offset]
            v += g_v
            C += 4 * self.per_dx * g_v.outer_product(offset - fx)
        self._v[p], self._C[p] = v, C
        self._x[p] += self.dt * v
        if ti.static(self.water):
            self._J[p] *= 1 + self.dt * C.trace()
        else:
            self._deform_sand(p)

    @ti.func
    def _deform_sand(self, p):
        dim, mu, lam = ti.static(self.dim, self.mu, self.lam)
        U, sigma, V = ti.svd((ti.Matrix.identity(float, dim) + self.dt * self._C[p]) @ self._F[p])
        strain = ti.Vector.zero(float, dim)
        for i in ti.static(range(dim)):
            strain[i] = ti.log(ti.max(sigma[i, i], SMALLEST_STRETCH)) + self._volume_gain[p] / dim
        trace, gained = strain.sum(), 0.0
        if trace >= 0:
            strain = ti.zero(strain)
            if ti.static(self.volume_correction):
                gained = trace
        else:
            deviator = strain - trace / dim
            norm = deviator.norm()
            excess = norm + (dim * lam + 2 * mu) / (2 * mu) * trace * self.alpha
            if excess > 0:
                strain -= deviator * (excess / norm)
            given_up = LOSS * self.dt * ti.max(self._C[p].trace() - self.slow, 0.0)
            strain *= ti.min(trace + given_up, 0.0) / trace
        stretch, tau, trace = ti.zero(sigma), ti.zero(sigma), strain.sum()
        for i in ti.static(range(dim)):
            stretch[i, i] = ti.exp(strain[i])
            tau[i, i] = 2 * mu * strain[i] + lam * trace
        self._F[p], self._volume_gain[p] = U @ stretch @ V.transpose(), gained
        self._tau[p] = U @ tau @ U.transpose()
