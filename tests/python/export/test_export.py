"""Files are read back by other means than they were written."""

import base64
import re
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hybridmpm import ExportError, MpmSolver, Scene, export
from hybridmpm.export import pictures
from hybridmpm.recording import Recording, record


@pytest.fixture
def recording(splash: Scene) -> Recording:
    return record(MpmSolver(splash), 24, every=4)


@pytest.fixture
def deep(cube: Scene) -> Recording:
    return record(MpmSolver(cube), 2)


def test_npz(tmp_path: Path, recording: Recording) -> None:
    assert export.save(tmp_path / "run.npz", recording) == [tmp_path / "run.npz"]
    with np.load(tmp_path / "run.npz") as data:
        np.testing.assert_array_equal(data["positions"], recording.positions)
        np.testing.assert_array_equal(data["velocities"], recording.velocities)
        assert data["positions"].dtype == np.float32
        assert data["types"].tolist() == recording.types.tolist()
        assert data["frames"].tolist() == [0, 4, 8, 12, 16, 20, 24]
        assert float(data["frame_dt"]) == 0.0025
        assert Scene.from_json(str(data["scene"])) == recording.scene


@pytest.mark.parametrize("name", ["recording", "deep"])
def test_ply(tmp_path: Path, name: str, request: pytest.FixtureRequest) -> None:
    recording: Recording = request.getfixturevalue(name)
    export.save(tmp_path / "last.ply", recording)
    header, body = (tmp_path / "last.ply").read_bytes().split(b"end_header\n", 1)
    lines = header.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert f"element vertex {recording.positions.shape[1]}" in lines
    kinds = {"float": "<f4", "uchar": "u1"}
    fields = [(line.split()[2], kinds[line.split()[1]]) for line in lines if line.startswith("property")]
    vertices = np.frombuffer(body, dtype=fields)
    dim = recording.scene.dim
    np.testing.assert_array_equal(
        np.stack([vertices[n] for n in "xyz"[:dim]], axis=1), recording.positions[-1]
    )
    np.testing.assert_array_equal(vertices["vy"], recording.velocities[-1, :, 1])
    assert vertices["type"].tolist() == recording.types.tolist()
    assert dim == 3 or (vertices["z"] == 0).all()


def test_vtp(tmp_path: Path, deep: Recording) -> None:
    export.save(tmp_path / "last.vtp", deep)
    root = ET.parse(tmp_path / "last.vtp").getroot()  # noqa: S314 - a file of our own
    assert root.attrib["header_type"] == "UInt64"
    arrays = {array.attrib["Name"]: _vtk_array(array) for array in root.iter("DataArray")}
    count = deep.positions.shape[1]
    assert {piece.attrib["NumberOfPoints"] for piece in root.iter("Piece")} == {str(count)}
    np.testing.assert_array_equal(arrays["Points"].reshape(-1, 3), deep.positions[-1])
    np.testing.assert_array_equal(arrays["velocity"].reshape(-1, 3), deep.velocities[-1])
    assert arrays["connectivity"].tolist() == list(range(count))
    assert arrays["offsets"].tolist() == list(range(1, count + 1))
    assert arrays["type"].tolist() == deep.types.tolist()
    assert arrays["TimeValue"].tolist() == [2 * 0.0025]


def _vtk_array(element: ET.Element) -> np.ndarray:
    kinds = {"Float32": "<f4", "Float64": "<f8", "Int64": "<i8", "UInt8": "u1"}
    data = base64.b64decode(element.text or "")
    size = int.from_bytes(data[:8], "little")
    assert size == len(data) - 8
    return np.frombuffer(data[8:], kinds[element.attrib["type"]])


def test_numbered_series(tmp_path: Path, recording: Recording) -> None:
    told: list[tuple[int, int]] = []
    files = export.save(
        tmp_path / "s%03d.ply", recording, on_progress=lambda done, total: told.append((done, total))
    )
    assert [file.name for file in files] == [f"s{frame:03d}.ply" for frame in (0, 4, 8, 12, 16, 20, 24)]
    assert sorted(file.name for file in tmp_path.iterdir()) == [file.name for file in files]
    assert told[-1] == (7, 7)


def test_png_and_strip(tmp_path: Path, recording: Recording) -> None:
    export.save(tmp_path / "one.png", recording, export.Style(width=120))
    export.save(tmp_path / "four.png", recording, export.Style(width=120, strip=4))
    one, four = (np.asarray(Image.open(tmp_path / name)) for name in ("one.png", "four.png"))
    assert one.shape == (120, 120, 3)
    assert four.shape == (120, 4 * 120 + 3 * 6, 3)
    np.testing.assert_array_equal(four[:, -120:], one)


def test_gif(tmp_path: Path, recording: Recording) -> None:
    export.save(tmp_path / "film.gif", recording, export.Style(width=80))
    with Image.open(tmp_path / "film.gif") as film:
        # 24 frames of 2.5 ms at 20 ms a picture, the first at time 0.
        assert film.n_frames == 4  # type: ignore[attr-defined]
        assert film.info["duration"] == 20
        assert film.info["loop"] == 0
        assert film.size == (80, 80)


def test_film_speed(tmp_path: Path, recording: Recording) -> None:
    export.save(tmp_path / "slow.gif", recording, export.Style(width=80, speed=0.5))
    with Image.open(tmp_path / "slow.gif") as film:
        # Pillow joins pictures that do not differ, so count the time instead.
        total = 0
        for index in range(film.n_frames):  # type: ignore[attr-defined]
            film.seek(index)
            total += film.info["duration"]
        assert total == 7 * 20


def test_mp4(tmp_path: Path, recording: Recording) -> None:
    export.save(tmp_path / "film.mp4", recording, export.Style(width=100))
    encoder = pictures.require_encoder().get_ffmpeg_exe()
    report = subprocess.run(
        [encoder, "-i", tmp_path / "film.mp4", "-f", "null", "-"], capture_output=True, text=True, check=True
    ).stderr
    assert re.search(r"Video: h264.* 100x100.* 50 fps", report)
    assert "frame=    4" in report


def test_missing_encoder(tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(ExportError, match=r"pip install 'hybridmpm\[video\]'"):
        export.save(tmp_path / "film.mp4", recording)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.txt", "a", "missing/a.npz", "a%d.npz", "a%03d.gif", ".npz"])
def test_targets_that_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ExportError):
        export.check_target(tmp_path / name)


@pytest.mark.parametrize("settings", [{"speed": 0.0}, {"speed": float("nan")}, {"strip": 0}, {"strip": 13}])
def test_bad_style(settings: dict[str, float]) -> None:
    with pytest.raises(ExportError, match=rf"{next(iter(settings))} must be in \["):
        export.Style(**settings)  # type: ignore[arg-type]


def test_a_write_that_fails_keeps_the_old_file(
    tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "film.gif"
    target.write_bytes(b"old")

    def interrupted(_self: object, path: Path, **_settings: object) -> None:
        Path(path).write_bytes(b"half a film")
        raise KeyboardInterrupt

    monkeypatch.setattr(Image.Image, "save", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export.save(target, recording, export.Style(width=80))
    assert target.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["film.gif"]


def test_a_folder_in_the_way(tmp_path: Path, recording: Recording) -> None:
    (tmp_path / "run.npz").mkdir()
    with pytest.raises(ExportError, match="cannot write"):
        export.save(tmp_path / "run.npz", recording)
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]
