"""All simulators share one surface, and a state that is saved goes on to the same bits."""

import inspect
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    ConfigError,
    HybridSimulator,
    MpmSolver,
    NeuralPhysics,
    Scene,
    SimulationError,
    Simulator,
    SnapshotError,
    load,
    scenarios,
    simulators,
)
from hybridmpm._support.packing import from_bytes, to_bytes
from hybridmpm.decisions import Decision, Span, frames_of_mpm, spans
from hybridmpm.hybrid import Audit, Density, Guard, GuardInput, Stage
from hybridmpm.physics import NeuralModel
from hybridmpm.physics.free_fall import FreeFall

Make = Callable[[], Simulator]
FRAMES = (0, 3, 21, 26, 38, 61)
"""At the start, within warm-up, at the first step of a network, amid one, after the impact, much later."""


def test_threads_read_snapshots_at_once() -> None:
    data = to_bytes(b"kind", 1, {str(k): np.zeros(2) for k in range(7)})
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            read = list(pool.map(lambda _: from_bytes(b"kind", 1, data), range(400)))
    finally:
        sys.setswitchinterval(interval)
    assert {len(tree) for tree in read} == {7}


def assert_same(one: Simulator, other: Simulator) -> None:
    assert (one.frame, one.mode, one.log) == (other.frame, other.mode, other.log)
    for name in ("positions", "velocities", "ids", "materials", "mass"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert one.safeguard == other.safeguard


@pytest.mark.parametrize("frame", FRAMES)
def test_going_on_from_a_snapshot_gives_the_same_bits(make: Make, frame: int) -> None:
    simulator, other = make(), make()
    simulator.advance(frame)
    data = simulator.snapshot()
    other.advance(17)
    other.restore(data)
    assert_same(other, simulator)
    assert other.snapshot() == data
    for _ in range(3):
        simulator.advance(15)
        other.advance(15)
        assert_same(other, simulator)


@pytest.mark.parametrize("frame", [26, 61])
def test_going_on_from_a_file_gives_the_same_bits(make: Make, frame: int, tmp_path: Path) -> None:
    simulator, file = make(), tmp_path / "state.hmpm"
    simulator.advance(frame)
    simulator.save(file)
    settings = {} if simulator.kind == "mpm" else {"model": FreeFall(simulator.scene.frame_dt, r_t=4)}
    loaded = [type(simulator).load(file, threads=2), load(file), load(file, **settings)]
    simulator.advance(40)
    for one in loaded:
        assert type(one) is type(simulator)
        assert one.frame == frame
        one.advance(40)
        assert_same(one, simulator)


def test_what_a_simulator_tells_of_itself(make: Make) -> None:
    simulator = make()
    network_comes = simulator.kind != "mpm"
    assert simulator.r_p == 1.0
    assert simulator.r_t == (4 if network_comes else 1)
    assert (simulator.mode, simulator.last_frame, simulator.mpm_share) == ("mpm", None, 1.0)
    simulator.advance(10)
    assert simulator.last_frame.substeps >= 1
    simulator.advance(16)
    assert simulator.mode == ("neural" if network_comes else "mpm")
    assert (simulator.last_frame is None) == network_comes
    assert simulator.mpm_share == (pytest.approx(20 / 26) if network_comes else 1.0)
    assert [decision.frame for decision in simulator.log] == ([20] if network_comes else [])
    told = simulator.diagnostics()
    mass = simulator.mass.astype(np.float64)
    assert told.mass == pytest.approx(mass.sum(), rel=1e-6)
    np.testing.assert_allclose(told.momentum, mass @ simulator.velocities, rtol=1e-4)


def test_a_damaged_or_foreign_snapshot_changes_nothing(make: Make, drop: Scene) -> None:
    simulator = make()
    simulator.advance(26)
    data = simulator.snapshot()
    foreign = type(simulator)(drop, *([FreeFall(drop.frame_dt, r_t=4)] * (simulator.kind != "mpm")))
    middle = len(data) // 2
    flipped = data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]
    for bad in (b"", data[:-1], flipped, foreign.snapshot(), b"other" + data):
        with pytest.raises(SnapshotError):
            simulator.restore(bad)
        assert simulator.snapshot() == data


def test_a_file_of_another_kind_is_refused(falling_block: Scene, tmp_path: Path) -> None:
    file = tmp_path / "state.hmpm"
    NeuralPhysics(falling_block, "zero").save(file)
    for cls in (MpmSolver, HybridSimulator):
        with pytest.raises(SnapshotError, match=r"of kind 'neural'.*use hybridmpm.load"):
            cls.load(file)
    MpmSolver(falling_block).save(file)
    with pytest.raises(ConfigError, match="kind 'mpm', which has no network"):
        load(file, model="zero")


def test_a_file_names_its_network(tmp_path: Path) -> None:
    scene, file = scenarios.water_2d(1), tmp_path / "state.hmpm"
    HybridSimulator(scene, "fluids_2d", r_c=0.5, guards=["cosine", Density(4.0)]).save(file)
    loaded = HybridSimulator.load(file)
    assert isinstance(loaded.model, NeuralModel)
    assert loaded.model.name == "fluids_2d"
    assert (loaded.r_c, loaded.r_p, loaded.r_t) == (0.5, 0.125, 4)
    other = tmp_path / "other.hmpm"
    loaded.save(other)
    assert other.read_bytes() == file.read_bytes()


class Own(FreeFall):
    """A network that no file can name."""


class Counting(Guard):
    """A guard of one's own that hides what it remembers."""

    name = "counting"
    stage = Stage.RAW

    def __init__(self) -> None:
        self.seen = 0

    def value(self, given: GuardInput) -> float:  # noqa: ARG002
        self.seen += 1
        return 0.0

    def alarms(self, value: float) -> bool:  # noqa: ARG002
        return False


class Quiet(Guard):
    """A guard of one's own that remembers nothing."""

    name = "quiet"
    stage = Stage.RAW

    def value(self, given: GuardInput) -> float:  # noqa: ARG002
        return 0.0

    def alarms(self, value: float) -> bool:  # noqa: ARG002
        return False


def test_networks_and_guards_of_ones_own_are_given_again(falling_block: Scene, tmp_path: Path) -> None:
    file, own = tmp_path / "state.hmpm", Own(falling_block.frame_dt, r_t=4)
    simulator = HybridSimulator(falling_block, own, guards=[Quiet(), "non-finite"])
    simulator.advance(26)
    simulator.save(file)
    with pytest.raises(SnapshotError, match=r"state.hmpm .* network of your own: give it as `model`"):
        HybridSimulator.load(file)
    with pytest.raises(SnapshotError, match=r"state.hmpm .* guards of your own: give all guards"):
        HybridSimulator.load(file, model=own)
    with pytest.raises(SnapshotError, match="made with other guards"):
        HybridSimulator.load(file, model=own, guards=["non-finite"])
    loaded = HybridSimulator.load(file, model=own, guards=[Quiet(), "non-finite"])
    simulator.advance(20)
    loaded.advance(20)
    assert_same(loaded, simulator)


def test_a_guard_that_would_lose_its_memory_is_refused(falling_block: Scene) -> None:
    simulator = HybridSimulator(falling_block, "zero", guards=[Counting()])
    with pytest.raises(SnapshotError, match="'counting' keeps seen, which a snapshot would lose"):
        simulator.snapshot()


def test_a_network_is_given_by_name_path_or_itself(tmp_path: Path) -> None:
    scene = scenarios.water_2d(1)
    weights = Path(inspect.getfile(NeuralModel)).parent / "weights" / "fluids_2d.onnx"
    model = NeuralModel.load("fluids_2d")
    for kind in (NeuralPhysics, HybridSimulator):
        given = [kind(scene, one) for one in ("fluids_2d", weights, str(weights), model)]
        for simulator in given:
            simulator.advance(24)
            assert np.array_equal(simulator.positions, given[0].positions)
        with pytest.raises(ConfigError, match="there is no model"):
            kind(scene, "fluid")
        wrong: Any = 3
        with pytest.raises(ConfigError, match=r"a name, a path of an .onnx file or a Stepper, got int"):
            kind(scene, wrong)


def test_simulators_are_made_by_name(falling_block: Scene) -> None:
    made = simulators.make("hybrid", falling_block, model="zero", r_c=0.3, window=None)
    assert isinstance(made, HybridSimulator)
    assert made.r_c == 0.3
    with pytest.raises(ConfigError, match="r_c belongs to 'hybrid', not to 'mpm'"):
        simulators.make("mpm", falling_block, r_c=0.3)
    with pytest.raises(ConfigError, match="colour belongs to no simulator, not to 'mpm'"):
        simulators.make("mpm", falling_block, colour=1)
    with pytest.raises(ConfigError, match="must be among mpm, neural, hybrid; got 'sph'"):
        simulators.make("sph", falling_block)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="needs a network: give a model"):
        simulators.make("neural", falling_block)


@pytest.mark.parametrize("frame", [3, 26])
def test_a_network_of_another_step_is_refused(make: Make, frame: int, tmp_path: Path) -> None:
    simulator, file = make(), tmp_path / "state.hmpm"
    if simulator.kind == "mpm":
        return
    simulator.advance(frame)
    simulator.save(file)
    for r_t in (2, 8):
        other = FreeFall(simulator.scene.frame_dt, r_t=r_t)
        with pytest.raises(SnapshotError, match=f"a network of r_t = 4, this one has {r_t}"):
            load(file, model=other)
        same = (
            {"guards": ("non-finite", "outside", "density", "energy")} if simulator.kind == "hybrid" else {}
        )
        twin = type(simulator)(simulator.scene, other, **same)
        with pytest.raises(SnapshotError, match=r"a network of r_t = 4"):
            twin.restore(simulator.snapshot())
    with pytest.raises(SnapshotError, match=r"state.hmpm cannot be restored: .*absent.onnx"):
        load(file, model=tmp_path / "absent.onnx")


def test_numbers_of_numpy_are_saved_as_settings(falling_block: Scene, tmp_path: Path) -> None:
    file = tmp_path / "state.hmpm"
    MpmSolver(falling_block, cfl=np.float32(0.3), allow_unstable=bool(np.True_)).save(file)
    MpmSolver.load(file)
    HybridSimulator(falling_block, "zero", guards=[Audit(2.5, period=np.int64(5))]).save(file)
    HybridSimulator.load(file)
    with pytest.raises(ConfigError, match="period must be in"):
        Audit(period=0)


@dataclass(eq=False)
class Listing(Quiet):
    """A guard of one's own that remembers a list, which a snapshot would not bring back."""

    name = "listing"
    seen: list[int] = field(default_factory=list, init=False)


def test_a_guards_memory_is_plain(falling_block: Scene) -> None:
    simulator = HybridSimulator(falling_block, "zero", guards=[Listing()])
    with pytest.raises(SnapshotError, match="'listing' keeps seen as list"):
        simulator.snapshot()


def test_a_wrong_tree_with_a_right_checksum_is_refused(make: Make) -> None:
    simulator = make()
    if simulator.kind == "mpm":
        return
    simulator.advance(26)
    magic, version = {"neural": (b"HMPMNEUR", 3), "hybrid": (b"HMPMHYBR", 4)}[simulator.kind]
    tree = from_bytes(magic, version, simulator.snapshot())
    before = simulator.snapshot()
    wrong: list[dict[str, Any]] = [{}, {**tree, "network": 3}, {**tree, "shown": "x", "mode": "x"}]
    for one in wrong:
        with pytest.raises(SnapshotError):
            simulator.restore(to_bytes(magic, version, one))
        assert simulator.snapshot() == before


class Crashing(Quiet):
    """A guard of one's own with a fault."""

    name = "crashing"
    stage = Stage.MOTION

    def value(self, given: GuardInput) -> float:
        if given.steps == 3:
            raise ZeroDivisionError("a fault of the guard")
        return 0.0


class Jumping(FreeFall):
    """A network that lets particles change places, which no material survives."""

    def step(self, history: Any, *rest: Any) -> Any:
        return super().step(history, *rest)[::-1].copy()


@pytest.mark.parametrize("guards", [[], ["density"], ["cosine", "energy"], [Crashing()]])
def test_a_frame_that_fails_leaves_the_state_before_it(falling_block: Scene, guards: Any) -> None:
    """Whatever fails: the network, a guard, or MPM when it takes over from it or redoes frames."""
    network = Jumping(falling_block.frame_dt, r_t=4)
    simulator = HybridSimulator(falling_block, network, guards=guards, window=6)
    for frame in range(80):
        force = [300.0, 0.0] if frame % 11 == 3 else None
        before = simulator.copy()
        try:
            simulator.advance(1, force)
        except (SimulationError, ZeroDivisionError):
            assert_same(simulator, before)
            now, then = simulator._loop.state, before._loop.state
            assert (now.mpm.frame, now.network.steps) == (then.mpm.frame, then.network.steps)
            assert now.mpm.snapshot() == then.mpm.snapshot()
            assert (now.backoff, len(now.checkpoints)) == (then.backoff, len(then.checkpoints))


MAGIC = b"HMPMTEST"


def test_a_tree_comes_back() -> None:
    tree: dict[str, Any] = {
        "numbers": [1, 2.5, float("inf"), None, True, "text"],
        "array": np.arange(6, dtype=np.float32).reshape(2, 3),
        "nested": {"bytes": b"\x00\xff", "list": [{"array": np.empty((0, 2))}, []]},
        "numpy": np.float32(0.5),
    }
    data = to_bytes(MAGIC, 3, tree)
    assert to_bytes(MAGIC, 3, tree) == data
    again = from_bytes(MAGIC, 3, data)
    assert again["numbers"] == tree["numbers"]
    assert again["array"].dtype == np.float32
    np.testing.assert_array_equal(again["array"], tree["array"])
    assert again["nested"]["bytes"] == b"\x00\xff"
    assert again["nested"]["list"][0]["array"].shape == (0, 2)
    assert again["nested"]["list"][1] == []
    assert again["numpy"] == 0.5


def test_what_is_no_snapshot_is_refused() -> None:
    data = to_bytes(MAGIC, 3, {"a": 1})
    with pytest.raises(SnapshotError, match="no snapshot of this kind"):
        from_bytes(b"HMPMELSE", 3, data)
    with pytest.raises(SnapshotError, match="checksum does not match"):
        from_bytes(MAGIC, 3, data[:-1])
    with pytest.raises(SnapshotError, match="has version 3, but this hybridmpm reads version 4"):
        from_bytes(MAGIC, 4, data)
    with pytest.raises(SnapshotError, match="but not object"):
        to_bytes(MAGIC, 3, {"a": object()})


def decided(frame: int, mode: str, reason: str) -> Decision:
    assert mode in ("mpm", "neural")
    return Decision(
        frame=frame, mode="mpm" if mode == "mpm" else "neural", value=None, reason=reason, noticed=frame
    )


START, IMPACT, CALM, UNDONE = (
    decided(20, "neural", "warm-up"),
    decided(60, "mpm", "impact"),
    decided(100, "neural", "calm"),
    decided(100, "mpm", "audit"),
)


def test_frames_belong_to_whoever_simulated_them_last() -> None:
    log = [START, IMPACT, CALM]
    assert spans(log, 120) == [
        Span(1, 20, "mpm", None),
        Span(21, 60, "neural", START),
        Span(61, 100, "mpm", IMPACT),
        Span(101, 120, "neural", CALM),
    ]
    assert frames_of_mpm(log, 120) == 60


def test_what_was_undone_is_left_out_and_later_decisions_do_not_count() -> None:
    log = [START, IMPACT, CALM, UNDONE]
    assert spans(log, 120)[-1] == Span(61, 120, "mpm", IMPACT)
    assert spans(log, 40) == [Span(1, 20, "mpm", None), Span(21, 40, "neural", START)]
    assert spans([], 0) == []
    assert spans([], 5) == [Span(1, 5, "mpm", None)]
