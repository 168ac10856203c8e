"""The kernels of a substep of MLS-MPM in plain Warp.

Warp reads the annotations of kernels as its own types, which no type checker knows.
"""

from types import SimpleNamespace

import warp as wp

from hybridmpm_lab.speed.baselines.constants import LOSS, SMALLEST_STRETCH

_SMALLEST_STRETCH = wp.constant(SMALLEST_STRETCH)
_LOSS = wp.constant(LOSS)


def kernels(dim: int, *, water: bool) -> SimpleNamespace:
    """Return the kernels of a substep for one dimension and material."""
    vec = wp.types.vector(length=dim, dtype=wp.float32)
    mat = wp.types.matrix(shape=(dim, dim), dtype=wp.float32)
    ivec = wp.types.vector(length=dim, dtype=wp.int32)

    @wp.struct
    class Setting:
        dt: wp.float32
        dx: wp.float32
        per_dx: wp.float32
        resolution: wp.int32
        gravity: vec
        lowest: ivec
        highest: ivec
        friction: wp.float32
        bulk_modulus: wp.float32
        tension: wp.float32
        mu: wp.float32
        lam: wp.float32
        alpha: wp.float32
        slow: wp.float32
        keeps_volume: wp.int32

    @wp.func
    def spline(step: int, fx: float) -> float:
        a = 1.5 - fx
        b = fx - 1.0
        c = fx - 0.5
        if step == 0:
            return 0.5 * a * a
        if step == 1:
            return 0.75 - b * b
        return 0.5 * c * c

    @wp.func
    def offset_of(flat: int) -> ivec:
        offset = ivec()
        rest = flat
        for axis in range(dim):
            offset[dim - 1 - axis] = rest % 3
            rest = rest / 3
        return offset

    @wp.func
    def node_of(base: ivec, offset: ivec, resolution: int) -> int:
        node = 0
        for axis in range(dim):
            node = node * resolution + base[axis] + offset[axis]
        return node

    @wp.func
    def base_of(x: vec, per_dx: float) -> ivec:
        base = ivec()
        for axis in range(dim):
            base[axis] = int(x[axis] * per_dx - 0.5)
        return base

    @wp.kernel(enable_backward=False, module="unique")
    def clear(grid_v: wp.array(dtype=vec), grid_m: wp.array(dtype=float)):
        node = wp.tid()
        grid_v[node] = vec()
        grid_m[node] = 0.0

    @wp.kernel(enable_backward=False, module="unique", module_options={"max_unroll": 27})
    def scatter(
        x: wp.array(dtype=vec), v: wp.array(dtype=vec), C: wp.array(dtype=mat), tau: wp.array(dtype=mat),
        J: wp.array(dtype=float), mass: wp.array(dtype=float), volume: wp.array(dtype=float),
        grid_v: wp.array(dtype=vec), grid_m: wp.array(dtype=float), s: Setting,
    ):  # fmt: skip
        p = wp.tid()
        base = base_of(x[p], s.per_dx)
        fx = x[p] * s.per_dx - vec(base)
        stress = tau[p]
        if wp.static(water):
            pressure = s.bulk_modulus * J[p] * (J[p] - 1.0)
            if J[p] > 1.0:
                pressure = pressure * s.tension
            stress = wp.identity(n=dim, dtype=float) * pressure
        affine = C[p] * mass[p] - stress * (s.dt * 4.0 * s.per_dx * s.per_dx * volume[p])
        momentum = v[p] * mass[p]
        for flat in range(wp.static(3**dim)):
            offset = offset_of(flat)
            weight = 1.0
            for axis in range(dim):
                weight = weight * spline(offset[axis], fx[axis])
            dpos = (vec(offset) - fx) * s.dx
            node = node_of(base, offset, s.resolution)
            wp.atomic_add(grid_v, node, (momentum + affine * dpos) * weight)
            wp.atomic_add(grid_m, node, weight * mass[p])

    @wp.kernel(enable_backward=False, module="unique")
    def update(grid_v: wp.array(dtype=vec), grid_m: wp.array(dtype=float), s: Setting):
        node = wp.tid()
        if grid_m[node] > 0.0:
            v = grid_v[node] / grid_m[node] + s.gravity * s.dt
            rest = node
            for back in range(dim):
                axis = dim - 1 - back
                place = rest % s.resolution
                rest = rest / s.resolution
                push = 0.0
                if place <= s.lowest[axis]:
                    push = wp.max(0.0, -v[axis])
                if place >= s.highest[axis]:
                    push = wp.max(0.0, v[axis])
                if push > 0.0:
                    v[axis] = 0.0
                    if s.friction > 0.0:
                        v = v * wp.max(0.0, 1.0 - s.friction * push / wp.max(wp.length(v), 1.0e-20))
            grid_v[node] = v

    @wp.func
    def return_sand(F: mat, gain: float, rate: float, s: Setting):
        if wp.static(dim == 2):
            U, sigma, V = wp.svd2(F)
        else:
            U, sigma, V = wp.svd3(F)
        strain = vec()
        trace = 0.0
        for axis in range(dim):
            strain[axis] = wp.log(wp.max(sigma[axis], _SMALLEST_STRETCH)) + gain / float(dim)
            trace = trace + strain[axis]
        gained = 0.0
        if trace >= 0.0:
            strain = vec()
            if s.keeps_volume == 1:
                gained = trace
        else:
            deviator = strain
            for axis in range(dim):
                deviator[axis] = strain[axis] - trace / float(dim)
            norm = wp.length(deviator)
            excess = norm + (float(dim) * s.lam + 2.0 * s.mu) / (2.0 * s.mu) * trace * s.alpha
            if excess > 0.0:
                strain = strain - deviator * (excess / norm)
            given_up = _LOSS * s.dt * wp.max(rate - s.slow, 0.0)
            strain = strain * (wp.min(trace + given_up, 0.0) / trace)
        stretch = vec()
        stress = vec()
        trace = 0.0
        for axis in range(dim):
            trace = trace + strain[axis]
        for axis in range(dim):
            stretch[axis] = wp.exp(strain[axis])
            stress[axis] = 2.0 * s.mu * strain[axis] + s.lam * trace
        left = U * wp.diag(stretch) * wp.transpose(V)
        return left, U * wp.diag(stress) * wp.transpose(U), gained

    @wp.kernel(enable_backward=False, module="unique", module_options={"max_unroll": 27})
    def gather(
        x: wp.array(dtype=vec), v: wp.array(dtype=vec), C: wp.array(dtype=mat), F: wp.array(dtype=mat),
        tau: wp.array(dtype=mat), J: wp.array(dtype=float), gain: wp.array(dtype=float),
        grid_v: wp.array(dtype=vec), s: Setting,
    ):  # fmt: skip
        p = wp.tid()
        base = base_of(x[p], s.per_dx)
        fx = x[p] * s.per_dx - vec(base)
        new_v = vec()
        new_C = mat()
        for flat in range(wp.static(3**dim)):
            offset = offset_of(flat)
            weight = 1.0
            for axis in range(dim):
                weight = weight * spline(offset[axis], fx[axis])
            g_v = grid_v[node_of(base, offset, s.resolution)] * weight
            new_v = new_v + g_v
            new_C = new_C + wp.outer(g_v, vec(offset) - fx) * (4.0 * s.per_dx)
        v[p] = new_v
        C[p] = new_C
        x[p] = x[p] + new_v * s.dt
        if wp.static(water):
            J[p] = J[p] * (1.0 + s.dt * wp.trace(new_C))
        else:
            trial = (wp.identity(n=dim, dtype=float) + new_C * s.dt) * F[p]
            elastic, stress, gained = return_sand(trial, gain[p], wp.trace(new_C), s)
            F[p] = elastic
            tau[p] = stress
            gain[p] = gained

    return SimpleNamespace(
        vec=vec,
        mat=mat,
        ivec=ivec,
        Setting=Setting,
        clear=clear,
        scatter=scatter,
        update=update,
        gather=gather,
    )
