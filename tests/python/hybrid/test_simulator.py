"""The hybrid simulator: who simulates when, and that a failing network does no harm."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from tests.python.hybrid.scripted import Scripted

from hybridmpm import BallSink, Box, BoxObstacle, ConfigError, Motion, MpmSolver, Scene, metrics, scenarios
from hybridmpm.cli import cli
from hybridmpm.errors import GraphSizeError, NonFiniteError
from hybridmpm.hybrid import GUARDS, Density, HybridSimulator, StepCounts

Make = Callable[..., Any]
WARM_UP = 5


def reasons(sim: HybridSimulator) -> list[str]:
    return [decision.reason for decision in sim.log]


def mass(scene: Scene, sim: Any, x: Any = None) -> Any:
    return metrics.grid_mass(sim.positions if x is None else x, sim.mass, scene.resolution)


def landing(path: Any) -> int:
    """Return the first frame before which the centre of these particles did not fall freely."""
    acceleration = np.diff(path.mean(axis=1, dtype=np.float64)[:, 1], n=2) / 0.0025**2
    return int(np.argmax(acceleration[1:] > -8)) + 2


@pytest.mark.parametrize("r_t", [1, 2, 3])
def test_the_recorded_truth_rolls_out_to_exactly_that(drop: Scene, recorded: Make, r_t: int) -> None:
    network = recorded(drop, 60, r_t=r_t)
    sim = HybridSimulator(drop, network, shortcuts=False)
    path = sim.rollout(60)
    assert (sim.mode, reasons(sim)) == ("neural", ["warm-up"])
    assert sim.mpm_share == WARM_UP * r_t / 60
    np.testing.assert_array_equal(path[::r_t], network.path[::r_t])
    assert np.abs(path - network.path).max() <= 1e-6


def test_the_network_gets_what_it_was_promised(fake: Make) -> None:
    block = Box(material="sand", lower=(0.4, 0.4), upper=(0.5, 0.5))
    ramp = BoxObstacle(lower=(0.3, 0.15), upper=(0.7, 0.2))
    scene = Scene(dim=2, resolution=64, bodies=(block,), obstacles=(ramp,))
    network = fake("fall", r_p=0.5, r_t=2)
    HybridSimulator(scene, network, shortcuts=False).advance(2 * WARM_UP + 1)
    (history, types, acceleration, walls) = network.calls[0]
    mpm = MpmSolver(scene, r_p=0.5)
    path = mpm.rollout(2 * WARM_UP)
    fluid = mpm.particle_count
    np.testing.assert_array_equal(history[:, :fluid], path[::2])
    np.testing.assert_array_equal(types, [6] * fluid + [3] * (len(types) - fluid))
    assert len(types) > fluid
    solids = history[0, fluid:]
    np.testing.assert_array_equal(solids, np.clip(solids, (0.3, 0.15), (0.7, 0.2)))
    assert {array.dtype for array in (history, acceleration, walls)} == {np.dtype(np.float32)}
    assert types.dtype == np.int64
    np.testing.assert_allclose(acceleration, np.tile([0, -9.81], (len(types), 1)), rtol=1e-6)
    np.testing.assert_allclose(walls, [[0.1, 0.1], [0.9, 0.9]], rtol=1e-6)


@pytest.mark.parametrize("r_t", [1, 2])
@pytest.mark.parametrize("kind", ["nan", "held", "constant", "constant up", "random", "random weak", "fall"])
def test_a_failing_network_does_no_harm(fall: Scene, fake: Make, kind: str, r_t: int) -> None:
    frames, r_p = 160, 0.5
    truth, own = MpmSolver(fall), MpmSolver(fall, r_p=r_p)
    sim = HybridSimulator(fall, fake(kind, r_p=r_p, r_t=r_t))
    for simulator in (truth, own, sim):
        simulator.advance(frames)
    assert sim.frame == frames
    assert any(decision.mode == "mpm" for decision in sim.log)
    error = metrics.grid_rmse(mass(fall, sim), mass(fall, truth))
    assert error <= 1.1 * metrics.grid_rmse(mass(fall, own), mass(fall, truth))


@cache
def without_network(scenario: str, r_p: float, frames: int) -> tuple[Any, float]:
    """Return the grid mass that MPM reaches with all particles, and the error of MPM with a share of them."""
    scene = scenarios.get(scenario, 1_100_002)
    truth, own = MpmSolver(scene), MpmSolver(scene, r_p=r_p)
    for simulator in (truth, own):
        simulator.advance(frames)
    reached = mass(scene, truth)
    return reached, float(metrics.grid_rmse(mass(scene, own), reached))


@pytest.mark.parametrize("kind", ["nan", "constant", "random", "fall"])
@pytest.mark.parametrize("scenario", scenarios.NAMES)
def test_a_failing_network_does_no_harm_in_any_scenario(scenario: str, fake: Make, kind: str) -> None:
    r_p, frames = 0.125, 200
    truth, bound = without_network(scenario, r_p, frames)
    sim = HybridSimulator(scenarios.get(scenario, 1_100_002), fake(kind, r_p=r_p, r_t=2))
    sim.advance(frames)
    assert metrics.grid_rmse(mass(sim.scene, sim), truth) <= 1.1 * bound


@pytest.mark.parametrize(
    ("kind", "guards", "reason"),
    [
        ("nan", ["non-finite"], "non-finite"),
        ("thrown", ["outside"], "outside"),
        ("constant up", ["energy"], "energy"),
        ("constant", ["audit"], "audit"),
        ("random weak", ["audit"], "audit"),
        ("constant", ["drift"], "drift"),
        ("random", ["cosine"], "cosine"),
    ],
)
def test_each_guard_alone_signals_what_it_is_made_for(
    fall: Scene, fake: Make, kind: str, guards: list[str], reason: str
) -> None:
    sim = HybridSimulator(fall, fake(kind), guards=guards, shortcuts=False)
    sim.advance(60)
    assert reasons(sim)[1] == reason


def test_density_signals_collapse_and_what_it_undoes_is_undone(fall: Scene, fake: Make) -> None:
    def shrink(history: Any, known: Any) -> Any:
        fallen = 2 * history[-1] - history[-2] + 0.0025**2 * known
        centre = fallen.mean(axis=0)
        return (centre + 0.99 * (fallen - centre)).astype(np.float32)

    sim = HybridSimulator(fall, fake(shrink), guards=["density"], shortcuts=False)
    while len(sim.log) < 2:
        sim.advance(1)
    alarm = sim.log[1]
    # The alarming step itself, and those before it in which particles came together.
    assert (alarm.reason, alarm.noticed - alarm.frame) == ("density", 1 + Density.undo)
    assert alarm.frame > WARM_UP
    again = HybridSimulator(fall, fake(shrink), guards=(), shortcuts=False)
    again.advance(alarm.frame)
    assert np.ptp(again.positions, axis=0).min() > 0.9 * 0.125
    scripted = HybridSimulator(fall, fake(shrink), guards=[Scripted(sim.log)], shortcuts=False)
    scripted.advance(sim.frame)
    np.testing.assert_array_equal(sim.positions, scripted.positions)


def test_a_network_that_cannot_answer_is_one_that_failed(fall: Scene, fake: Make) -> None:
    def clumped(_history: Any, _known: Any) -> Any:
        raise GraphSizeError("particle 3 has 300 neighbours")

    sim = HybridSimulator(fall, fake(clumped), shortcuts=False)
    sim.advance(20)
    assert reasons(sim) == ["warm-up", *["unsound", "calm"] * (len(sim.log) // 2 - 1), "unsound"]
    np.testing.assert_array_equal(sim.positions, MpmSolver(fall).rollout(20)[-1])
    with pytest.raises(GraphSizeError, match="300 neighbours"):
        HybridSimulator(fall, fake(clumped), guards=(), shortcuts=False).advance(20)


def test_without_guards_a_network_is_left_alone_until_its_state_cannot_be(fall: Scene, fake: Make) -> None:
    sim = HybridSimulator(fall, fake("held"), guards=(), shortcuts=False)
    sim.advance(50)
    assert reasons(sim) == ["warm-up"]
    np.testing.assert_array_equal(sim.positions, MpmSolver(fall).rollout(WARM_UP)[-1])
    broken = HybridSimulator(fall, fake("nan"), guards=(), shortcuts=False)
    with pytest.raises(NonFiniteError, match="particle 0"):
        broken.advance(50)
    assert broken.frame == WARM_UP
    assert np.isfinite(broken.positions).all()


def test_an_impact_is_noticed_within_a_few_frames(fall: Scene, recorded: Make) -> None:
    network = recorded(fall, 120)
    sim = HybridSimulator(fall, network, guards=("cosine",))
    sim.advance(120)
    alarm = sim.log[1]
    assert alarm.reason == "cosine"
    assert 0 <= alarm.noticed - landing(network.path) <= 3


def test_a_small_impact_on_a_large_pool_is_noticed(drop_on_pool: Scene, recorded: Make) -> None:
    held, frames = 500, 600
    drop = MpmSolver(drop_on_pool).positions[:, 1] > 0.2
    assert np.count_nonzero(drop) < 0.01 * len(drop)
    force = np.zeros((frames, len(drop), 2), dtype=np.float32)
    force[:held, drop, 1] = 9.81
    network = recorded(drop_on_pool, frames, force=force)
    sim = HybridSimulator(drop_on_pool, network, guards=("cosine",), shortcuts=False)
    sim.advance(frames, force)
    since = held + landing(network.path[held:, drop])
    alarms = [decision.noticed for decision in sim.log if decision.mode == "mpm" and decision.frame > held]
    assert sim.log[-2].mode == "neural"
    assert 0 <= alarms[0] - since <= 5


def test_a_settled_pool_does_not_trigger(pool: Scene, recorded: Make) -> None:
    sim = HybridSimulator(pool, recorded(pool, 1000))
    sim.advance(1000)
    assert (sim.mode, sim.safeguard) == ("neural", 1.0)
    assert sim.log[-1].frame < 450


def test_force_is_left_to_mpm(drop: Scene, recorded: Make) -> None:
    sim = HybridSimulator(drop, recorded(drop, 200, r_t=2))
    sim.advance(21)
    none = np.zeros((sim.particle_count, 2), dtype=np.float32)
    push = none + np.array([3, 0], dtype=np.float32)
    sim.advance(1, none)
    assert sim.mode == "neural"
    sim.advance(1)
    sim.advance(6, push)
    assert (sim.mode, sim.log[-1].reason, sim.log[-1].frame) == ("mpm", "force", 23)
    mpm = MpmSolver(drop)
    mpm.advance(23)
    mpm.advance(6, push)
    assert np.abs(sim.positions - mpm.positions).max() < 1e-4
    assert np.abs(sim.velocities - mpm.velocities).max() < 0.01
    per_frame = np.zeros((4, *push.shape), dtype=np.float32)
    per_frame[3] = 5
    sim.advance(4, per_frame)
    assert sim.frame == 33


def test_switches_are_bounded_by_the_wait(fall: Scene, fake: Make) -> None:
    wait = 10
    for kind in ("nan", "random", "held"):
        sim = HybridSimulator(fall, fake(kind, r_p=0.25), wait=wait)
        sim.advance(400)
        frames = np.array([decision.noticed for decision in sim.log])
        for start in range(0, 400, 50):
            inside = np.count_nonzero((frames >= start) & (frames < start + 100))
            assert inside <= 2 * 100 / wait


def test_between_steps_diagnostics_are_those_of_the_state_shown(drop: Scene, fake: Make) -> None:
    sim = HybridSimulator(drop, fake("fall", r_t=2))
    sim.advance(21)
    totals = sim.diagnostics()
    assert totals.centroid == pytest.approx(np.average(sim.positions, axis=0, weights=sim.mass), abs=1e-5)
    assert sim.time == pytest.approx(21 * 0.0025)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"r_c": 1.5}, r"r_c must be in \[-1, 1\], got 1.5"),
        ({"r_c": float("nan")}, r"r_c must be in \[-1, 1\]"),
        ({"window": 101}, r"window must be in \[1, 100\], got 101"),
        ({"window": 0}, r"window must be in \[1, 100\], got 0"),
        ({"wait": 0}, r"wait must be in \[1, 100\], got 0"),
        ({"shortcuts": 1}, "shortcuts must be True or False, got 1"),
        ({"guards": ["cosine", "luck"]}, r"guards must be among cosine, .*; got 'luck'"),
        ({"guards": "cosine"}, "guards must be a list"),
        ({"guards": ["energy", "energy"]}, "guards must differ, got 'energy' twice"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(
    fall: Scene, fake: Make, settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        HybridSimulator(fall, fake("fall"), **settings)


def test_scenes_that_a_network_cannot_simulate_are_refused(fall: Scene, fake: Make) -> None:
    other = fall.model_copy(update={"name": "of another kind"})
    with pytest.raises(ConfigError, match="'water', got 'of another kind'"):
        HybridSimulator(other, fake("fall"))
    sink = fall.model_copy(update={"sinks": (BallSink(center=(0.5, 0.1), radius=0.05),)})
    with pytest.raises(ConfigError, match="remove emitters and sinks"):
        HybridSimulator(sink, fake("fall"))
    paddle = BoxObstacle(lower=(0.2, 0.2), upper=(0.3, 0.3), motion=Motion(velocity=(0.1, 0.0)))
    moving = fall.model_copy(update={"obstacles": (paddle,)})
    with pytest.raises(ConfigError, match="remove `motion`"):
        HybridSimulator(moving, fake("fall"))


def test_bad_calls_are_refused_and_move_nothing(fall: Scene, fake: Make) -> None:
    sim = HybridSimulator(fall, fake("fall", r_t=2))
    with pytest.raises(ConfigError, match="frames must be in"):
        sim.advance(-1)
    sim.advance(12)
    wrong = HybridSimulator(fall, fake(lambda history, _: history[-1][:5]), shortcuts=False)
    with pytest.raises(ConfigError, match=r"must answer positions of shape \(256, 2\), got \(5, 2\)"):
        wrong.advance(10)


def test_guards_are_listed_by_their_names() -> None:
    assert [guard.name for guard in GUARDS.values()] == list(GUARDS)


def test_free_fall_is_answered_without_the_network(fall: Scene, fake: Make) -> None:
    network = fake("nan", r_t=2)
    sim = HybridSimulator(fall, network)
    sim.advance(60)
    assert network.calls == []
    assert (sim.mode, sim.step_counts) == ("neural", StepCounts(free_fall=50))
    mpm = MpmSolver(fall)
    mpm.advance(60)
    assert np.abs(sim.positions - mpm.positions).max() < 1e-4
    assert np.abs(sim.velocities - mpm.velocities).max() < 0.01


def test_what_touches_anything_does_not_fall_freely(fake: Make) -> None:
    """A wall, an obstacle and another body that comes near end the free fall of all."""
    falling = Box(material="water", lower=(0.4, 0.5), upper=(0.5, 0.6))
    below = Box(material="water", lower=(0.4, 0.25), upper=(0.5, 0.35), velocity=(0.0, 2.0))
    ramp = BoxObstacle(lower=(0.3, 0.25), upper=(0.6, 0.3))
    for more in ({"obstacles": (ramp,)}, {"bodies": (falling, below)}):
        scene = Scene(dim=2, resolution=64, **{"bodies": (falling,), **more})
        network = fake("fall", r_t=2)
        sim = HybridSimulator(scene, network, guards=())
        first = next(frame for frame in range(1, 120) if sim.advance(1) is None and network.calls)
        apart = MpmSolver(scene).rollout(first)
        fell = np.diff(apart[:, :, 1].astype(np.float64), n=2, axis=0) / scene.frame_dt**2
        # The network is asked before MPM feels the contact, or soon after.
        felt = int(np.argmax(np.abs(fell + 9.81).max(axis=1) > 5.0)) + 1
        assert abs(first - felt) <= 12
        assert sim.step_counts.free_fall > 15


def test_a_scene_at_rest_stays_as_it_is_without_network_and_mpm(pool: Scene, fake: Make) -> None:
    network = fake("nan", r_t=2)
    sim = HybridSimulator(pool, network)
    sim.advance(600)
    assert sim.mode == "neural"
    asked, at_rest, before = len(network.calls), sim.step_counts.rest, sim.positions
    sim.advance(100)
    np.testing.assert_array_equal(sim.positions, before)
    assert not sim.velocities.any()
    assert (len(network.calls), sim.step_counts.rest) == (asked, at_rest + 100)
    truth = MpmSolver(pool)
    truth.advance(700)
    assert np.abs(sim.positions.mean(axis=0) - truth.positions.mean(axis=0)).max() < 2e-3
    # A push wakes it.
    sim.advance(10, (3.0, 0.0))
    assert (sim.mode, sim.log[-1].reason) == ("mpm", "force")
    assert sim.velocities[:, 0].mean() > 0.01


@pytest.mark.parametrize("kind", ["fall", "random weak", "held"])
def test_frames_are_counted_once_whatever_is_undone(splash: Scene, fake: Make, kind: str) -> None:
    sim = HybridSimulator(splash, fake(kind, r_p=0.5, r_t=2))
    for frame in range(1, 150):
        sim.advance(1)
        assert sum(vars(sim.step_counts).values()) == pytest.approx(frame * (1 - sim.mpm_share), abs=1e-9)


def test_a_thrown_body_does_not_rest_at_its_highest_point(fake: Make) -> None:
    up = Box(material="water", lower=(0.4, 0.4), upper=(0.5, 0.5), velocity=(0.0, 0.3))
    sim = HybridSimulator(Scene(dim=2, resolution=64, bodies=(up,)), fake("nan", r_t=1))
    sim.advance(30)
    assert sim.step_counts == StepCounts(free_fall=25)
    assert sim.velocities[:, 1].max() < -0.4


def test_a_cosine_that_is_asked_for_is_a_guard(fall: Scene, fake: Make) -> None:
    assert HybridSimulator(fall, fake("fall")).r_c is None
    assert HybridSimulator(fall, fake("fall"), r_c=0.3).r_c == 0.3
    assert HybridSimulator(fall, fake("fall"), guards=["cosine"]).r_c == 0.8


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["simulate", *words], prog_name="hybridmpm")


@pytest.fixture
def scene_file(tmp_path: Path, fall: Scene) -> Path:
    file = tmp_path / "fall.json"
    file.write_text(fall.model_dump_json())
    return file


def test_the_hybrid_simulates_and_tells_the_share_of_mpm(scene_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "fall.npz"
    done = run("--scene", str(scene_file), "--solver", "hybrid", "--model", "zero", "--frames", "30",
               "--every", "10", "--out", str(out))  # fmt: skip
    assert done.exit_code == 0, done.output
    # 10 frames of warm-up; the block is still falling after 30.
    assert "33 % of the frames by MPM" in done.output
    assert np.load(out)["positions"].shape == (4, 256, 2)


def test_a_network_simulates_alone(scene_file: Path) -> None:
    done = run("--scene", str(scene_file), "--solver", "neural", "--model", "zero", "--frames", "30")
    assert done.exit_code == 0, done.output
    assert "fall: 256 particles, 30 frames" in done.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--solver", "mpm", "--model", "zero"], "'--model' is for --solver neural or hybrid, not for mpm"),
        (["--solver", "hybrid", "--substeps", "3"], "'--substeps' is for --solver mpm, not for hybrid"),
        (["--solver", "neural", "--r-c", "0.5"], "'--r-c' is for --solver hybrid, not for neural"),
        (["--solver", "hybrid"], "choose a network by --model NAME"),
        (["--solver", "hybrid", "--model", "zero", "--r-c", "1.5"], "1.5 is not in the range"),
        (["--solver", "hybrid", "--model", "none such"], "there is no model 'none such'"),
    ],
)
def test_what_cannot_be_is_refused(scene_file: Path, words: list[str], message: str) -> None:
    done = run("--scene", str(scene_file), "--frames", "1", *words)
    assert done.exit_code != 0
    assert message in f"{done.output} {done.exception}"
