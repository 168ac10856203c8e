"""Every array that reaches the compiled module is read in the order of its indices, or refused in a sentence.

Each array argument that the stub names is passed in every layout that NumPy has. The result has the same bits
as that of the plain array. Only an array to write to must be plain.
"""

import ast
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import (
    Box,
    ConfigError,
    ForceError,
    MpmBatch,
    MpmSolver,
    Scene,
    SceneError,
    SketchError,
    _native,
    control,
    metrics,
    probes,
    radius_graph,
    scenarios,
)

Array = npt.NDArray[Any]
Call = Callable[..., object]
STUB = ast.parse(Path(_native.__file__).with_name("_native.pyi").read_text(encoding="utf-8"))
N = 64
RNG = np.random.default_rng(5)
X = RNG.uniform(0.2, 0.8, (N, 2)).astype(np.float32)
V = RNG.normal(0, 0.1, (N, 2)).astype(np.float32)
ONE = np.linspace(0.5, 1.5, N, dtype=np.float32)
WATER = _native.Material.water(density=1000.0, bulk_modulus=1e5)
KIND = (np.arange(N) % 2).astype(np.uint8)
BALL = _native.Obstacle.ball((0.5, 0.5), 0.2)
RIGID = _native.RigidBody.ball(
    (0.5, 0.5),
    0.2,
    rotation=(0.0,),
    density=500.0,
    velocity=(0.0, 0.0),
    angular_velocity=(0.0,),
    friction=0.3,
    restitution=0.0,
)
SPACE = np.array([[0.2, 0.2, 0.2], [0.8, 0.2, 0.2], [0.2, 0.8, 0.2], [0.2, 0.2, 0.8]], dtype=np.float32)
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], dtype=np.uint32)
LINES = {"lines": RNG.uniform(size=(12, 2)), "starts": np.array([0, 5, 12], dtype=np.uint32)}
IDS = np.arange(N, dtype=np.uint64)
GRAPH = _native.radius_graph(X, 0.2)
PARTICLES = {"x": X, "v": V, "material": KIND, "mass": 1e-2 * ONE, "volume": 1e-5 * ONE}
BOX = {"frame_dt": 0.0025, "gravity": (0, -9.8), "wall_lower": (0.1, 0.1), "wall_upper": (0.9, 0.9)}
SPHERE = np.array([[0.5, 0.3, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]])
COARSE = {
    "ids": IDS,
    "x": X,
    "affine": RNG.normal(size=(N, 2, 2)).astype(np.float32),
    "mass": ONE,
    "rigid": SPHERE,
}


def _solver(**arrays: Array) -> _native.Solver:
    return _native.Solver(resolution=16, materials=[WATER, WATER], **BOX, **(PARTICLES | arrays))


def _upsampler(**arrays: Array) -> _native.Upsampler:
    floating = _native.Solver(resolution=16, materials=[WATER, WATER], rigid=[RIGID], **BOX, **PARTICLES)
    return _native.Upsampler(floating, resolution=32, **(PARTICLES | arrays))


def _updated(frame: int, **arrays: Array) -> _native.Upsampler:
    upsampler = _upsampler()
    upsampler.update(frame, **arrays)
    return upsampler


def _advanced(force: Array, out: Array | None = None) -> tuple[object, ...]:
    solver = _solver()
    solver.advance(3, force, out)
    return solver, out


def _all_advanced(force: Array) -> _native.Solver:
    solver = _solver()
    _native.advance_all([solver], 1, [force])
    return solver


def _prescribed(x: Array, v: Array) -> _native.Solver:
    solver = _solver()
    solver.prescribe(x, v, 1)
    return solver


def _pushed(x: Array) -> bytes:
    settings = {"window": 2, "dt": 0.1, "calm_acceleration": 0.1, "min_active_share": 0.1}
    history = _native.AccelerationHistory(N, 2, **settings)
    history.push(x)
    return history.snapshot()


def _emitted(sites: Array, jitter: Array) -> _native.Solver:
    emitter = {"material": 0, "velocity": (1, 0), "spacing": 1e-3, "mass": 0.1, "volume": 1e-4}
    opening = _native.Emitter(sites=sites, jitter=jitter, **emitter)
    solver = _native.Solver(resolution=16, materials=[WATER, WATER], emitters=[opening], **BOX, **PARTICLES)
    solver.advance(2)
    return solver


def _weights(**arrays: Array) -> Array:
    numbers = {"radius": 0.2, "scale": (0.1, 0.1), "hops": 2, "quiet": 0.5, "unnoticed": 0.0, "most": 9.0}
    return _native.answer_weights(**arrays, **numbers, lower=(0.1, 0.1), upper=(0.9, 0.9))


CELLS = RNG.uniform(size=(9 * N, 2))
ROOM = RNG.uniform(0.1, 1.0, (9, 7))
LINES = {"lines": RNG.uniform(size=(12, 2)), "starts": np.array([0, 5, 12], dtype=np.uint32)}
IDS = np.arange(N, dtype=np.uint64)
WAYS = {
    "ids": IDS,
    "weight": np.full(N, 1 / N),
    "starts": np.array([0, 2, 4], dtype=np.uint32),
    "times": np.array([0.0, 1.0, 0.0, 2.0]),
    "corners": X[:4].astype(float),
    "v": V[:4].astype(float),
    "group": (np.arange(N) % 2).astype(np.uint32),
    "places": (X + V).astype(float),
    "cells": CELLS,
    "distance": ROOM,
}


def _ways(**arrays: Array) -> _native.Ways:
    numbers = {"frame_dt": 0.1, "smoothing": 8, "cap": 50.0, "ahead": 1, "unit": 1.0, "end": None}
    grid = {"lower": (0, 0), "spacing": 0.1, "side": 0.1, "settling": (2, 9)}
    return _native.Ways(gravity=(0, -9.8), **numbers, **grid, **arrays)


PRESENT = {"ids": IDS, "x": X, "v": V}
FORCE = RNG.normal(size=(3, N, 2)).astype(np.float32)
WALLS = {"sites": X[:4], "jitter": np.zeros((3, 4, 2), dtype=np.float32)}
NATIVE: dict[str, tuple[Call, dict[str, Array]]] = {
    "Obstacle.signed_distance": (BALL.signed_distance, {"x": X}),
    "RigidBody.signed_distance": (RIGID.signed_distance, {"x": X}),
    "Obstacle.polygon": (
        lambda vertices: _native.Obstacle.polygon(vertices).signed_distance(X),
        {"vertices": X[:8]},
    ),
    "Obstacle.mesh": (
        lambda vertices, triangles: _native.Obstacle.mesh(vertices, triangles).signed_distance(SPACE),
        {"vertices": SPACE, "triangles": TETRAHEDRON},
    ),
    "Obstacle.moved": (lambda x: BALL.moving(velocity=(0.1, 0.2)).moved(x, 0.5), {"x": X}),
    "Emitter.__new__": (_emitted, WALLS),
    "AccelerationHistory.push": (_pushed, {"x": X}),
    "Solver.__new__": (_solver, PARTICLES | {"volume_ratio": ONE, "body": np.arange(N, dtype=np.uint32) % 3}),
    "Solver.advance": (_advanced, {"force": FORCE, "out": np.zeros((3, N, 2), dtype=np.float32)}),
    "Solver.prescribe": (_prescribed, {"x": X, "v": V}),
    "Upsampler.__new__": (_upsampler, PARTICLES),
    "Upsampler.update": (lambda **a: _updated(4, **a), COARSE),
    "Upsampler.positions": (lambda **a: _upsampler().positions(1, **a), COARSE),
    "Upsampler.velocities": (lambda **a: _upsampler().velocities(1, **a), COARSE | {"v": V}),
    "Upsampler.gather_force": (lambda force: _upsampler().gather_force(force), {"force": FORCE[0]}),
    "advance_all": (_all_advanced, {"force": FORCE[:1]}),
    "grid_mass": (lambda x, mass: _native.grid_mass(x, mass, 16), {"x": X, "mass": ONE}),
    "RadiusGraph.__new__": (
        lambda starts, senders: _native.RadiusGraph(starts, senders, 0.2),
        {"starts": GRAPH.starts, "senders": GRAPH.senders},
    ),
    "radius_graph": (lambda x, types: _native.radius_graph(x, 0.2, types), {"x": X, "types": KIND}),
    "answer_weights": (
        _weights,
        {
            "history": np.stack([X, X + V, X]),
            "known_acceleration": V,
            "starts": GRAPH.starts,
            "senders": GRAPH.senders,
        },
    ),
    "FreeSpace.__new__": (
        lambda distance: (
            _native.match_to_region(X.astype(float), CELLS, _native.FreeSpace((0, 0), 0.1, distance)).ways
        ),
        {"distance": ROOM},
    ),
    "match_to_region": (
        lambda x, cells: _native.match_to_region(x, cells).places,
        {"x": X.astype(float), "cells": CELLS},
    ),
    "pressed": (
        lambda cells: _native.pressed(
            cells,
            0.05,
            lower=(0, 0),
            upper=(1, 1),
            volume=0.05**2 * len(CELLS),
            particles=len(CELLS) // 6,
            free=lambda x: np.ones(len(x), dtype=bool),
        ),
        {"cells": CELLS},
    ),
    "least_acceleration": (
        lambda points: _native.least_acceleration(points, (0, 0), (0, 0), 1.0).times,
        {"points": X[:5].astype(float)},
    ),
    "Outlines.__new__": (lambda **a: _native.Outlines(**a).area, LINES),
    "Outlines.covers": (lambda x: _native.Outlines(**LINES).covers(x), {"x": CELLS}),
    "push_force": (
        lambda **a: _native.push_force(
            **a, point=(0.5, 0.5), velocity=(1, 0), radius=0.3, cap=15.0, frame_dt=0.0025
        ),
        {"x": X, "v": V},
    ),
    "Ways.__new__": (lambda **a: _ways(**a).force(3, **PRESENT), WAYS),
    "Ways.force": (lambda **a: _ways(**WAYS).force(3, **a), PRESENT),
}
SCENE = scenarios.water_2d(seed=1)
COUNT = MpmSolver(SCENE).particle_count
SKETCH = np.array([[0.2, 0.3], [0.4, 0.5], [0.7, 0.5]])


def _forced(force: Any) -> MpmSolver:
    solver = MpmSolver(SCENE)
    solver.advance(1, force)
    return solver


def _batched(force: Array) -> MpmSolver:
    batch = MpmBatch([SCENE])
    batch.advance(1, [force])
    return batch[0]


PUBLIC: dict[str, tuple[Call, dict[str, Array]]] = {
    "radius_graph": (lambda x: radius_graph(x, 0.1), {"x": X}),
    "MpmSolver.advance": (_forced, {"force": RNG.normal(size=(COUNT, 2)).astype(np.float32)}),
    "MpmSolver.advance, pair": (
        lambda accelerations, ids: _forced((ids, accelerations)),
        {"accelerations": V, "ids": IDS},
    ),
    "MpmSolver.prescribe": (
        lambda x, v: MpmSolver(SCENE).prescribe(x, v, 1),
        {name: np.resize(values, (COUNT, 2)) for name, values in (("x", X), ("v", V))},
    ),
    "metrics.grid_mass": (lambda x, mass: metrics.grid_mass(x, mass, 16), {"x": X, "mass": ONE}),
    "metrics.grid_rmse": (metrics.grid_rmse, {"predicted": ROOM, "true": ROOM[::-1].copy()}),
    "metrics.energy_error": (metrics.energy_error, {"predicted": ONE, "true": 2 * ONE}),
    "metrics.centroid_error": (
        metrics.centroid_error,
        {"predicted": X, "predicted_mass": ONE, "true": X + V, "true_mass": ONE},
    ),
    "probes.Pressure": (lambda points: MpmSolver(SCENE).probe(probes.Pressure(points)), {"points": X[:4]}),
    "metrics.potential_energy": (
        metrics.potential_energy,
        {"x": X, "mass": ONE, "gravity": np.array([0.5, -9.81])},
    ),
    **{
        f"metrics.{distance.__name__}": (
            distance,
            {"predicted": X, "predicted_mass": ONE, "true": X + V, "true_mass": ONE},
        )
        for distance in (metrics.sinkhorn_distance, metrics.sliced_distance, metrics.transport_distance)
    },
    "Scene": (
        lambda lower, velocity, gravity: Scene(
            dim=2,
            gravity=gravity,
            bodies=[Box(material="water", lower=lower, upper=(0.5, 0.5), velocity=velocity)],
        ),
        {"lower": np.array([0.2, 0.3]), "velocity": V[0].astype(float), "gravity": np.array([0.5, -9.81])},
    ),
    "Box.contains": (SCENE.bodies[0].contains, {"x": X.astype(float)}),
    "control.Ellipse": (
        lambda center, axes: control.Ellipse(center, axes, 0.3).outline(9),
        {"center": np.array([0.5, 0.4]), "axes": np.array([0.2, 0.1])},
    ),
    "control.classify_stroke": (control.classify_stroke, {"points": SKETCH}),
    "MpmBatch.advance": (
        _batched,
        {"force": RNG.normal(size=(COUNT, 2)).astype(np.float32)},
    ),
    "probes.Flow": (
        lambda start, end: MpmSolver(SCENE).probe(probes.Flow(start, end)),
        {"start": np.array([0.2, 0.1]), "end": np.array([0.2, 0.6])},
    ),
    "control.Arrow": (lambda points: control.Arrow(points).points, {"points": SKETCH}),
    "control.push": (
        lambda point, velocity: control.push(point, velocity, 0.1)(MpmSolver(SCENE)),
        {"point": X[0], "velocity": V[0]},
    ),
}


def _memory_mapped(array: Array, folder: Path) -> Array:
    np.save(folder / "array.npy", array)
    mapped: Array = np.load(folder / "array.npy", mmap_mode="r")
    return mapped


def _unaligned(array: Array, _: Path) -> Array:
    return np.frombuffer(b"\0" + array.tobytes(), dtype=array.dtype, offset=1).reshape(array.shape)


def _spread(array: Array, _: Path) -> Array:
    wide = np.full([3 * size for size in array.shape], 7, dtype=array.dtype)
    every = (slice(1, None, 3),) * array.ndim
    wide[every] = array
    return wide[every]


def _backwards(array: Array, _: Path) -> Array:
    every = (slice(None, None, -1),) * array.ndim
    return array[every].copy()[every]


def _read_only(array: Array, _: Path) -> Array:
    copy = array.copy()
    copy.flags.writeable = False
    return copy


LAYOUTS: dict[str, Callable[[Array, Path], Array]] = {
    "Fortran order": lambda array, _: np.asfortranarray(array),
    "strides": _spread,
    "negative strides": _backwards,
    "swapped bytes": lambda array, _: array.astype(array.dtype.newbyteorder()),
    "unaligned": _unaligned,
    "read-only": _read_only,
    "memory-mapped": _memory_mapped,
}
REFUSED: dict[str, Callable[[Array], Any]] = {
    "masked": lambda array: np.ma.masked_array(array, mask=np.arange(array.size).reshape(array.shape) == 1),
    "0-d": lambda array: np.array(array.ravel()[0]),
    "text": lambda array: np.full(array.shape, "one"),
    "object": lambda array: np.full(array.shape, object()),
}


def _bits(result: object) -> object:
    """Return all that can be read off a result, for comparison."""
    match result:
        case np.ndarray():
            return result.shape, np.ascontiguousarray(result).tobytes()
        case tuple():
            return [_bits(one) for one in result]
        case _native.Solver() | _native.Upsampler() | MpmSolver():
            return result.snapshot()
        case _native.RadiusGraph():
            return [_bits(one) for one in (result.starts, result.senders, result.receivers)]
    return repr(result)


def _arguments() -> Iterator[tuple[str, str]]:
    """Yield each array argument in the stub, by the name of its function."""
    functions = [("", node) for node in STUB.body]
    functions += [
        (f"{cls.name}.", node) for cls in STUB.body if isinstance(cls, ast.ClassDef) for node in cls.body
    ]
    for owner, node in functions:
        for one in (*node.args.args, *node.args.kwonlyargs) if isinstance(node, ast.FunctionDef) else ():
            if one.annotation is not None and "NDArray" in ast.unparse(one.annotation):
                yield f"{owner}{node.name}", one.arg


def test_every_array_argument_of_the_compiled_module_is_tried() -> None:
    tried = {(name, argument) for name, (_, arrays) in NATIVE.items() for argument in arrays}
    assert set(_arguments()) == tried


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", [*NATIVE, *(f"public {name}" for name in PUBLIC)])
def test_arrays_are_read_in_the_order_of_their_indices(name: str, layout: str, tmp_path: Path) -> None:
    call, arrays = NATIVE[name] if name in NATIVE else PUBLIC[name.removeprefix("public ")]

    def fresh() -> dict[str, Array]:
        return {one: array.copy() for one, array in arrays.items()}

    plain = _bits(call(**fresh()))
    for argument, array in arrays.items():
        other = LAYOUTS[layout](array, tmp_path)
        assert np.array_equal(other, array)
        changed = fresh() | {argument: other}
        if argument == "out":
            with pytest.raises(ConfigError, match="C-contiguous and writable"):
                call(**changed)
        else:
            assert _bits(call(**changed)) == plain, argument


@pytest.mark.parametrize("kind", REFUSED)
@pytest.mark.parametrize("name", [*NATIVE, *(f"public {name}" for name in PUBLIC)])
def test_what_is_no_such_array_is_refused_in_a_sentence(name: str, kind: str) -> None:
    call, arrays = NATIVE[name] if name in NATIVE else PUBLIC[name.removeprefix("public ")]
    for argument, array in arrays.items():
        with pytest.raises((ConfigError, ForceError, SceneError, SketchError)) as caught:
            call(**(arrays | {argument: REFUSED[kind](array)}))
        text = str(caught.value)
        assert "\n" not in text
        assert len(text) < 300
        if kind == "masked":
            assert "mask" in text
