"""Coarse levels: the table that ships with the library, and what becomes of it in a scene."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import hybridmpm
from hybridmpm import (
    SOLVER_VERSION,
    BallSink,
    Box,
    BoxObstacle,
    BoxSink,
    CoarseWarning,
    ConfigError,
    DataError,
    Elastic,
    InvertedError,
    Motion,
    MpmSolver,
    Polygon,
    RectangularEmitter,
    Sand,
    Scene,
    SnapshotError,
    Water,
    scenarios,
)
from hybridmpm.cli import cli
from hybridmpm.coarse import (
    CoarseLevel,
    coarse_level,
    coarse_resolution,
    coarse_table,
    coarse_warnings,
    fastest_impact,
    settled_potential,
)
from hybridmpm.mpm.stepper import MpmStepper
from hybridmpm.simulators import make
from hybridmpm.snapshots import read_state, write_state

NAMES = ["1/64", "1/32", "1/16", "1/8", "1/4"]


def block(material: object, lower: tuple[float, ...], upper: tuple[float, ...], **more: object) -> Box:
    return Box(material=material, lower=lower, upper=upper, **more)


def pool(depth: float, **water: object) -> Scene:
    body = block(Water(**water), (0.1, 0.1), (0.9, 0.1 + depth))
    return Scene(dim=2, resolution=64, bodies=(body,))


def test_the_table_is_whole() -> None:
    table = coarse_table()
    # Version 5 differs where boxes end on walls; scenarios have no boxes.
    assert table.solver_version in (4, SOLVER_VERSION)
    assert list(table.ratios) == NAMES
    assert len(table.entries) == len(NAMES) * 4
    for entry in table.entries:
        assert entry.r_p == eval(entry.name)  # noqa: S307 - a fraction of this library
        assert table.find(entry.material, entry.dim, entry.name) is entry
        assert max(entry.seeds) < 1_000_000
        assert entry.trials >= 20
        own, *_ = entry.held_out
        assert own.scenario == f"{entry.material}_{entry.dim}d"
        assert own.scenes >= 10
        assert own.density <= 1.3
        for seen in entry.held_out:
            assert seen.first_seed >= 1_100_000
            assert seen.density > 0
            assert seen.error_se > 0


@pytest.mark.parametrize("material", ["water", "sand"])
@pytest.mark.parametrize("dim", [2, 3])
def test_more_particles_err_less(material: str, dim: int) -> None:
    entries = [coarse_table().find(material, dim, name) for name in NAMES]
    errors = [entry.held_out[0].error for entry in entries if entry is not None]
    assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("scenario", scenarios.NAMES)
def test_scenarios_are_within_the_bounds(scenario: str) -> None:
    for seed in range(1_100_000, 1_100_040):
        scene = scenarios.get(scenario, seed)
        # Ramps at random leave gaps that the level chokes.
        told = coarse_warnings(scene, coarse_level(scene, "1/16"))
        assert all("ramps" in scenario and text.startswith("the gap of") for text in told)


def test_constants_are_those_of_the_table() -> None:
    scene, entry = scenarios.sand_2d(0), coarse_table().find("sand", 2, "1/8")
    assert entry is not None
    level = coarse_level(scene, "1/8")
    assert (level.r_p, level.moduli, level.cfl) == (1 / 8, (entry.modulus,), entry.cfl)
    assert (level.affine_share, level.relaxation) == (entry.affine_share, entry.relaxation)
    assert level.resolution == coarse_resolution(scene, 1 / 8, entry.particles_per_cell)
    solver = MpmSolver(scene, coarse="1/8")
    assert solver.coarse == level
    assert (solver.r_p, solver.resolution) == (1 / 8, level.resolution)
    assert solver.particle_count == len(scene.sample().x)
    assert len(solver.coarse_positions) == round(solver.particle_count / 8)
    assert MpmSolver(scene).coarse is None


def test_mixed_materials_take_the_more_careful_constants() -> None:
    scene = scenarios.water_sand_2d(0)
    entries = [coarse_table().find(one.kind, 2, "1/16") for one in scene.materials]
    level = coarse_level(scene, "1/16")
    assert level.cfl == min(one.cfl for one in entries if one)
    assert level.affine_share == min(one.affine_share for one in entries if one)
    assert level.relaxation == max(one.relaxation for one in entries if one)
    assert level.moduli == tuple(one.modulus for one in entries if one)
    per_cell = max(one.particles_per_cell for one in entries if one)
    assert level.resolution == coarse_resolution(scene, 1 / 16, per_cell)


def test_an_elastic_solid_keeps_its_stiffness() -> None:
    jelly = block(Elastic(), (0.4, 0.5), (0.6, 0.7))
    alone = Scene(dim=2, bodies=(jelly,))
    level = coarse_level(alone, "1/16")
    assert level == CoarseLevel.unfitted(alone, 1 / 16).named("1/16")
    both = Scene(dim=2, bodies=(jelly, block(Water(), (0.2, 0.1), (0.8, 0.2))))
    level = coarse_level(both, "1/16")
    assert level.moduli[0] == 1.0
    assert level.moduli[1] < 1.0
    assert level.cfl == pytest.approx(0.28)
    solver = MpmSolver(both, coarse="1/16")
    solver.advance(20)
    assert np.isfinite(solver.positions).all()


def test_deep_water_gets_a_stiffer_level() -> None:
    entry = coarse_table().find("water", 2, "1/16")
    assert entry is not None
    assert coarse_level(pool(0.05), "1/16").moduli == (entry.modulus,)
    deep = pool(0.4)
    (modulus,) = coarse_level(deep, "1/16").moduli
    stiffness = modulus * Water().stiffness(deep.potential_drop)
    assert 1000 * 9.81 * 0.4 / stiffness == pytest.approx(coarse_table().largest_compression, rel=1e-4)
    assert settled_potential(deep) == pytest.approx(9.81 * 0.4)
    # Nothing is made stiffer than the scene says.
    assert coarse_level(pool(0.6, max_compression=0.05), "1/16").moduli == (1.0,)


def test_deep_water_keeps_its_depth() -> None:
    solver = MpmSolver(pool(0.4), coarse="1/16")
    solver.advance(240)
    depth = 2 * (np.mean(solver.positions[:, 1], dtype=np.float64) - 0.1)
    assert depth == pytest.approx(0.4, rel=0.03)


def test_what_emitters_bring_counts_as_depth() -> None:
    jet = RectangularEmitter(
        material="water", lower=(0.2, 0.8), upper=(0.4, 0.8), velocity=(0.0, -1.0), stop=0.5
    )
    scene = Scene(dim=2, resolution=64, bodies=(), emitters=(jet,), frames=400)
    assert settled_potential(scene) == pytest.approx(9.81 * 0.2 * 0.5 / 0.8, rel=0.05)
    assert fastest_impact(scene) == pytest.approx((1 + 2 * 9.81 * 0.7) ** 0.5)
    solver = MpmSolver(scene, coarse="1/16")
    solver.advance(60)
    assert solver.particle_count > len(solver.coarse_positions) > 0


def test_an_obstacle_is_respected() -> None:
    ramp = BoxObstacle(lower=(0.4, 0.1), upper=(0.6, 0.3))
    body = block("sand", (0.3, 0.4), (0.7, 0.6))
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=(body,), obstacles=(ramp,)), coarse="1/16")
    solver.advance(120)
    inside = ((solver.positions > (0.401, 0.1)) & (solver.positions < (0.599, 0.299))).all(axis=1)
    assert not inside.any()


@pytest.mark.parametrize(
    ("name", "meant"),
    [("1/15", "1/16"), ("1/6", "1/64"), (1 / 16, "1/16"), (0.1, "1/8"), ("quick", None), (True, None)],
)
def test_an_unknown_level_lists_those_there_are(name: object, meant: str | None) -> None:
    with pytest.raises(ConfigError) as refused:
        MpmSolver(scenarios.water_2d(0), coarse=name)  # type: ignore[arg-type]
    text = str(refused.value)
    assert all(repr(one) in text for one in NAMES)
    assert text.endswith(f"did you mean {meant!r}?") == (meant is not None)


@pytest.mark.parametrize("setting", [{"cfl": 0.3}, {"substeps": 20}, {"r_p": 1 / 8}])
def test_what_a_level_chooses_is_refused_beside_it(setting: dict[str, float]) -> None:
    (name,) = setting
    with pytest.raises(ConfigError, match=f"{name} is chosen by the level: drop {name}"):
        MpmSolver(scenarios.water_2d(0), coarse="1/16", **setting)  # type: ignore[arg-type]


def test_constants_out_of_range_are_refused() -> None:
    scene = scenarios.water_2d(0)
    plain = {"name": "mine", "r_p": 1 / 16, "resolution": 45, "moduli": (1.0,)}
    with pytest.raises(ConfigError, match=r"factors in \(0, 1\], got 2.0"):
        CoarseLevel(**plain | {"moduli": (2.0,)})  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"affine_share must be in \[0, 1\]"):
        MpmSolver(scene, coarse=CoarseLevel(**plain, affine_share=1.5))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"relaxation must be in \[0, 8\]"):
        MpmSolver(scene, coarse=CoarseLevel(**plain, relaxation=9.0))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="2 moduli, but the scene has 1 material"):
        MpmSolver(scene, coarse=CoarseLevel(**plain | {"moduli": (1.0, 1.0)}))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="needs a name"):
        MpmSolver(scene, coarse=CoarseLevel(**plain | {"name": None}))  # type: ignore[arg-type]


def test_a_scene_too_fast_is_told() -> None:
    body = block("sand", (0.4, 0.4), (0.6, 0.6), velocity=(20.0, 0.0))
    with pytest.warns(
        CoarseWarning, match=r"this scene may reach 20 m/s, but coarse level '1/16' was fitted up"
    ) as told:
        MpmSolver(Scene(dim=2, resolution=64, bodies=(body,)), coarse="1/16")
    assert told[0].filename == __file__


def test_the_speed_of_a_paddle_counts_beside_that_of_the_fall() -> None:
    def warnings_at(rate: float) -> list[str]:
        paddle = BoxObstacle(
            lower=(0.4, 0.2), upper=(0.6, 0.3), motion=Motion(angular_velocity=rate, center=(0.5, 0.25))
        )
        scene = Scene(dim=2, bodies=(block("water", (0.4, 0.3), (0.6, 0.5)),), obstacles=(paddle,))
        return coarse_warnings(scene, coarse_level(scene, "1/16"))

    # Its corners are .112 m from its centre, and the block falls onto it at up to 2 m/s.
    assert warnings_at(20) == []
    (told,) = warnings_at(30)
    assert "may reach 5.3 m/s" in told


def test_a_box_that_is_full_is_told() -> None:
    def warnings_of(height: float) -> list[str]:
        body = block("water", (0.1, 0.1), (0.9, 0.1 + height))
        scene = Scene(dim=2, resolution=64, bodies=(body,))
        return coarse_warnings(scene, coarse_level(scene, "1/16"))

    (told,) = warnings_of(0.8)
    assert "matter fills 100% of the box" in told
    assert warnings_of(0.76) == []


@pytest.mark.parametrize("resolution", [128, 72, 64])
def test_obstacles_thinner_than_a_cell_are_told(resolution: int) -> None:
    body = block("water", (0.4, 0.6), (0.6, 0.8))
    plates = [BoxObstacle(lower=(0.2, 0.3), upper=(0.8, 0.3 + thickness)) for thickness in (0.014, 0.04)]
    thick = Scene(dim=2, resolution=resolution, bodies=(body,), obstacles=tuple(plates[1:]))
    levels = {name: coarse_level(thick, name) for name in NAMES[2:]}
    assert not any(coarse_warnings(thick, level) for level in levels.values())
    cells = {name: 1 / level.resolution for name, level in levels.items()}
    scene = thick.model_copy(update={"obstacles": tuple(plates)})
    (warning,) = coarse_warnings(scene, coarse_level(scene, "1/16"))
    head, advice = warning.split(", so material may pass through it: make it at least ")
    assert head.startswith("obstacles[0] (box) is 0.014 m thick, less than a cell of ")
    assert cells["1/16"] == pytest.approx(float(advice.split(" m thick")[0]), abs=1e-4)
    fits = [name for name, cell in cells.items() if cell <= 0.0139]
    assert bool(fits) == (resolution == 128)
    if resolution == 128:
        assert advice.endswith(f" m thick, or take coarse level {fits[0]!r}")
    elif resolution == 72:
        assert advice.endswith(" m thick, or take MpmSolver(scene), which simulates all particles")
    else:  # Thinner than a cell of the scene's own grid.
        assert advice.endswith(" m thick")


class FailsAtFrame:
    """A compiled solver whose frames fail from a certain one on until another has made that frame."""

    def __init__(self, solver: object, frame: int) -> None:
        self._solver, self._frame = solver, frame

    def __getattr__(self, name: str) -> object:
        return getattr(self._solver, name)

    def advance(self, frames: int, force: object) -> None:
        for _ in range(frames):
            if self._solver.frame + 1 == self._frame:  # type: ignore[attr-defined]
                raise InvertedError("particle 3 is inverted in frame 6")
            self._solver.advance(1, force)  # type: ignore[attr-defined]


def test_a_frame_that_fails_is_done_again_at_the_safe_step() -> None:
    solver = MpmSolver(scenarios.water_2d(0), coarse="1/16")
    untroubled = solver.copy()
    frames = solver._stepper
    frames.solver = FailsAtFrame(frames.solver, 6)  # type: ignore[assignment]
    with pytest.warns(CoarseWarning, match=r"frame 6 failed at the step of coarse level '1/16'"):
        solver.advance(10, force=(0.5, 0.0))
    untroubled.advance(10, force=(0.5, 0.0))
    assert solver.redone_frames == (6,)
    assert untroubled.redone_frames == ()
    assert solver.frame == 10
    # In free fall shorter steps move particles by some micrometres less.
    np.testing.assert_allclose(solver.positions, untroubled.positions, atol=1e-5)
    solver.advance(1)
    solver.reset()
    assert solver.redone_frames == ()


def test_a_frame_that_fails_again_is_an_error() -> None:
    solver = MpmSolver(scenarios.water_2d(0), coarse="1/16")
    inner = solver._stepper.solver

    def safe() -> object:
        return FailsAtFrame(inner.copy(), 3)

    frames = MpmStepper(FailsAtFrame(inner, 3), None, safe)  # type: ignore[arg-type]
    with pytest.raises(InvertedError):
        frames.advance(5, None)
    assert (frames.solver.frame, frames.redone) == (2, ())


def test_snapshots_hold_the_settings_of_the_level(tmp_path: Path) -> None:
    solver = MpmSolver(scenarios.water_2d(0), coarse="1/32")
    solver.advance(71)
    file = tmp_path / "state.hmpm"
    solver.save(file)
    saved = read_state(file)
    assert saved.settings["coarse"]["name"] == "1/32"
    loaded = hybridmpm.load(file)
    assert isinstance(loaded, MpmSolver)
    assert loaded.coarse == solver.coarse
    for one in (loaded, solver):
        one.advance(30)
    assert loaded.positions.tobytes() == solver.positions.tobytes()
    saved.settings["coarse"]["resolution"] += 1
    write_state(file, saved)
    with pytest.raises(SnapshotError, match="cannot be restored"):
        hybridmpm.load(file)
    del saved.settings["coarse"]["moduli"]
    write_state(file, saved)
    with pytest.raises(SnapshotError, match="moduli"):
        hybridmpm.load(file)


def test_softened_materials() -> None:
    assert Water(max_compression=0.02).softened(0.5, 4.0).stiffness(4.0) == 0.5 * 1000 * 4 / 0.02
    assert Sand().softened(0.25, 0.0).youngs_modulus == 0.4e6
    assert Elastic().softened(0.5, 0.0).youngs_modulus == 1.5e5


def test_simulators_and_the_command_line_know_level(tmp_path: Path) -> None:
    solver = make("mpm", scenarios.water_2d(0), coarse="1/16")
    assert isinstance(solver, MpmSolver)
    assert solver.coarse is not None
    with pytest.raises(ConfigError, match="coarse belongs to 'mpm', not to 'neural'"):
        make("neural", scenarios.water_2d(0), coarse="1/16", model="zero")
    file = tmp_path / "state.hmpm"
    run = CliRunner().invoke
    done = run(cli, ["simulate", "water_2d", "--coarse", "1/16", "--frames", "8", "--save", str(file)])
    assert done.exit_code == 0, done.output
    assert "3725 particles" in done.output
    assert hybridmpm.load(file).r_p == 1 / 16
    refused = run(cli, ["simulate", "water_2d", "--coarse", "1/15", "--frames", "8"])
    assert refused.exit_code == 2
    assert "did you mean '1/16'?" in refused.output
    refused = run(cli, ["simulate", "--resume", str(file), "--coarse", "1/16"])
    assert refused.exit_code == 2
    assert "--coarse" in refused.output


def test_a_damaged_table_is_told(tmp_path: Path) -> None:
    file = tmp_path / "levels.json"
    with pytest.raises(DataError, match=r"levels.json is missing or damaged"):
        coarse_table(file)
    file.write_text('{"solver_version": 4}')
    with pytest.raises(DataError, match=r"levels.json is missing or damaged.*entries"):
        coarse_table(file)


def unsuited(level: str, **parts: object) -> list[str]:
    """Return what coarse warnings say of a scene of water, or of bodies that are given."""
    water = block("water", (0.2, 0.5), (0.8, 0.8))
    scene = Scene(**{"dim": 2, "bodies": (water,)} | parts)  # type: ignore[arg-type]
    return coarse_warnings(scene, coarse_level(scene, level))


def test_sinks_of_few_cells_are_told() -> None:
    def sinks(width: float, height: float) -> tuple[BoxSink]:
        return (BoxSink(lower=(0.5 - width / 2, 0.1), upper=(0.5 + width / 2, 0.1 + height)),)

    (small,) = unsuited("1/64", sinks=sinks(0.04, 0.02))
    assert small.startswith("sinks[0] has 0.67 cells of coarse level '1/64' and is 0.58 of them thick")
    (flat,) = unsuited("1/16", sinks=sinks(0.6, 0.007))
    assert "0.41 of them thick" in flat
    assert unsuited("1/64", sinks=sinks(0.3, 0.05)) == unsuited("1/4", sinks=sinks(0.05, 0.03)) == []
    (ball,) = unsuited("1/16", sinks=(BallSink(center=(0.5, 0.15), radius=0.015),))
    assert ball.startswith("sinks[0]")


def test_thin_bodies_are_told() -> None:
    beam = block(Elastic(), (0.2, 0.5), (0.8, 0.53))
    (text,) = unsuited("1/16", bodies=(beam,))
    assert text.startswith(
        "bodies[0] (elastic) is 0.03 m thin, less than 2 cells of 0.0223 m of coarse level"
    )
    assert unsuited("1/4", bodies=(beam,)) == []
    slanted = Polygon(material=Elastic(), vertices=((0.2, 0.2), (0.22, 0.19), (0.72, 0.69), (0.7, 0.7)))
    assert unsuited("1/16", bodies=(slanted,))[0].startswith("bodies[0] (elastic) is 0.02")
    film = block("water", (0.1, 0.1), (0.9, 0.11))
    assert [text.partition(" ")[0] for text in unsuited("1/64", bodies=(film,))] == ["bodies[0]", "matter"]
    # One cell of the scene's own grid: there the finding is the scene's.
    assert unsuited("1/64", bodies=(block("water", (0.1, 0.1), (0.9, 0.107)),)) == []


def test_gaps_that_a_level_chokes_are_told() -> None:
    def plate(gap: float, *more: BoxObstacle) -> tuple[BoxObstacle, ...]:
        left = BoxObstacle(lower=(0.1, 0.4), upper=(0.5 - gap / 2, 0.45))
        right = BoxObstacle(lower=(0.5 + gap / 2, 0.4), upper=(0.9, 0.45))
        return (left, right, *more)

    (text,) = unsuited("1/64", obstacles=plate(0.05))
    assert "the gap of 0.05 m between obstacles[0] and obstacles[1] is 1.4 cells" in text
    assert "may let as little as 13% of the scene's flow through: widen it to" in text
    assert unsuited("1/4", obstacles=plate(0.05)) == unsuited("1/64", obstacles=plate(0.3)) == []
    assert unsuited("1/64", obstacles=plate(0.0)) == []
    tank = (
        BoxObstacle(lower=(0.3, 0.1), upper=(0.32, 0.6)),
        BoxObstacle(lower=(0.6, 0.18), upper=(0.62, 0.6)),
        BoxObstacle(lower=(0.3, 0.1), upper=(0.62, 0.15)),
    )
    hole = "the gap of 0.03 m between obstacles[1] and obstacles[2]"
    assert any(text.startswith(hole) for text in unsuited("1/64", obstacles=tank))
    # Matter takes the wide way beside a slot.
    assert unsuited("1/16", obstacles=(plate(0.03)[0],)) == []
    moving = BoxObstacle(lower=(0.1, 0.4), upper=(0.48, 0.45), motion={"velocity": (0.1, 0.0)})
    assert unsuited("1/16", obstacles=(moving, plate(0.04)[1])) == []
