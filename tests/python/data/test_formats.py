"""Formats: there and back with the same bits, types by the right convention, and bad files named."""

import dataclasses
import io
import json
import os
import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import ConfigError, DataError, data
from hybridmpm.data import hdf5, metadata
from hybridmpm.data.formats import inert
from hybridmpm.data.formats.tfrecord import crc32c
from hybridmpm.scene.particle_types import FROM_LAGRANGEBENCH, TO_LAGRANGEBENCH, UNCHANGED, translated

from . import tfrecords
from .conftest import trajectories

FORMATS = data.FORMATS
X = np.zeros((4, 3, 2), np.float32)


def convert(source: Path, origin: str, out: Path, target: str) -> data.Converted:
    return data.convert(source, FORMATS[origin], out, FORMATS[target])


@pytest.mark.parametrize("middle", ["lagrangebench", "gns", "neuralmpm", "hybridmpm"])
def test_there_and_back(made: Path, tmp_path: Path, middle: str) -> None:
    there = convert(made, "hybridmpm", tmp_path / "there", middle)
    assert data.detect(tmp_path / "there") is FORMATS[middle]
    convert(tmp_path / "there", middle, tmp_path / "back", "hybridmpm")
    assert there.trajectories == {"train": 4, "valid": 1, "test": 1}
    for split in there.trajectories:
        pairs = zip(trajectories(made, split), trajectories(tmp_path / "back", split), strict=True)
        for before, after in pairs:
            np.testing.assert_array_equal(after.positions, before.positions)
            np.testing.assert_array_equal(after.types, before.types)
            for key in ("force", "mass", "scene"):
                kept = getattr(after, key)
                if key in FORMATS[middle].keeps:
                    np.testing.assert_array_equal(kept, getattr(before, key))
                else:
                    assert kept is None
                    assert key in there.lost
    before, after = metadata.read(made), metadata.read(tmp_path / "back")
    assert {key: after[key] for key in metadata.REQUIRED} == {key: before[key] for key in metadata.REQUIRED}
    assert after["vel_std"] == before["vel_std"]
    assert after["hybridmpm"]["type_names"] == before["hybridmpm"]["type_names"]


def test_lagrangebench_gets_its_own_types(made: Path, tmp_path: Path) -> None:
    convert(made, "hybridmpm", tmp_path / "lb", "lagrangebench")
    ours, theirs = trajectories(made), tmp_path / "lb" / "train.h5"
    with hdf5.reading(theirs) as file:
        for number, trajectory in enumerate(ours):
            types = file[f"{number:05d}/particle_type"][()]
            # Kinematic is a wall, not the rigid body that 3 means there; water is the fluid.
            np.testing.assert_array_equal(types == 1, trajectory.types == 3)
            np.testing.assert_array_equal(types == 0, trajectory.types == 5)
            assert 3 not in types
    about = json.loads((tmp_path / "lb" / "metadata.json").read_text())
    assert about["sequence_length_train"] == 9
    assert about["hybridmpm"]["type_names"]["1"] == "kinematic"


def test_tables_of_types() -> None:
    assert {TO_LAGRANGEBENCH[number]: number for number in TO_LAGRANGEBENCH} == {
        number: name for number, name in FROM_LAGRANGEBENCH.items() if number != 2
    }
    np.testing.assert_array_equal(
        translated(np.array([0, 2, 3, 6]), FROM_LAGRANGEBENCH, where="x"), [5, 3, 0, 6]
    )
    with pytest.raises(DataError, match="here holds particle type 4; this format has 0, 3, 5, 6, 7"):
        translated(np.array([5, 4]), UNCHANGED, where="here")


def test_lagrangebench_metadata_count_states_and_solver_steps(tmp_path: Path, made: Path) -> None:
    shutil.copy(made / "train.h5", tmp_path)
    about = {
        "bounds": [[0, 1], [0, 1]],
        "dim": 2,
        "dt": 0.001,
        "write_every": 100,
        "sequence_length_train": 9,
    }
    (tmp_path / "metadata.json").write_text(json.dumps({**about, "default_connectivity_radius": 0.03}))
    read = metadata.read(tmp_path)
    assert (read["dt"], read["sequence_length"]) == (pytest.approx(0.1), 8)
    with pytest.raises(DataError, match=r"two conventions: name the format lagrangebench"):
        data.detect(tmp_path)


def test_neuralmpm_with_one_frame_of_boundary_and_types_of_both(tmp_path: Path) -> None:
    (tmp_path / "valid").mkdir()
    about = {"bounds": [[0, 1], [0, 1]], "dim": 2, "dt": 1, "sequence_length": 3}
    (tmp_path / "metadata.json").write_text(json.dumps({**about, "default_connectivity_radius": 0.03}))
    rng = np.random.default_rng(0)
    particles, boundary = rng.random((4, 3, 5)).astype("f4"), rng.random((1, 2, 2)).astype("f4")
    with hdf5.writing(tmp_path / "valid" / "sim_0.h5") as file:
        file["particles"], file["boundary"], file["types"] = particles, boundary, np.array([0, 0, 6, 5, 7])
    (one,) = trajectories(tmp_path, "valid", "neuralmpm")
    assert one.types.tolist() == [6, 5, 7, 3, 3]
    np.testing.assert_array_equal(one.positions[:, :3], particles[..., :2])
    np.testing.assert_array_equal(one.positions[:, 3:], np.broadcast_to(boundary, (4, 2, 2)))


# ---- gns


def save_gns(path: Path, **entries: Any) -> None:
    """Write as geoelements/gns does: object arrays, which numpy pickles."""
    with path.open("wb") as file:
        np.savez_compressed(file, **entries)


def pair(*parts: Any) -> np.ndarray[Any, Any]:
    made = np.empty(len(parts), dtype=object)
    made[:] = parts
    return made


def test_gns_files_of_others(tmp_path: Path) -> None:
    one, two = tfrecords.particles(5), tfrecords.particles(3)
    save_gns(
        tmp_path / "train.npz",
        simulation_0=pair(one.positions, one.types),
        simulation_1=pair(two.positions.astype(np.float64), 6, np.ones((3, 1))),
        simulation_2=pair(two.positions, np.int64(5)),
    )
    found = trajectories(tmp_path, "train", "gns")
    np.testing.assert_array_equal(found[0].positions, one.positions)
    np.testing.assert_array_equal(found[0].types, one.types)
    np.testing.assert_array_equal(found[1].positions, two.positions)
    assert [one.types.tolist() for one in found[1:]] == [[6, 6, 6], [5, 5, 5]]
    save_gns(tmp_path / "test.npz", gns_data=pair((one.positions, one.types), (two.positions, two.types)))
    assert [one.positions.shape for one in trajectories(tmp_path, "test", "gns")] == [(4, 5, 2), (4, 3, 2)]
    assert FORMATS["gns"].count(tmp_path, "test") == 2


def test_gns_reads_what_we_write(made: Path, tmp_path: Path) -> None:
    """In the way of gns's own data_loader.py, which trusts the file."""
    convert(made, "hybridmpm", tmp_path / "gns", "gns")
    with np.load(tmp_path / "gns" / "train.npz", allow_pickle=True) as file:
        items = [item for _, item in file.items()]
    for (positions, types), before in zip(items, trajectories(made), strict=True):
        np.testing.assert_array_equal(positions, before.positions)
        np.testing.assert_array_equal(types, before.types)


class Hostile:
    """Runs a function of its own choice when it is unpickled."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self._call = (function, arguments)

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self._call


@pytest.mark.parametrize("depth", [0, 1])
def test_a_hostile_pickle_runs_nothing(tmp_path: Path, depth: int) -> None:
    marker = tmp_path / "owned"
    entry: Any = Hostile(os.mkdir, str(marker))
    types = np.array([5])
    save_gns(tmp_path / "train.npz", a=pair(entry, types) if depth == 0 else pair([pair(entry)], types))
    with pytest.raises(DataError, match=r"train\.npz: a holds the name \w+\.mkdir; only arrays of numbers"):
        trajectories(tmp_path, "train", "gns")
    assert not marker.exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (Hostile(np.load, "x.npy"), "the name numpy"),
        (Hostile(eval, "1"), r"the name builtins\.eval"),
        ({"a": 1}, "a dict"),
        ("text", "a str"),
        (np.array(["text"]), "an array of type 'U4'"),
        (np.zeros(1, dtype=[("a", "f4")]), "an array of type 'V4'"),
    ],
)
def test_what_the_restricted_reader_refuses(content: Any, message: str) -> None:
    with pytest.raises(inert.InertPickleError, match=message):
        inert.load(io.BytesIO(pickle.dumps(content)))


@pytest.mark.parametrize("protocol", range(6))
def test_the_restricted_reader_gives_what_pickle_gives(protocol: int) -> None:
    arrays = [
        np.arange(6, dtype=kind).reshape(shape, order=order)
        for kind in ("<f4", ">f8", "i8", "u1")
        for shape in ((2, 3), (6, 1, 1))
        for order in ("C", "F")
    ]
    numbers = [3, 2.5, np.float32(1.5), np.int64(7), np.zeros((0, 2), np.float32)]
    read = inert.load(io.BytesIO(pickle.dumps([*arrays, *numbers, (1, [2, np.ones(2)])], protocol=protocol)))
    for before, after in zip([*arrays, *numbers], read, strict=False):
        np.testing.assert_array_equal(after, before)
        assert np.asarray(after).dtype == np.asarray(before).dtype
    assert read[-1][0] == 1
    assert read[-1][1][1].tolist() == [1.0, 1.0]


def test_random_bytes_are_no_pickle() -> None:
    rng = np.random.default_rng(0)
    good = pickle.dumps(pair(np.arange(12.0).reshape(3, 4), np.array([5])))
    refused = 0
    for _ in range(2000):
        damaged = bytearray(good)
        for place in rng.integers(len(good), size=3):
            damaged[place] = rng.integers(256)
        try:
            inert.load(io.BytesIO(bytes(damaged)))
        except inert.InertPickleError:
            refused += 1
    assert refused > 500


# ---- tfrecord


def test_tfrecords_of_deepmind(made: Path, tmp_path: Path) -> None:
    ours = trajectories(made)
    tfrecords.write(tmp_path / "dm", "train", ours, tfrecords.plain(metadata.read(made)))
    assert data.detect(tmp_path / "dm") is FORMATS["deepmind"]
    assert FORMATS["deepmind"].count(tmp_path / "dm", "train") == 4
    for before, after in zip(ours, trajectories(tmp_path / "dm", "train", "deepmind"), strict=True):
        np.testing.assert_array_equal(after.positions, before.positions)
        np.testing.assert_array_equal(after.types, before.types)
    (third,) = FORMATS["deepmind"].read(tmp_path / "dm", "train", [2])
    np.testing.assert_array_equal(third.positions, ours[2].positions)
    convert(tmp_path / "dm", "deepmind", tmp_path / "ours", "hybridmpm")
    assert [one.positions.tobytes() for one in trajectories(tmp_path / "ours")] == [
        one.positions.tobytes() for one in ours
    ]
    with pytest.raises(ConfigError, match="the format deepmind is only read"):
        convert(made, "hybridmpm", tmp_path / "no", "deepmind")


def test_crc32c() -> None:
    # RFC 3720, B.4.
    assert crc32c(bytes(32)) == 0x8A9136AA
    assert crc32c(b"\xff" * 32) == 0x62A8AB43
    assert crc32c(bytes(range(32))) == 0x46DD794E


FIVE, FOUR = tfrecords.particles(5), tfrecords.particles(4)
GOOD = tfrecords.record(tfrecords.example(FIVE))
SHORT = dataclasses.replace(FIVE, types=FIVE.types.astype(np.int32))
RENAMED = tfrecords.example(FIVE).replace(b"position", b"pos1tion")
BAD_RECORDS = {
    r"train\.tfrecord: record 1 is cut off": (GOOD + tfrecords.record(tfrecords.example(FOUR)))[:-20],
    "record 1 is damaged: the checksum of its length does not match": GOOD + b"\x01" + GOOD[1:],
    r"record 0: position must have sequence_length \+ 1 = 4 frames, .* got 6": tfrecords.record(
        tfrecords.example(tfrecords.particles(5, frames=6))
    ),
    "record 0 is damaged or no SequenceExample": tfrecords.record(b"\xff" * 40),
    "record 0: the key position is missing; the record holds pos1tion": tfrecords.record(RENAMED),
    "record 0: particle_type must be int64, .* 5 particles are int32": tfrecords.record(
        tfrecords.example(SHORT, frames=FIVE.positions)
    ),
    "record 0: position must hold 5 particles in every frame, got 3, 5": tfrecords.record(
        tfrecords.example(FIVE, frames=[*FIVE.positions[:3], X[0]])
    ),
}


@pytest.mark.parametrize("message", BAD_RECORDS)
def test_bad_tfrecords(tmp_path: Path, message: str) -> None:
    about = {"bounds": [[0, 1], [0, 1]], "dim": 2, "dt": 1, "sequence_length": 3}
    (tmp_path / "metadata.json").write_text(json.dumps({**about, "default_connectivity_radius": 0.03}))
    (tmp_path / "train.tfrecord").write_bytes(BAD_RECORDS[message])
    with pytest.raises(DataError, match=message):
        trajectories(tmp_path, "train", "deepmind")


# ---- foreign and damaged HDF5


def write_group(path: Path, **arrays: Any) -> None:
    with hdf5.writing(path) as file:
        for key, array in arrays.items():
            file[f"00000/{key}"] = array


NAN = X.copy()
NAN[2, 1, 0] = np.nan
TYPES = np.array([5, 5, 3])


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"position": X}, r"train\.h5: the key 00000/particle_type is missing"),
        ({"particle_type": TYPES}, r"train\.h5: the key 00000/position is missing; the file holds 00000"),
        ({"position": NAN, "particle_type": TYPES}, r"00000/position is nan at frame 2, particle 1, axis 0"),
        (
            {"position": X, "particle_type": TYPES[:2]},
            r"00000/particle_type must name one type for each of the 3",
        ),
        (
            {"position": X[0], "particle_type": TYPES},
            r"00000/position must have shape \(F, N, 2 or 3\), got \(3, 2\)",
        ),
        ({"position": X, "particle_type": TYPES + 7}, r"00000/particle_type holds particle type 10"),
        ({"position": X, "particle_type": TYPES, "force": X}, r"00000/force must have shape \(3, 3, 2\)"),
        ({"position": X, "particle_type": TYPES, "mass": X[0, :2, 0]}, r"00000/mass must have shape \(3,\)"),
        ({"position": "text", "particle_type": TYPES}, r"00000/position must hold numbers"),
    ],
)
def test_bad_groups_are_named(tmp_path: Path, arrays: dict[str, Any], message: str) -> None:
    write_group(tmp_path / "train.h5", **arrays)
    with pytest.raises(DataError, match=message):
        trajectories(tmp_path)


def test_a_damaged_chunk_is_named(tmp_path: Path, made: Path) -> None:
    content = bytearray((made / "train.h5").read_bytes())
    with hdf5.reading(made / "train.h5") as file:
        chunk = file["00001/position"].id.get_chunk_info(0)
    for place in range(chunk.byte_offset + 20, chunk.byte_offset + 60):
        content[place] ^= 0xFF
    (tmp_path / "train.h5").write_bytes(content)
    with pytest.raises(DataError, match=r"train\.h5: 00001.* is damaged"):
        trajectories(tmp_path)


def test_particle_counts_may_differ_between_trajectories(made: Path) -> None:
    assert len({one.positions.shape[1] for one in trajectories(made)}) > 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"metadata\.json is missing; it must hold bounds, dim"),
        ("{", r"metadata\.json cannot be read"),
        ("[]", r"metadata\.json lacks the key bounds"),
        (
            '{"bounds": [[0, 1]], "dim": 2, "dt": 1, "default_connectivity_radius": 1}',
            "lacks the key sequence_length",
        ),
        (
            '{"bounds": [[0, 1]], "dim": 2, "dt": 1, "default_connectivity_radius": 1, "sequence_length": 1}',
            r"bounds must be one \[low, high\] for each of dim = 2 or 3 axes",
        ),
    ],
)
def test_bad_metadata(tmp_path: Path, made: Path, content: str | None, message: str) -> None:
    shutil.copy(made / "train.h5", tmp_path)
    if content is not None:
        (tmp_path / "metadata.json").write_text(content)
    with pytest.raises(DataError, match=message):
        convert(tmp_path, "hybridmpm", tmp_path / "out", "gns")


def test_conversions_that_are_refused(tmp_path: Path, made: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "note").write_text("mine")
    with pytest.raises(ConfigError, match="full is not empty; choose a new folder"):
        convert(made, "hybridmpm", tmp_path / "full", "gns")
    with pytest.raises(DataError, match="holds no split in the format gns"):
        convert(made, "gns", tmp_path / "out", "hybridmpm")
    with pytest.raises(DataError, match="is no folder"):
        data.detect(tmp_path / "absent")
    with pytest.raises(DataError, match="holds no split of any known format"):
        data.detect(tmp_path / "full")
    with pytest.raises(DataError, match="holds the trajectories 0 to 3, not 4"):
        list(FORMATS["hybridmpm"].read(made, "train", [4]))


def test_a_file_that_is_no_archive(tmp_path: Path) -> None:
    (tmp_path / "train.npz").write_bytes(b"PK")
    with pytest.raises(DataError, match=r"train\.npz is no npz file"):
        trajectories(tmp_path, "train", "gns")
    with zipfile.ZipFile(tmp_path / "train.npz", "w") as archive:
        archive.writestr("a.npy", b"text")
    with pytest.raises(DataError, match=r"train\.npz: a is damaged"):
        trajectories(tmp_path, "train", "gns")
