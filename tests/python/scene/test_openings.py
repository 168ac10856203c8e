"""Emitters and sinks: the balance of mass, what stops an emitter, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.conftest import native_solver

from hybridmpm import (
    Box,
    BoxObstacle,
    BoxSink,
    ConfigError,
    Motion,
    MpmBatch,
    MpmSolver,
    ParticleLimitWarning,
    RectangularEmitter,
    RoundEmitter,
    Scene,
    SceneError,
    SegmentObstacle,
    SnapshotError,
    Walls,
    _native,
)
from hybridmpm.export import Style, save
from hybridmpm.recording import record

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "water-wheel.yaml"
JET = RectangularEmitter(material="water", lower=(0.48, 0.85), upper=(0.56, 0.85), velocity=(0.0, -1.5))
DRAIN = BoxSink(lower=(0.1, 0.1), upper=(0.9, 0.16))


def scene(*emitters: Any, **fields: Any) -> Scene:
    return Scene(**{"dim": 2, "resolution": 64, "bodies": (), "emitters": emitters} | fields)


def fountain(dim: int) -> Scene:
    """Sand and water from two openings, onto a block of water over a drain."""
    extent = (0.48,) * (dim - 2)
    block = Box(material="water", lower=(0.15, 0.2, *extent), upper=(0.3, 0.3, *(0.6,) * (dim - 2)))
    across, zero = (0.5,) * (dim - 2), (0.0,) * (dim - 2)
    up = RoundEmitter(material="water", center=(0.5, 0.4, *across), radius=0.05, velocity=(0.7, 1.0, *zero))
    down = RoundEmitter(
        material="sand",
        center=(0.3, 0.8, *across),
        radius=0.04,
        velocity=(0.0, -2.0, *zero),
        stop=0.15,
        seed=4,
    )
    drain = BoxSink(lower=(0.1,) * dim, upper=(0.9, 0.15, *(0.9,) * (dim - 2)))
    resolution = 64 if dim == 2 else 32
    return Scene(dim=dim, resolution=resolution, bodies=(block,), emitters=(up, down), sinks=(drain,))


@pytest.mark.parametrize("dim", [2, 3])
def test_mass_is_what_was_there_and_came_less_what_went(dim: int) -> None:
    solver = MpmSolver(fountain(dim))
    start = solver.diagnostics().mass
    known: set[int] = set()
    for _ in range(12):
        solver.advance(10)
        totals = solver.diagnostics()
        balance = start + totals.emitted_mass - totals.removed_mass
        assert totals.mass == pytest.approx(balance, rel=1e-12)
        assert totals.mass == pytest.approx(float(solver.mass.sum(dtype=np.float64)), rel=1e-12)
        ids = solver.ids
        assert len(ids) == solver.particle_count == len(solver.positions) == len(solver.materials)
        assert (np.diff(ids.astype(np.int64)) > 0).all()
        known |= set(ids.tolist())
    totals = solver.diagnostics()
    assert totals.emitted_mass > 0.2 * start
    assert totals.removed_mass > 0.2 * start
    assert solver.emitters == ("running", "ended")
    assert set(solver.materials.tolist()) == {5, 6}
    assert min(known) == 0


@pytest.mark.parametrize("dim", [2, 3])
def test_a_jet_brings_opening_times_speed_times_time(dim: int) -> None:
    spacing = 1 / 128 if dim == 2 else 1 / 64
    half = 4 * spacing
    across = (0.5,) * (dim - 2)
    opening = RectangularEmitter(
        material="water",
        lower=(0.5 - half, 0.85, *(c - half for c in across)),
        upper=(0.5 + half, 0.85, *(c + half for c in across)),
        velocity=(0.0, -1.3, *(0.0 for _ in across)),
        start=0.011,
        stop=0.107,
    )
    fields = {"dim": dim, "resolution": 64 if dim == 2 else 32, "bodies": (), "emitters": (opening,)}
    solver = MpmSolver(Scene(**fields))
    solver.advance(60)
    wanted = (2 * half) ** (dim - 1) * 1.3 * (0.107 - 0.011) * 1000
    layer = (2 * half) ** (dim - 1) * spacing * 1000
    assert wanted - layer <= solver.diagnostics().emitted_mass <= wanted + 1e-6 * wanted


def test_layers_leave_one_spacing_apart_also_when_a_frame_brings_several() -> None:
    weightless = scene(JET, gravity=(0.0, 0.0), frame_dt=0.01)
    solver = MpmSolver(weightless)
    solver.advance(20)
    rows = solver.positions[:, 1].reshape(-1, 10)
    gaps = -np.diff(rows.mean(axis=1)[::-1])
    # A frame brings almost two layers; the mean of ten particles wavers by their jitter.
    assert len(rows) == int(0.2 * 1.5 / weightless.spacing)
    assert abs(np.abs(gaps).mean() - weightless.spacing) < 0.02 * weightless.spacing
    assert np.abs(gaps).max() < 1.4 * weightless.spacing


def test_a_basin_fills_to_the_height_of_what_came() -> None:
    walls = Walls(lower=(0.3, 0.1), upper=(0.7, 0.9))
    pool = Box(material="water", lower=(0.3, 0.1), upper=(0.7, 0.2))
    # Poured gently: what plunges deep leaves voids that the solver closes only slowly.
    pour = RectangularEmitter(
        material="water", lower=(0.3, 0.24), upper=(0.3, 0.34), velocity=(0.5, 0.0), stop=0.6
    )
    solver = MpmSolver(scene(pour, walls=walls, bodies=(pool,)))
    solver.advance(1600)
    totals = solver.diagnostics()
    assert solver.emitters == ("ended",)
    came = totals.emitted_mass / 1000
    assert came == pytest.approx(0.6 * 0.5 * 0.1, rel=0.02)
    # A pool at rest has its centre of mass at half its height.
    height = 2 * (totals.centroid[1] - 0.1)
    assert height == pytest.approx(0.1 + came / 0.4, rel=0.04)


def test_a_fall_into_a_drain_keeps_the_number_of_particles() -> None:
    fall = scene(JET, sinks=(DRAIN,))
    solver = MpmSolver(fall)
    counts = []
    for _ in range(20):
        solver.advance(40)
        counts.append(solver.particle_count)
    # In flight are those of the last 0.26 s: 0.69 m at 1.5 m/s and g.
    flight = (np.sqrt(1.5**2 + 2 * 9.81 * 0.69) - 1.5) / 9.81
    assert np.mean(counts[5:]) == pytest.approx(10 * 1.5 * flight / fall.spacing, rel=0.05)
    assert max(counts[5:]) < 1.1 * min(counts[5:])


def test_an_opening_in_a_full_basin_waits_and_then_goes_on() -> None:
    walls = Walls(lower=(0.3, 0.1), upper=(0.7, 0.5))
    jet = RectangularEmitter(material="water", lower=(0.4, 0.48), upper=(0.6, 0.48), velocity=(0.0, -2.0))
    full = scene(jet, walls=walls)
    solver = MpmSolver(full)
    solver.advance(1600)
    assert solver.emitters == ("blocked",)
    totals = solver.diagnostics()
    room = 0.4 * 0.4
    # A jet that never weakens presses the water: there is more of it than fits at rest, by as much as J says.
    volume = totals.mass / 1000 * solver.volume_ratio.mean()
    assert 0.97 * room < volume < 1.025 * room
    assert totals.mass / 1000 < 1.05 * room
    assert totals.max_speed < 2.0
    assert totals.min_volume_ratio > 0.9
    held = solver.particle_count
    solver.advance(200)
    assert solver.particle_count < 1.01 * held


def test_a_gate_before_the_opening_stops_it_while_it_is_there() -> None:
    # The gate starts beside the jet and is in front of the opening from 0.05 s to 0.15 s.
    gate = BoxObstacle(lower=(0.2, 0.81), upper=(0.4, 0.85), motion=Motion(velocity=(1.6, 0.0)))
    solver = MpmSolver(scene(JET, obstacles=(gate,), gravity=(0.0, 0.0)))
    seen = []
    for _ in range(120):
        solver.advance(1)
        seen.append((solver.emitters[0], solver.diagnostics().emitted_mass))
    blocked = [frame for frame, (status, _) in enumerate(seen) if status == "blocked"]
    assert 15 <= min(blocked) <= 25
    assert seen[-1][0] == "running"
    assert seen[45][1] == seen[50][1] < seen[-1][1]


def test_sand_runs_through_a_neck_onto_a_pile() -> None:
    funnel = (
        SegmentObstacle(start=(0.1, 0.75), end=(0.43, 0.45), thickness=0.04, friction=0.1),
        SegmentObstacle(start=(0.9, 0.75), end=(0.57, 0.45), thickness=0.04, friction=0.1),
    )
    hopper = RectangularEmitter(
        material="sand", lower=(0.44, 0.85), upper=(0.56, 0.85), velocity=(0.0, -1.0), stop=0.25
    )
    solver = MpmSolver(scene(hopper, obstacles=funnel))
    solver.advance(600)
    x = solver.positions
    fallen = x[x[:, 1] < 0.38]
    assert len(fallen) > 0.6 * len(x)
    # A pile, not a puddle: it stands, and in the middle.
    assert fallen[:, 1].max() - 0.1 > 0.2 * (np.percentile(fallen[:, 0], 98) - 0.5)
    assert abs(fallen[:, 0].mean() - 0.5) < 0.03


def test_mirrored_openings_make_mirrored_jets() -> None:
    left = RoundEmitter(material="water", center=(0.25, 0.4), radius=0.04, velocity=(1.0, 1.0))
    right = RoundEmitter(material="water", center=(0.75, 0.4), radius=0.04, velocity=(-1.0, 1.0))
    one, other = (MpmSolver(scene(jet)) for jet in (left, right))
    one.advance(80)
    other.advance(80)
    assert one.particle_count == other.particle_count
    assert one.diagnostics().emitted_mass == other.diagnostics().emitted_mass
    a, b = one.diagnostics().centroid, other.diagnostics().centroid
    # Sites mirror exactly, their jitter does not.
    assert a[0] == pytest.approx(1 - b[0], abs=2e-3)
    assert a[1] == pytest.approx(b[1], abs=2e-3)
    sites, mirrored = left.sites(0.01), right.sites(0.01)
    assert np.allclose(np.sort(sites[:, 0]), np.sort(1 - mirrored[:, 0]))


@pytest.mark.parametrize("dim", [2, 3])
def test_threads_cuts_and_companions_do_not_change_a_bit(dim: int) -> None:
    whole = MpmSolver(fountain(dim))
    whole.advance(90)
    parts = MpmSolver(fountain(dim), threads=2)
    for _ in range(9):
        parts.advance(10)
    twin = MpmSolver(fountain(dim))
    twin.advance(40)
    resumed = MpmSolver(fountain(dim))
    resumed.restore(twin.snapshot())
    resumed.advance(50)
    batch = MpmBatch([fountain(dim), fountain(5 - dim)])
    batch.advance(90)
    for other in (parts, resumed, batch[0]):
        assert other.snapshot() == whole.snapshot()
        assert np.array_equal(other.ids, whole.ids)


def test_snapshots_of_other_openings_are_refused() -> None:
    moved = scene(JET.model_copy(update={"velocity": (0.0, -1.0)}))
    with pytest.raises(SnapshotError, match="other settings"):
        MpmSolver(moved).restore(MpmSolver(scene(JET)).snapshot())


def test_a_full_scene_stops_the_emitter_with_a_warning_and_goes_on_when_there_is_room() -> None:
    narrow = scene(JET, max_particles=300)
    solver = MpmSolver(narrow)
    with pytest.warns(ParticleLimitWarning, match="max_particles = 300"):
        solver.advance(100)
    assert solver.emitters == ("full",)
    assert solver.particle_count == 300
    solver.advance(10)  # told once
    draining = MpmSolver(scene(JET, sinks=(DRAIN,), max_particles=300))
    with pytest.warns(ParticleLimitWarning):
        draining.advance(400)
    assert draining.particle_count <= 300
    assert draining.ids[-1] > 600
    batch = MpmBatch([narrow])
    with pytest.warns(ParticleLimitWarning):
        batch.advance(100)


def test_what_needs_a_fixed_number_of_particles_says_so() -> None:
    solver = MpmSolver(scene(JET))
    with pytest.raises(ConfigError, match=r"hybridmpm.recording.record, which follows"):
        solver.rollout(3)


def test_recordings_have_a_column_for_each_particle_ever_present(tmp_path: Path) -> None:
    solver = MpmSolver(fountain(2))
    recording = record(solver, 100, every=20)
    assert recording.positions.shape == (6, len(recording.ids), 2)
    last = recording.present(5)
    assert np.array_equal(recording.ids[last], solver.ids)
    assert np.array_equal(recording.positions[5, last], solver.positions)
    assert np.array_equal(recording.types[last], solver.materials)
    first = recording.present(0)
    assert first.sum() == 19 * 13
    assert not first[recording.ids >= 19 * 13].any()
    save(tmp_path / "run.npz", recording)
    with np.load(tmp_path / "run.npz") as arrays:
        assert np.array_equal(arrays["ids"], recording.ids)
        assert np.isnan(arrays["positions"]).any()
    save(tmp_path / "last.ply", recording)
    header = (tmp_path / "last.ply").read_bytes().partition(b"end_header\n")[0]
    assert f"element vertex {solver.particle_count}\n".encode() in header
    save(tmp_path / "last.vtp", recording)
    assert f'NumberOfPoints="{solver.particle_count}"' in (tmp_path / "last.vtp").read_text()
    save(tmp_path / "strip.png", recording, Style(width=120, strip=3))
    save(tmp_path / "film.gif", recording, Style(width=120))


@pytest.mark.filterwarnings("ignore::hybridmpm.ThinObstacleWarning")  # on this coarse grid
def test_the_example_runs_and_its_pool_stands_between_spout_and_drain() -> None:
    example = Scene.load(EXAMPLE)
    assert example.emitters
    assert example.sinks
    assert any(obstacle.motion for obstacle in example.obstacles)
    solver = MpmSolver(example.model_copy(update={"resolution": 48}))
    solver.advance(800)
    totals = solver.diagnostics()
    assert solver.emitters == ("running",)
    assert totals.removed_mass > 0.2 * totals.emitted_mass


def test_stiffness_follows_the_height_of_the_opening() -> None:
    material = {"kind": "water", "max_compression": 0.02}
    jet = RectangularEmitter(material=material, lower=(0.4, 0.8), upper=(0.6, 0.8), velocity=(0.0, -1.0))
    assert scene(jet).potential_drop == pytest.approx(9.81 * 0.7)
    with pytest.raises(SceneError, match="needs gravity above 0"):
        scene(jet, gravity=(0.0, 0.0))


ROUND = {"shape": "round", "material": "water", "center": [0.5, 0.5], "radius": 0.05, "velocity": [1, 0]}
FLAT = {
    "shape": "rectangle",
    "material": "water",
    "lower": [0.4, 0.5],
    "upper": [0.6, 0.5],
    "velocity": [0, 1],
}


@pytest.mark.parametrize(
    ("emitter", "field", "message"),
    [
        (ROUND | {"velocity": [0, 0]}, ".velocity", "must not be zero"),
        (ROUND | {"velocity": [1, 0, 0]}, ".velocity", "must have dim = 2 numbers, got 3"),
        (ROUND | {"start": 1, "stop": 0.5}, ".stop", "must be above start = 1, got 0.5"),
        (ROUND | {"center": [0.88, 0.5], "velocity": [20, 0]}, "", "must lie inside the walls"),
        (FLAT | {"velocity": [1, 1]}, ".velocity", "must be along one axis"),
        (FLAT | {"lower": [0.4, 0.5, 0.5]}, ".lower", "must have as many numbers as upper and velocity"),
        (FLAT | {"velocity": [1, 0]}, ".upper[0]", "must be equal to lower[0] = 0.4"),
        (
            FLAT | {"upper": [0.6, 0.6]},
            ".upper[1]",
            "must be equal to lower[1] = 0.5, because velocity[1] is 1",
        ),
        (FLAT | {"rate": 2}, ".rate", "unknown field"),
    ],
)
def test_bad_emitters_are_refused_with_the_path_of_the_field(
    emitter: dict[str, Any], field: str, message: str
) -> None:
    with pytest.raises(SceneError) as caught:
        Scene.parse({"dim": 2, "bodies": [], "emitters": [emitter]})
    where, text = caught.value.problems[0]
    assert where == f"emitters[0]{field}"
    assert message in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"material": 3}, r"emitters\[0\]\.material must be an index into materials, got 3"),
        ({"velocity": [0.0, 0.0]}, r"velocity must be finite and not zero"),
        ({"spacing": 0.0}, r"spacing must be finite and > 0"),
        ({"start": 2.0, "stop": 1.0}, r"start must be >= 0 s and before stop"),
        (
            {"sites": np.full((1, 2), 0.95, np.float32)},
            r"sites must be an opening whose material stays inside",
        ),
        ({"sites": np.zeros((0, 2), np.float32), "jitter": np.zeros((1, 0, 2), np.float32)}, "one or more"),
        ({"jitter": np.zeros((4, 2, 2), np.float32)}, r"jitter must have a shape that ends in \[1, 2\]"),
        ({"sites": [0.5, 0.5]}, r"sites must be float32 of shape \(n, D\)"),
    ],
)
def test_the_core_checks_emitters_of_its_own_users(change: dict[str, Any], message: str) -> None:
    emitter: dict[str, Any] = {
        "material": 0,
        "velocity": [0.0, -1.0],
        "spacing": 0.01,
        "sites": np.full((1, 2), 0.5, dtype=np.float32),
        "jitter": np.zeros((2, 1, 2), dtype=np.float32),
        "mass": 0.1,
        "volume": 1e-4,
    }
    water = _native.Material.water(density=1000.0, bulk_modulus=1e5)
    with pytest.raises(ConfigError, match=message):
        native_solver(
            np.zeros((0, 2)), 0.0, water, resolution=32, emitters=[_native.Emitter(**emitter | change)]
        )


def test_bad_sinks_and_scenes_without_anything_are_refused() -> None:
    sink = {"shape": "box", "lower": [0.1, 0.1], "upper": [0.1, 0.2]}
    with pytest.raises(SceneError, match=r"sinks\[0\]\.upper\[0\]: must be above lower\[0\]"):
        Scene.parse({"dim": 2, "bodies": [], "emitters": [ROUND], "sinks": [sink]})
    ball = {"shape": "ball", "center": [0.5, 0.5, 0.5], "radius": 0.1}
    with pytest.raises(SceneError, match=r"sinks\[0\]\.center: must have dim = 2 numbers, got 3"):
        Scene.parse({"dim": 2, "bodies": [], "emitters": [ROUND], "sinks": [ball]})
    with pytest.raises(
        SceneError, match="bodies: must have 1 or more items, got 0; only a scene with emitters needs none"
    ):
        Scene.parse({"dim": 2, "bodies": []})


def test_an_obstacle_at_rest_before_the_opening_is_refused() -> None:
    lid = BoxObstacle(lower=(0.45, 0.8), upper=(0.55, 0.848))
    with pytest.raises(SceneError, match=r"emitters\[0\]: must open into free space, but obstacles\[0\]"):
        MpmSolver(scene(JET, obstacles=(lid,)))
