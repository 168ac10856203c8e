"""Data sets of control: reversed cases with their sketches, made, resumed, read and converted."""

import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from hybridmpm import ConfigError, DataError, MpmSolver, data
from hybridmpm.cli import cli
from hybridmpm.control import Arrow, Ellipse, parse_png, parse_strokes, reversed_from_seed
from hybridmpm.data import metadata

from .conftest import DROPS, trajectories

RECIPE = data.Recipe(template=data.SceneTemplate(DROPS), frames=12, control=True)
SEEDS = data.Seeds(train=6, valid=1, test=0)


def make(recipe: data.Recipe, folder: Path, seeds: data.Seeds, threads: int = 2) -> data.Report:
    return data.generate(data.plan(recipe, folder, seeds), executor=data.Threads(threads))


@pytest.fixture(scope="module")
def led(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a data set of 6 + 1 controlled trajectories; not to be written to."""
    folder = tmp_path_factory.mktemp("data") / "led"
    assert make(RECIPE, folder, SEEDS).made == 7
    return folder


def test_a_trajectory_is_the_case_of_its_seed_with_the_obstacles(led: Path) -> None:
    for seed, trajectory in enumerate(trajectories(led)):
        case = reversed_from_seed(RECIPE.scene(seed), seed, frames=12)
        control, fluid = trajectory.control, trajectory.types != 3
        assert (~fluid).any()
        assert np.array_equal(trajectory.positions[:, fluid], case.positions)
        assert np.array_equal(trajectory.force[:, fluid], case.forces)
        assert np.array_equal(control.smoothed_force[:, fluid], case.smoothed_forces)
        assert np.array_equal(control.velocity[fluid], case.velocities)
        assert np.array_equal(control.target[fluid], case.target)
        assert np.array_equal(control.target[~fluid], trajectory.positions[0, ~fluid])
        assert not control.velocity[~fluid].any()
        assert not trajectory.force[:, ~fluid].any()
        assert (control.control_frame, control.start, control.cap) == (case.control_frame, case.start, 30)
        assert control.sketch.kind == case.sketch.kind


def test_the_force_gives_the_positions_from_the_stored_start(led: Path) -> None:
    live = next(one for one in trajectories(led) if one.control and one.control.start == "live")
    assert live.scene is not None
    assert live.force is not None
    solver = MpmSolver(live.scene, substeps="reference")
    solver.advance(live.control.control_frame)
    fluid = live.types != 3
    assert np.array_equal(solver.velocities, live.control.velocity[fluid])
    assert np.array_equal(solver.rollout(12, live.force[:, fluid]), live.positions[:, fluid])


def test_all_forms_of_the_sketch_mean_the_same(tmp_path: Path) -> None:
    recipe = data.Recipe(scenario="water_2d", frames=60, r_p=0.05, control=True)
    kinds = set()
    for seed in range(5):
        control = data.simulate(recipe, seed).control
        kinds.add(control.sketch.kind)
        drawn, seen = parse_strokes([control.stroke]), parse_png(control.picture)
        for read in (drawn, seen):
            if isinstance(control.sketch, Arrow):
                assert isinstance(read, Arrow)
                np.testing.assert_allclose(read.points[-1], control.sketch.points[-1], atol=0.03)
            else:
                assert isinstance(read, Ellipse)
                np.testing.assert_allclose(read.center, control.sketch.center, atol=0.03)
        assert control.stroke.times is not None
        assert len(control.stroke.times) == len(control.stroke.points)
    assert kinds == {"arrow", "ellipse"}


def test_a_run_is_resumed_to_the_same_data_by_any_number_of_threads(led: Path, tmp_path: Path) -> None:
    make(RECIPE, tmp_path, data.Seeds(train=2), threads=1)
    planned = data.plan(RECIPE, tmp_path, SEEDS)
    assert (planned.done, len(planned.todo)) == (2, 5)
    assert data.generate(planned, executor=data.Threads(3)).made == 5
    for split in ("train", "valid"):
        first, again = ([one.digest for one in trajectories(folder, split)] for folder in (led, tmp_path))
        assert first == again
    assert metadata.read(led)["hybridmpm"]["digests"] == metadata.read(tmp_path)["hybridmpm"]["digests"]
    assert metadata.read(led)["sequence_length"] == 12


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"stride": 2}, "control needs stride 1 and no random force, .* got stride 2 and force 0"),
        ({"force": 5.0}, "got stride 1 and force 5"),
        ({"frames": 5001}, r"frames must be in \[1, 5000\], got 5001"),
    ],
)
def test_settings_that_control_does_not_have_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        data.Recipe(**{"scenario": "sand_2d", "control": True, "frames": 4, **settings})


def test_a_hundred_frames_are_controlled_if_none_are_given() -> None:
    assert data.Recipe(scenario="sand_2d", control=True).frames == 100


def test_formats_keep_the_control_or_say_that_they_cannot(led: Path, tmp_path: Path) -> None:
    kept = data.convert(led, data.FORMATS["hybridmpm"], tmp_path / "lb", data.FORMATS["lagrangebench"])
    assert "control" not in kept.lost
    first, again = trajectories(led), trajectories(tmp_path / "lb", form="lagrangebench")
    assert [one.digest for one in first] == [one.digest for one in again]
    lost = data.convert(led, data.FORMATS["hybridmpm"], tmp_path / "gns", data.FORMATS["gns"])
    assert "control" in lost.lost


def test_commands_tell_and_show_it(led: Path, tmp_path: Path) -> None:
    def run(*arguments: object) -> str:
        result = CliRunner().invoke(cli, ["dataset", *map(str, arguments)], prog_name="hybridmpm")
        assert result.exit_code == 0, result.output
        return result.output

    run("generate", "sand_2d", "--control", "--trajectories", 1, "--valid", 0, "--test", 0, "--frames", 4,
        "--r-p", 0.1, "--out", tmp_path / "sand")  # fmt: skip
    (sand,) = trajectories(tmp_path / "sand")
    assert sand.control is not None
    text = run("stats", led, "--split", "train")
    names = {one.control.name for one in trajectories(led) if one.control}
    assert len(names) > 1
    assert all(name in text for name in names)
    sizes = []
    for folder in (led, tmp_path / "plain"):
        if folder != led:
            make(data.Recipe(template=data.SceneTemplate(DROPS), frames=4), folder, data.Seeds(train=1))
        run("view", folder, "--out", tmp_path / "sheet.png", "--index", 0, "--moments", 2, "--width", 100)
        with Image.open(tmp_path / "sheet.png") as sheet:
            sizes.append(sheet.size)
    assert sizes[0] == (sizes[1][0] + sizes[1][1] + 6, sizes[1][1])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda group: group.pop("target"), "the key 00000/target is missing"),
        (lambda group: group.pop("stroke"), "00000 has a damaged sketch"),
        (lambda group: group.attrs.pop("start"), "the attribute 'start' of 00000 is missing"),
        (lambda group: group.attrs.modify("start", "asleep"), "start must be one of live, reversed"),
        (lambda group: group["picture"].write_direct(np.zeros_like(group["picture"])), "is no PNG"),
        (lambda group: group["velocity"].write_direct(group["velocity"][()] + 1), "do not match its digest"),
        (lambda group: group["target"].write_direct(group["target"][()] * np.nan), "00000/target is nan"),
        (lambda group: group.pop("force"), "00000/force is missing"),
        (lambda group: group.attrs.modify("cap", 12.0), "do not match its digest"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_damaged_controls_are_named(damage: Any, message: str, led: Path, tmp_path: Path) -> None:
    shutil.copytree(led, tmp_path / "led")
    with h5py.File(tmp_path / "led" / "train.h5", "r+") as file:
        damage(file["00000"])
    with pytest.raises(DataError, match=message):
        trajectories(tmp_path / "led")
