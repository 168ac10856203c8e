"""A force is a field in time: five forms, checked in one place with one error, whoever simulates."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import BatchError, ForceError, MpmBatch, MpmSolver, RectangularEmitter, Scene, Simulator
from hybridmpm.force import total_force

Make = Callable[[], Simulator]
T = 30
PUSH = np.array([3.0, 12.0], dtype=np.float32)


def assert_same(one: Simulator, other: Simulator) -> None:
    assert one.frame == other.frame
    assert np.array_equal(one.ids, other.ids)
    assert np.array_equal(one.positions, other.positions)
    assert np.array_equal(one.velocities, other.velocities)


def started(make: Make) -> Simulator:
    """Return a simulator amid a step of its network, if it has one."""
    simulator = make()
    simulator.advance(22)
    return simulator


def test_all_forms_of_one_force_give_the_same_bits(make: Make) -> None:
    start = started(make)
    n = start.particle_count
    every = np.broadcast_to(PUSH, (n, 2))
    forms: list[Any] = [
        PUSH,
        tuple(PUSH.tolist()),
        every,
        np.broadcast_to(PUSH, (T, n, 2)),
        lambda _: PUSH,
        lambda simulator: np.tile(PUSH, (simulator.particle_count, 1)),
        (start.ids, every),
        (start.ids[::-1], np.broadcast_to(PUSH, (T, n, 2))),
        lambda simulator: (simulator.ids, every),
    ]
    expected = start.copy()
    expected.advance(T, every)
    for number, form in enumerate(forms):
        simulator = start.copy()
        simulator.advance(T, form)
        assert_same(simulator, expected)
        path = start.copy().rollout(T, form)
        assert np.array_equal(path[-1], expected.positions), number
    free = start.copy()
    free.advance(T)
    assert not np.array_equal(free.positions, expected.positions)


def test_no_force_in_all_its_forms(make: Make) -> None:
    start = started(make)
    free = start.copy()
    free.advance(T)
    for form in (None, lambda _: None):
        simulator = start.copy()
        simulator.advance(T, form)
        assert_same(simulator, free)


def test_a_force_may_change_from_frame_to_frame(make: Make) -> None:
    start = started(make)
    n = start.particle_count
    per_frame = np.random.default_rng(2).normal(0, 5, (T, n, 2)).astype(np.float32)
    per_frame[3:9] = 0
    expected = start.copy()
    for row in per_frame:
        expected.advance(1, row)
    first = start.frame
    for form in (per_frame, (start.ids, per_frame), lambda now: per_frame[now.frame - first]):
        simulator = start.copy()
        simulator.advance(T, form)
        assert_same(simulator, expected)


def test_a_function_sees_the_state_of_each_frame(make: Make) -> None:
    simulator = started(make)
    seen: list[tuple[int, npt.NDArray[np.float32]]] = []

    def brake(now: Simulator) -> npt.NDArray[np.float32]:
        seen.append((now.frame, now.positions))
        return -20 * now.velocities

    fast = np.linalg.norm(simulator.velocities, axis=1).mean()
    path = simulator.rollout(T, brake)
    assert [frame for frame, _ in seen] == list(range(22, 22 + T))
    for row, (_, positions) in enumerate(seen):
        assert np.array_equal(path[row], positions)
    # Speeds shrink as exp(-20 t) down to g / 20, the speed of a fall that the brake allows.
    assert np.linalg.norm(simulator.velocities, axis=1).mean() < 0.6 * fast


def test_a_function_may_reuse_its_array(make: Make) -> None:
    buffer = np.zeros(2, dtype=np.float32)

    def reused(now: Simulator) -> npt.NDArray[np.float32]:
        buffer[:] = [now.frame, 10]
        return buffer

    simulator, expected = started(make), started(make)
    simulator.advance(T, reused)
    expected.advance(T, lambda now: [now.frame, 10])
    assert_same(simulator, expected)


def test_no_frames_need_no_force(make: Make) -> None:
    simulator = started(make)
    n = simulator.particle_count
    for force in (PUSH, np.zeros((n, 2)), np.zeros((0, n, 2)), lambda _: 1 / 0, ([0], np.zeros((0, 1, 2)))):
        simulator.advance(0, force)
    assert simulator.frame == 22


def test_ids_not_named_get_none_and_ids_of_nobody_are_ignored(make: Make) -> None:
    start = started(make)
    some = start.ids[10:20]
    expected, simulator = start.copy(), start.copy()
    force = np.zeros((start.particle_count, 2), dtype=np.float32)
    force[10:20] = PUSH
    expected.advance(3, force)
    simulator.advance(3, (np.append(some, np.uint64(9_999_999)), np.tile(PUSH, (11, 1))))
    assert_same(simulator, expected)
    nobody = start.copy()
    nobody.advance(3, (np.empty(0, dtype=np.int64), np.empty((0, 2))))
    free = start.copy()
    free.advance(3)
    assert_same(nobody, free)


def bad_rows(n: int) -> npt.NDArray[np.float64]:
    """Return rows of which one is not a number."""
    rows = np.zeros((n, 2))
    rows[7, 1] = np.nan
    return rows


class Foreign:
    """An array of another library that refuses to be converted."""

    def __array__(self, *_: object, **__: object) -> npt.NDArray[np.float32]:
        raise RuntimeError("it needs gradients")


WRONG: dict[str, tuple[Callable[[int], Any], str]] = {
    "three numbers": (lambda _: np.zeros(3), r"have shape \(2,\), .*got shape \(3,\)"),
    "a row too many": (lambda n: np.zeros((n + 1, 2)), r"a tuple \(ids, accelerations\); got shape"),
    "three axes": (lambda n: np.zeros((n, 3)), r"got shape \(\d+, 3\)"),
    "a frame too many": (lambda n: np.zeros((4, n, 2)), r"or \(3, \d+, 2\), or be.*got shape \(4, "),
    "text": (lambda _: "up", "force must be numbers"),
    "rows of two lengths": (lambda _: ([0.0, 1.0], [1.0]), "force must be numbers"),
    "NaN": (bad_rows, r"force must be finite, got nan at \[7, 1\]"),
    "complex": (lambda _: [1j, 0], "force must be real numbers"),
    "too large for a float": (lambda _: [10**400, 0], "force must be numbers"),
    "foreign": (lambda _: Foreign(), "force must be numbers .* it needs gradients"),
    "a list for a pair": (lambda _: [[0, 1, 2], np.zeros((3, 2))], "are given as a tuple"),
    "ids of text": (lambda _: (["a"], np.zeros((1, 2))), "ids of force must be whole numbers"),
    "infinite": (lambda _: [np.inf, 0.0], r"force must be finite, got inf at \[0\]"),
    "too large for float32": (lambda _: [0.0, 1e300], r"force must be finite, got inf at \[1\]"),
    "NaN in the last frame": (
        lambda n: np.concatenate([np.zeros((2, n, 2)), bad_rows(n)[None]]),
        r"finite, got nan at \[2, 7, 1\]",
    ),
    "an id twice": (lambda _: ([1, 2, 1], np.zeros((3, 2))), "ids of force must differ, got 1 twice"),
    "an id below 0": (lambda _: ([1, -2], np.zeros((2, 2))), "ids of force must be at least 0, got -2"),
    "half an id": (lambda _: ([0.5, 1.5], np.zeros((2, 2))), "ids of force must be whole numbers"),
    "rows of other ids": (lambda _: ([0, 1, 2], np.zeros((2, 2))), "one row for each of 3 ids, got"),
    "frames of ids": (lambda _: ([0, 1], np.zeros((4, 2, 2))), r"\(2, 2\) or \(3, 2, 2\)"),
    "NaN of an id": (lambda _: ([0, 1], [[0, 0], [np.nan, 0]]), "accelerations of force must be finite"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_force_moves_nothing(make: Make, case: str) -> None:
    form, message = WRONG[case]
    simulator = started(make)
    before = simulator.positions
    force = form(simulator.particle_count)
    for call in (simulator.advance, simulator.rollout):
        with pytest.raises(ForceError, match=message):
            call(3, force)
    assert simulator.frame == 22
    assert np.array_equal(simulator.positions, before)


def test_a_function_that_fails_stops_before_its_frame(make: Make) -> None:
    simulator, expected = started(make), started(make)
    expected.advance(5, PUSH)

    def late(answer: Callable[[], Any]) -> Callable[[Simulator], Any]:
        return lambda now: answer() if now.frame == 27 else PUSH

    def fail() -> None:
        raise ZeroDivisionError("no more")

    failures: list[tuple[Callable[[], Any], str]] = [
        (fail, "the force function raised ZeroDivisionError before frame 28: no more"),
        (lambda: np.zeros(3), r"the force function's value before frame 28 must have shape \(2,\)"),
        (lambda: [np.nan, 0.0], "the force function's value before frame 28 must be finite"),
        (lambda: late, "must be an acceleration, not another function"),
        (lambda: ([1, 1], np.zeros((2, 2))), "must differ, got 1 twice"),
    ]
    for answer, message in failures:
        simulator = started(make)
        with pytest.raises(ForceError, match=message):
            simulator.advance(9, late(answer))
        assert_same(simulator, expected)
        simulator.advance(9)


@pytest.fixture(scope="module")
def spring() -> Scene:
    """Return an emitter in a box without gravity, from which a layer comes every few frames."""
    jet = RectangularEmitter(material="water", lower=(0.2, 0.45), upper=(0.2, 0.55), velocity=(1.0, 0.0))
    return Scene(dim=2, resolution=64, gravity=(0.0, 0.0), bodies=(), emitters=(jet,))


def test_forces_where_particles_come_and_go(spring: Scene) -> None:
    start = MpmSolver(spring)
    start.advance(10)
    ids = start.ids
    named = start.copy()
    named.advance(20, (ids, np.broadcast_to(PUSH, (20, len(ids), 2))))
    assert named.particle_count > len(ids)
    by_hand = start.copy()
    for _ in range(20):
        force = np.zeros((by_hand.particle_count, 2), dtype=np.float32)
        force[: len(ids)] = PUSH
        by_hand.advance(1, force)
    assert_same(named, by_hand)
    assert (named.velocities[: len(ids), 1] > 0.2).all()
    # The youngest have not met those that were pushed.
    assert (np.abs(named.velocities[-6:, 1]) < 0.2).all()
    uniform, answered = start.copy(), start.copy()
    uniform.advance(20, PUSH)
    answered.advance(20, lambda now: np.tile(PUSH, (now.particle_count, 1)))
    assert_same(uniform, answered)
    rows = np.zeros((len(ids), 2))
    with pytest.raises(ForceError, match="Particles come and go in this scene, so rows without ids"):
        start.advance(2, rows)
    with pytest.raises(ForceError, match="Particles come and go in this scene"):
        start.advance(2, np.zeros((2, len(ids), 2)))
    start.advance(1, rows)


def test_forces_on_a_batch(falling_block: Scene, spring: Scene) -> None:
    batch = MpmBatch([falling_block, spring, falling_block])
    alone = [MpmSolver(scene) for scene in (falling_block, spring, falling_block)]
    forces: list[Any] = [lambda now: -5 * now.velocities, PUSH, None]
    batch.advance(12, forces)
    for solver, force, member in zip(alone, forces, batch, strict=True):
        solver.advance(12, force)
        assert_same(member, solver)
    with pytest.raises(ForceError, match=r"force\[2\] must have shape"):
        batch.advance(2, [None, None, [1.0]])
    assert [member.frame for member in batch] == [12, 12, 12]

    def fail(now: Simulator) -> Any:
        if now.frame == 14:
            raise ValueError("enough")
        return PUSH

    with pytest.raises(BatchError, match=r"^scene 0: the force function raised ValueError") as caught:
        batch.advance(5, [fail, PUSH, None])
    assert list(caught.value.failures) == [0]
    assert isinstance(caught.value.failures[0], ForceError)
    assert [member.frame for member in batch] == [14, 17, 17]


def test_forces_of_all_forms_add_up() -> None:
    ids = np.array([2, 3, 7], dtype=np.uint64)
    rows = np.arange(6, dtype=np.float32).reshape(3, 2)
    some = (np.array([7, 5, 2], dtype=np.uint64), np.float32([[10, 0], [20, 0], [0, 30]]))
    found = total_force([(1.0, 2.0), None, rows, some], ids, 2)
    np.testing.assert_array_equal(found, rows + np.array([[1, 32], [1, 2], [11, 2]]))
    np.testing.assert_array_equal(total_force([], ids, 2), np.zeros((3, 2)))
