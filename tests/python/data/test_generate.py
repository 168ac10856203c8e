"""Generation: reproducible, parallel, resumable after anything, and honest about what failed."""

import errno
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml

from hybridmpm import SOLVER_VERSION, ConfigError, DataError, ExportError, MpmSolver, data, scenarios
from hybridmpm.data import hdf5, metadata
from hybridmpm.data.generation.shards import Shards
from hybridmpm.data.generation.simulate import RandomForce
from hybridmpm.data.statistics import Moments

from .conftest import DROPS, SOME_TOO_STIFF, trajectories

if TYPE_CHECKING:
    from collections.abc import Callable


def make(recipe: data.Recipe, folder: Path, seeds: data.Seeds) -> data.Report:
    return data.generate(data.plan(recipe, folder, seeds), executor=data.Threads(2))


def digests(folder: Path) -> dict[int | None, str]:
    return {
        one.seed: one.digest for split in ("train", "valid", "test") for one in trajectories(folder, split)
    }


def test_merged_particles_move_as_the_solver_moves_them() -> None:
    trajectory = data.simulate(data.Recipe(scenario="water_2d", frames=6, r_p=0.25), 7)
    whole, merged = (MpmSolver(scenarios.water_2d(7), substeps="reference", r_p=r_p) for r_p in (1.0, 0.25))
    np.testing.assert_array_equal(trajectory.positions, merged.rollout(6))
    assert trajectory.positions.shape[1] == pytest.approx(0.25 * whole.particle_count, rel=0.01)


def test_a_trajectory_is_what_the_solver_does() -> None:
    recipe = data.Recipe(scenario="water_ramps_2d", frames=12, stride=4)
    trajectory = data.simulate(recipe, 7)
    solver = MpmSolver(scenarios.water_ramps_2d(7), substeps="reference")
    fluid = trajectory.types != 3
    np.testing.assert_array_equal(trajectory.positions[:, fluid], solver.rollout(12)[::4])
    assert set(trajectory.types[fluid]) == {5}
    solid = np.ascontiguousarray(trajectory.positions[:, ~fluid])
    assert (solid == solid[0]).all()
    inside = np.min([o.to_native().signed_distance(solid[0]) for o in solver.scene.obstacles], axis=0)
    assert (inside < 0).all()
    assert (trajectory.mass[fluid] > 0).all()
    assert not trajectory.mass[~fluid].any()


def test_the_stored_force_gives_the_trajectory(drops: data.Recipe) -> None:
    trajectory = data.simulate(drops, 3)
    assert trajectory.scene is not None
    fluid = trajectory.types != 3
    force = trajectory.force[:, fluid]
    solver = MpmSolver(trajectory.scene, substeps="reference")
    np.testing.assert_array_equal(trajectory.positions[:, fluid], solver.rollout(8, force))
    assert not trajectory.force[:, ~fluid].any()
    assert 1.0 < np.sqrt((force.astype(np.float64) ** 2).sum(axis=2).mean()) < 15.0


def test_the_random_force_has_the_strength_asked_for() -> None:
    x = np.random.default_rng(0).uniform(0, 1, (4000, 2)).astype(np.float32)
    squares = [
        (RandomForce(2, 5.0, seed).at(x, time) ** 2).sum(axis=1).mean()
        for seed in range(40)
        for time in (0.0, 1.3, 2.9)
    ]
    assert np.sqrt(np.mean(squares)) == pytest.approx(5.0, rel=0.1)


def test_max_compression_makes_all_water_as_stiff_as_asked() -> None:
    recipe = data.Recipe(scenario="water_sand_2d", frames=4, max_compression=0.01, substeps="cfl")
    soft = scenarios.water_sand_2d(5)
    stiff = recipe.scene(5)
    for body, before in zip(stiff.bodies, soft.bodies, strict=True):
        if body.material.kind == "water":
            assert body.material.max_compression == 0.01
        else:
            assert body == before


def test_layout_and_metadata(made: Path, drops: data.Recipe) -> None:
    assert sorted(path.name for path in made.iterdir()) == [
        "metadata.json",
        "test.h5",
        "train.h5",
        "valid.h5",
    ]
    about = metadata.read(made)
    assert about["bounds"] == [[0.1, 0.9], [0.1, 0.9]]
    assert (about["dim"], about["dt"], about["sequence_length"]) == (2, 0.0025, 8)
    assert about["default_connectivity_radius"] == pytest.approx(2 * 0.011339, rel=1e-4)
    assert (about["num_trajs_train"], about["sequence_length_train"]) == (4, 9)
    ours = about["hybridmpm"]
    assert ours["seeds"] == {"train": [[0, 3]], "valid": [[10**6, 10**6]], "test": [[1100000, 1100000]]}
    assert {material["kind"] for material in ours["materials"]} == {"water", "sand"}
    with hdf5.reading(made / "train.h5") as file:
        assert list(file) == ["00000", "00001", "00002", "00003"]
        group = file["00002"]
        assert group["position"].dtype == np.float32
        assert group["position"].shape == (9, len(group["particle_type"]), 2)
        assert set(group["particle_type"][()]) <= {3, 5, 6}
        assert group.attrs["seed"] == 2
    for number, trajectory in enumerate(trajectories(made)):
        alone = data.simulate(drops, number)
        assert alone.digest == trajectory.digest
        assert alone.scene == trajectory.scene
    assert about["num_particles_max"] == max(one.positions.shape[1] for one in trajectories(made))


def test_more_trajectories_are_added_to_those_there(tmp_path: Path, made: Path, drops: data.Recipe) -> None:
    make(drops, tmp_path / "grown", data.Seeds(train=2))
    before = (tmp_path / "grown" / "train.h5").read_bytes()
    planned = data.plan(drops, tmp_path / "grown", data.Seeds(train=4, valid=1, test=1))
    assert (planned.done, planned.todo) == (2, (2, 3, 1000000, 1100000))
    report = data.generate(planned, executor=data.Threads(1))
    assert report.made == 4
    assert digests(tmp_path / "grown") == digests(made)
    assert metadata.read(tmp_path / "grown")["hybridmpm"] == metadata.read(made)["hybridmpm"]
    assert before != (tmp_path / "grown" / "train.h5").read_bytes()
    again = data.plan(drops, tmp_path / "grown", data.Seeds(train=4, valid=1, test=1))
    assert again.todo == ()
    assert data.generate(again, executor=data.Threads(1)).made == 0


def test_another_recipe_is_refused(made: Path) -> None:
    other = data.Recipe(template=data.SceneTemplate(DROPS), frames=10, force=5.0)
    with pytest.raises(ConfigError, match=r"holds data made with frames = 8, not 10; choose another folder"):
        data.plan(other, made, data.Seeds(train=4))


@pytest.mark.parametrize(("noted", "version"), [({"solver_version": 7}, 7), ({}, 1)])
def test_data_of_another_solver_are_not_added_to(
    made: Path, drops: data.Recipe, tmp_path: Path, noted: dict[str, int], version: int
) -> None:
    """The first solver's data name no version."""
    about = metadata.read(made)
    assert about["hybridmpm"]["recipe"].pop("solver_version") == SOLVER_VERSION
    about["hybridmpm"]["recipe"] |= noted
    metadata.write(tmp_path, about)
    message = f"holds data made with solver_version = {version}, not {SOLVER_VERSION}; choose another folder"
    with pytest.raises(ConfigError, match=message):
        data.plan(drops, tmp_path, data.Seeds(train=4))


def test_two_processes_do_not_write_one_data_set(tmp_path: Path, drops: data.Recipe) -> None:
    planned = data.plan(drops, tmp_path, data.Seeds(train=1))
    with Shards(tmp_path).locked(), pytest.raises(ConfigError, match="another process is writing"):
        data.generate(planned, executor=data.Threads(1))


def command(folder: Path, scene: Path, *more: object) -> list[str]:
    words = ["dataset", "generate", "--scene", scene, "--out", folder, "--trajectories", 10, "--valid", 1]
    return [sys.executable, "-m", "hybridmpm", *map(str, [*words, "--test", 0, "--threads", 2, *more])]


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    (tmp_path / "drops.yaml").write_text(yaml.safe_dump(DROPS, sort_keys=False))
    return tmp_path / "drops.yaml"


def test_resumes_after_kill_9(tmp_path: Path, scene_file: Path) -> None:
    """The process dies in the middle; what is there is whole, and the rest comes out as without the kill."""
    folder, undisturbed = tmp_path / "killed", tmp_path / "undisturbed"
    kills = 0
    for wanted in (2, 5):
        process = subprocess.Popen(command(folder, scene_file, "--frames", 150), stderr=subprocess.DEVNULL)
        while len(list((folder / "shards").glob("[0-9]*.h5"))) < wanted and process.poll() is None:
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        kills += process.wait() == -signal.SIGKILL
        assert not (folder / "train.h5").exists()
        shards = list((folder / "shards").glob("[0-9]*.h5"))
        assert len(shards) >= wanted
        for path in shards:
            assert Shards(folder).read(int(path.stem)).positions.shape[0] == 151
    assert kills == 2
    # A half-written shard, as a kill between writing and renaming leaves it.
    (folder / "shards" / ".0000009.1.h5").write_bytes(shards[0].read_bytes()[:1000])
    subprocess.run(command(folder, scene_file, "--frames", 150), check=True, capture_output=True)
    subprocess.run(command(undisturbed, scene_file, "--frames", 150), check=True, capture_output=True)
    assert sorted(path.name for path in folder.iterdir()) == ["metadata.json", "train.h5", "valid.h5"]
    assert metadata.read(folder) == metadata.read(undisturbed)
    for split, count in (("train", 10), ("valid", 1)):
        found = trajectories(folder, split)
        assert [one.digest for one in found] == [one.digest for one in trajectories(undisturbed, split)]
        assert len({one.seed for one in found}) == count


def test_an_interrupt_stops_soon_and_keeps_what_is_done(tmp_path: Path, scene_file: Path) -> None:
    folder = tmp_path / "interrupted"
    words = command(folder, scene_file, "--frames", 200_000, "--stride", 1000)
    # Python ignores the signal where its parent did, as shells do for what they run in the background.
    heeding = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); import hybridmpm.cli as c"
    )
    process = subprocess.Popen(
        [words[0], "-c", f"{heeding}; c.main()", *words[3:]], stderr=subprocess.PIPE, text=True
    )
    while not (folder / "shards" / "recipe.json").exists():
        time.sleep(0.01)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "Interrupted" in errors
    assert "Traceback" not in errors
    assert not (folder / "train.h5").exists()


def test_shards_left_behind_after_assembly_are_no_duplicates(
    tmp_path: Path, made: Path, drops: data.Recipe
) -> None:
    """The process may die after a split appeared and before its shards are removed."""
    folder = tmp_path / "copy"
    shutil.copytree(made, folder)
    (folder / "metadata.json").unlink()
    shards = Shards(folder)
    shards.claim(drops)
    for seed in (0, 3):
        shards.store(seed, hdf5.file_bytes(data.simulate(drops, seed), "trajectory"))
    make(drops, folder, data.Seeds(train=4, valid=1, test=1))
    assert [one.seed for one in trajectories(folder)] == [0, 1, 2, 3]
    assert metadata.read(folder) == metadata.read(made)
    assert not (folder / "shards").exists()


def test_a_damaged_shard_is_named_and_made_anew(tmp_path: Path, made: Path, drops: data.Recipe) -> None:
    shards = Shards(tmp_path)
    shards.claim(drops)
    whole = {seed: hdf5.file_bytes(data.simulate(drops, seed), "trajectory") for seed in range(3)}
    # Water and sand are 5 and 6, so that 11 - type is the other one: a fault that only a digest can tell.
    place = whole[1].index(data.simulate(drops, 1).types.tobytes())
    other = bytes([11 - whole[1][place]])
    shards.store(0, whole[0][:-200])
    shards.store(1, whole[1][:place] + other + whole[1][place + 1 :])
    shards.store(2, whole[2])
    planned = data.plan(drops, tmp_path, data.Seeds(train=4, valid=1, test=1))
    assert planned.todo == (0, 1, 3, 1000000, 1100000)
    assert "0000000.h5 is no HDF5 file, or damaged or cut off" in planned.damaged[0]
    assert "0000001.h5: trajectory is damaged: its data do not match its digest" in planned.damaged[1]
    data.generate(planned, executor=data.Threads(2))
    assert digests(tmp_path) == digests(made)


def test_a_failed_simulation_is_named_and_the_others_stay(tmp_path: Path) -> None:
    recipe = data.Recipe(template=data.SceneTemplate(SOME_TOO_STIFF), frames=3, substeps=20)
    stiff = [seed for seed in range(8) if "100000000000" in recipe.scene(seed).to_json()]
    assert 0 < len(stiff) < 8
    report = make(recipe, tmp_path, data.Seeds(train=8))
    assert sorted(report.failed) == stiff
    assert report.made == 8 - len(stiff)
    assert all("substeps" in message for message in report.failed.values())
    assert [one.seed for one in trajectories(tmp_path)] == [seed for seed in range(8) if seed not in stiff]
    failed = metadata.read(tmp_path)["hybridmpm"]["failed"]
    assert failed == {str(seed): report.failed[seed] for seed in stiff}


def test_a_run_without_any_success_says_why(tmp_path: Path) -> None:
    recipe = data.Recipe(template=data.SceneTemplate(DROPS), frames=3, substeps=1)
    with pytest.raises(ConfigError, match=r"no trajectory could be made: seed \d: .*substeps"):
        make(recipe, tmp_path, data.Seeds(train=2))


def test_a_full_disk_keeps_what_is_done(
    tmp_path: Path, made: Path, drops: data.Recipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    write: Callable[[Path, bytes], int] = Path.write_bytes
    written: list[Path] = []

    def write_until_full(path: Path, content: bytes) -> int:
        if path.suffix == ".h5" and len(written) == 2:
            write(path, content[:500])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written.append(path)
        return write(path, content)

    seeds = data.Seeds(train=4, valid=1, test=1)
    monkeypatch.setattr(Path, "write_bytes", write_until_full)
    with pytest.raises(ExportError, match=r"cannot write .*shards/\d+\.h5: No space left on device"):
        make(drops, tmp_path, seeds)
    monkeypatch.undo()
    planned = data.plan(drops, tmp_path, seeds)
    assert (planned.done, planned.damaged) == (2, ())
    data.generate(planned, executor=data.Threads(1))
    assert digests(tmp_path) == digests(made)


def test_a_split_that_cannot_be_written_keeps_the_shards(tmp_path: Path, scene_file: Path) -> None:
    """The system itself refuses the file, as a full disk or a quota does: too large for `ulimit -f`."""
    folder = tmp_path / "limited"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    arguments = command(folder, scene_file, "--frames", 40)
    result = subprocess.run(arguments, capture_output=True, text=True, check=False, preexec_fn=limit)
    assert result.returncode == 1, result.stderr
    assert f"Error: cannot write {folder / 'train.h5'}: File too large" in result.stderr
    assert "Traceback" not in result.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["shards"]
    assert len(list((folder / "shards").glob("[0-9]*.h5"))) == 11
    again = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert "11 of them are there" in again.stderr
    assert len(trajectories(folder)) == 10


def test_room_is_asked_for_before_the_start(
    tmp_path: Path, drops: data.Recipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned = data.plan(drops, tmp_path, data.Seeds(train=40))
    exact = np.mean([data.simulate(drops, seed).positions.nbytes * 17 / 9 for seed in range(10)]) * 40
    assert planned.bytes_needed == pytest.approx(exact, rel=0.3)
    full = shutil.disk_usage(tmp_path)._replace(free=10_000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: full)
    with pytest.raises(
        ConfigError, match=r"needs up to .* GB while it is written, but its disk has 0\.00 GB"
    ):
        data.plan(drops, tmp_path, data.Seeds(train=40))


def test_a_folder_that_cannot_be_made(tmp_path: Path, drops: data.Recipe) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match=r"cannot write .*file/data/shards: Not a directory"):
        data.plan(drops, tmp_path / "file" / "data", data.Seeds(train=1))


def test_a_damaged_split_is_not_overwritten(tmp_path: Path, made: Path, drops: data.Recipe) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(made, folder)
    (folder / "train.h5").write_bytes((made / "train.h5").read_bytes()[:3000])
    with pytest.raises(DataError, match=r"train\.h5 is no HDF5 file, or damaged or cut off"):
        data.plan(drops, folder, data.Seeds(train=6))
    shutil.copy(made / "train.h5", folder)
    (folder / "metadata.json").write_text("{")
    with pytest.raises(DataError, match=r"metadata\.json is damaged"):
        data.plan(drops, folder, data.Seeds(train=6))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "needs a scenario or a scene template"),
        ({"scenario": "lava"}, "scenario: must be one of"),
        (
            {"scenario": "water_2d", "frames": 1},
            "frames must be a multiple of the stride, 1, at least twice, got 1",
        ),
        ({"scenario": "water_2d", "frames": 9, "stride": 2}, "multiple of the stride, 2"),
        ({"scenario": "water_2d", "r_p": 0.0}, r"r_p must be in \(0, 1\], got 0"),
        ({"scenario": "water_2d", "force": -1.0}, r"force must be in \[0, 1000\]"),
        ({"scenario": "water_2d", "force": 1.0, "stride": 2}, "force needs stride 1"),
        ({"scenario": "water_2d", "max_compression": 0.6}, "max_compression: must be in"),
    ],
)
def test_bad_recipes(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        data.Recipe(**settings)


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        ({"train": 0}, "needs at least one trajectory"),
        ({"train": -1}, "train must be in"),
        ({"train": 10, "first": 999_995}, r"seed \+ train must be at most 1000000"),
        ({"train": 10, "valid": 1, "first": 100_000}, r"seed \+ valid must be at most 100000"),
    ],
)
def test_bad_seeds(counts: dict[str, int], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        data.Seeds(**counts)


def test_moving_obstacles_are_refused(tmp_path: Path) -> None:
    paddle = {**DROPS["obstacles"][0], "motion": {"velocity": [0.1, 0.0]}}
    recipe = data.Recipe(template=data.SceneTemplate({**DROPS, "obstacles": [paddle]}), frames=4)
    with pytest.raises(ConfigError, match="may not have moving obstacles"):
        data.plan(recipe, tmp_path, data.Seeds(train=1))


def test_by_hand() -> None:
    # One particle goes 0, 1, 3 and 1, 1, 0; the other is kinematic.
    positions = np.array([[[0, 1], [9, 9]], [[1, 1], [9, 9]], [[3, 0], [9, 9]]], dtype=np.float32)
    total = data.statistics([data.Trajectory(positions=positions, types=np.array([5, 3]))])
    assert total.metadata() == {
        "vel_mean": [1.5, -0.5],
        "vel_std": [0.5, 0.5],
        "acc_mean": [1.0, -1.0],
        "acc_std": [0.0, 0.0],
    }
    assert (total.particles, total.states, total.types) == ([2], [3], {3: 1, 5: 1})


def test_parts_give_what_the_whole_gives() -> None:
    rng = np.random.default_rng(0)
    # A mean far from zero, where sums of squares would lose the spread.
    vectors = 1e4 + rng.normal(size=(5000, 3)) * (1.0, 0.1, 10.0)
    parts = Moments()
    for part in np.split(vectors, [1, 1, 700, 4000]):
        parts.add(part)
    assert parts.count == 5000
    np.testing.assert_allclose(parts.mean, vectors.mean(axis=0), rtol=1e-13)
    np.testing.assert_allclose(parts.std, vectors.std(axis=0), rtol=1e-9)


def test_metadata_hold_those_of_the_training_split(made: Path) -> None:
    moving = [one.positions[:, one.types != 3].astype(np.float64) for one in trajectories(made)]
    velocity = np.concatenate([np.diff(x, axis=0).reshape(-1, 2) for x in moving])
    acceleration = np.concatenate([np.diff(x, 2, axis=0).reshape(-1, 2) for x in moving])
    about = metadata.read(made)
    np.testing.assert_allclose(about["vel_mean"], velocity.mean(axis=0), rtol=1e-10)
    np.testing.assert_allclose(about["vel_std"], velocity.std(axis=0), rtol=1e-10)
    np.testing.assert_allclose(about["acc_mean"], acceleration.mean(axis=0), rtol=1e-10)
    np.testing.assert_allclose(about["acc_std"], acceleration.std(axis=0), rtol=1e-10)


def test_dimensions_do_not_mix() -> None:
    flat = data.Trajectory(positions=np.zeros((3, 1, 2), np.float32), types=np.array([5]))
    solid = data.Trajectory(positions=np.zeros((3, 1, 3), np.float32), types=np.array([5]))
    with pytest.raises(DataError, match="has dimension 3, those before it 2"):
        data.statistics([flat, solid])


def test_nothing_moves() -> None:
    still = data.Trajectory(positions=np.zeros((3, 1, 2), np.float32), types=np.array([3]))
    assert data.statistics([still]).metadata()["vel_std"] == []
