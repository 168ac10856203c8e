"""Snapshot files: going on from one gives the same bits, and nothing but a whole one is taken."""

import hashlib
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hybridmpm import SOLVER_VERSION, ExportError, MpmSolver, Scene, SnapshotError, scenarios


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a scene with all three materials in mid-splash, and an obstacle that moves."""
    scene = Scene.parse(
        {
            "dim": 2,
            "resolution": 32,
            "bodies": [
                {"shape": "box", "material": kind, "lower": [x, 0.1], "upper": [x + 0.1, 0.2]}
                for kind, x in (("water", 0.15), ("sand", 0.45), ("elastic", 0.7))
            ],
            "obstacles": [
                {
                    "shape": "ball",
                    "center": [0.35, 0.1],
                    "radius": 0.08,
                    "motion": {"velocity": [0.5, 0], "period": 0.3},
                }
            ],
        }
    )
    solver = MpmSolver(scene, substeps=40)
    solver.advance(15)
    path = tmp_path_factory.mktemp("saved") / "state.hmpm"
    solver.save(path)
    return path


def test_a_file_holds_scene_settings_and_the_way_back_to_the_start(saved: Path) -> None:
    solver = MpmSolver.load(saved)
    twin = MpmSolver(solver.scene, substeps=40)
    twin.advance(15)
    assert solver.frame == 15
    np.testing.assert_array_equal(solver.positions, twin.positions)
    solver.advance(1)
    assert (solver.last_frame.substeps, solver.last_frame.bound) == (40, "fixed")
    solver.reset()
    twin.reset()
    assert solver.snapshot() == twin.snapshot()


def test_the_cfl_number_is_kept(tmp_path: Path, drop: Scene) -> None:
    solver = MpmSolver(drop, cfl=0.2)
    solver.save(tmp_path / "a")
    again = MpmSolver.load(tmp_path / "a")
    for one in (solver, again):
        one.advance(1)
    assert again.snapshot() == solver.snapshot()
    assert again.last_frame.substeps == solver.last_frame.substeps
    # Saved once more, it is the same file.
    solver.save(tmp_path / "b")
    again.save(tmp_path / "c")
    assert (tmp_path / "b").read_bytes() == (tmp_path / "c").read_bytes()


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_any_flipped_bit_is_refused(saved: Path, tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray(saved.read_bytes())
    place = data.draw(st.integers(0, len(content) - 1) | st.integers(0, 40))
    content[place] ^= 1 << data.draw(st.integers(0, 7))
    damaged = tmp_path / "damaged"
    damaged.write_bytes(content)
    with pytest.raises(SnapshotError, match="damaged"):
        MpmSolver.load(damaged)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_any_other_length_is_refused(saved: Path, tmp_path: Path, data: st.DataObject) -> None:
    content = saved.read_bytes()
    length = data.draw(st.integers(0, len(content) - 1) | st.integers(0, 40))
    other = data.draw(st.sampled_from([content[:length], content + content[: length + 1]]))
    (tmp_path / "other").write_bytes(other)
    with pytest.raises(SnapshotError, match="other"):
        MpmSolver.load(tmp_path / "other")


def rewritten(content: bytes, version: int = 2, **changes: object) -> bytes:
    """Return a file with another version or header, and a checksum that is right."""
    _, _, length = struct.unpack_from("<8sII", content)
    header = json.loads(content[16 : 16 + length]) | changes
    text = json.dumps({key: value for key, value in header.items() if value is not ...}).encode()
    body = struct.pack("<8sII", b"HMPMFILE", version, len(text)) + text + content[16 + length : -32]
    return body + hashlib.sha256(body).digest()


def test_each_refusal_names_the_file_and_what_is_wrong(saved: Path, tmp_path: Path) -> None:
    content = saved.read_bytes()
    for change, message in (
        (b"", "is no snapshot file of hybridmpm, or it is cut off"),
        (b"PK\x03\x04" + content, "is no snapshot file of hybridmpm"),
        (MpmSolver.load(saved).snapshot(), "is no snapshot file of hybridmpm"),
        (content[:-1], "is damaged or cut off"),
        (rewritten(content, version=3), "has format version 3, but this hybridmpm reads version 2"),
        (rewritten(content, version=1), "has format version 1, but this hybridmpm reads version 2"),
        (rewritten(content, scene=...), "has a header that this version does not understand: 'scene'"),
        (rewritten(content, scene={"dim": 4}), "does not understand: dim: Input should be 2 or 3"),
        (rewritten(content, settings={"substeps": "many", "sleep": None}), 'substeps must be "cfl"'),
        (rewritten(content, settings={}), "cannot be restored: 'sleep'"),
        (rewritten(content, simulator="hybrid"), "MpmSolver is of kind 'mpm': use hybridmpm.load"),
        (rewritten(content, scene=scenarios.water_2d(0).model_dump(mode="json", exclude_none=True)), "other"),
    ):
        foreign = tmp_path / "foreign.hmpm"
        foreign.write_bytes(change)
        with pytest.raises(SnapshotError) as caught:
            MpmSolver.load(foreign)
        assert str(foreign) in str(caught.value)
        assert message in str(caught.value)


def of_solver(state: bytes, version: int) -> bytes:
    """Return a state of MPM as a solver of that version would have written it; the first named none."""
    assert state[:8] == b"HMPMSNAP"
    named = struct.pack("<II", 4, version) if version > 1 else struct.pack("<I", 3)
    body = state[:8] + named + state[16:-8]
    hash_value = 0xCBF29CE484222325
    for byte in body:
        hash_value = (hash_value ^ byte) * 0x100000001B3 % 2**64
    return body + struct.pack("<Q", hash_value)


@pytest.mark.parametrize("version", [1, SOLVER_VERSION + 1])
def test_a_state_of_another_solver_is_refused_with_both_versions(
    saved: Path, tmp_path: Path, version: int
) -> None:
    solver = MpmSolver.load(saved)
    before = solver.snapshot()
    assert of_solver(before, SOLVER_VERSION) == before
    message = f"made by version {version} of the solver .* this build's version {SOLVER_VERSION}: go on with"
    with pytest.raises(SnapshotError, match=message):
        solver.restore(of_solver(before, version))
    assert solver.snapshot() == before
    content = saved.read_bytes()
    body = content[: -32 - len(before)] + of_solver(before, version)
    (tmp_path / "older").write_bytes(body + hashlib.sha256(body).digest())
    with pytest.raises(SnapshotError, match=f"older cannot be restored: .*{message}"):
        MpmSolver.load(tmp_path / "older")


def test_a_file_that_cannot_be_written_or_read(tmp_path: Path, drop: Scene) -> None:
    with pytest.raises(ExportError, match="cannot write"):
        MpmSolver(drop).save(tmp_path / "nowhere" / "state")
    with pytest.raises(FileNotFoundError):
        MpmSolver.load(tmp_path / "absent")


def test_a_failed_write_leaves_the_older_file(
    tmp_path: Path, drop: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver, path = MpmSolver(drop), tmp_path / "state"
    solver.save(path)
    before = path.read_bytes()

    def full_disk(part: Path, data: bytes) -> int:
        with part.open("wb") as file:
            file.write(data[:100])
        raise OSError(28, "No space left on device")

    solver.advance(1)
    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(ExportError, match="No space left"):
        solver.save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["state"]
