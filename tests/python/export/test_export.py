"""Files and pictures show what was recorded; they are read back by other means than they were written."""

import base64
import os
import re
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hybridmpm import (
    Ball,
    BallObstacle,
    Box,
    BoxObstacle,
    ConfigError,
    ExportError,
    MpmSolver,
    Scene,
    Walls,
    export,
)
from hybridmpm.export import pictures
from hybridmpm.recording import Recording, record
from hybridmpm.recording.recording import MAX_BYTES
from hybridmpm.render import view_of
from hybridmpm.render.palette import by_speed


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
        # Each picture is that of the state, though only what has changed is written.
        view = view_of(recording.scene, recording.types, 80, recording.spacing)
        for index, row in enumerate((0, 2, 4, 6)):
            film.seek(index)
            drawn = view.draw(recording.positions[row], recording.velocities[row], recording.time(row))
            np.testing.assert_allclose(np.asarray(film.convert("RGB")), drawn, atol=40)


def test_film_speed(tmp_path: Path, recording: Recording) -> None:
    export.save(tmp_path / "slow.gif", recording, export.Style(width=80, speed=0.5))
    with Image.open(tmp_path / "slow.gif") as film:
        # Pillow joins pictures that do not differ, so count the time instead.
        total = 0
        for index in range(film.n_frames):  # type: ignore[attr-defined]
            film.seek(index)
            total += film.info["duration"]
        assert total == 7 * 20
    export.save(tmp_path / "few.gif", recording, export.Style(width=80, speed=0.5, fps=25))
    with Image.open(tmp_path / "few.gif") as film:
        assert (film.n_frames, film.info["duration"]) == (4, 40)  # type: ignore[attr-defined]
    with pytest.raises(ExportError, match=r"fps must be in \[1, 50\], got 60"):
        export.Style(fps=60)


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


@pytest.mark.parametrize("name", ["a.txt", "a", "missing/a.npz", "a%d.npz", "a%03d.gif", ".npz", "a.ply"])
def test_targets_that_are_refused(
    tmp_path: Path, name: str, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.ply").mkdir()
    with pytest.raises(ExportError):
        export.check_target(tmp_path / name)
    with pytest.raises(ExportError, match="File name too long"):
        export.save(tmp_path / f"{'n' * 250}.ply", recording)
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(ExportError, match="nothing may be written into the folder"):
        export.check_target(tmp_path / "b.ply")
    with pytest.raises(ExportError, match=r"got 'a\.html'; hybridmpm\.play\(scene, path\) writes pages"):
        export.check_target(tmp_path / "a.html")
    with pytest.raises(
        ExportError, match=r"recording must be a Recording, such as .*, got an object of type"
    ):
        export.save(tmp_path / "a.npz", None)  # type: ignore[arg-type]


@pytest.mark.parametrize("settings", [{"speed": 0.0}, {"speed": float("nan")}, {"strip": 0}, {"strip": 13}])
def test_bad_style(settings: dict[str, float]) -> None:
    with pytest.raises(ExportError, match=rf"{next(iter(settings))} must be in \["):
        export.Style(**settings)  # type: ignore[arg-type]


def test_a_write_that_fails_keeps_the_old_file(
    tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "film.gif"
    target.write_bytes(b"old")

    def interrupted(*_arguments: object, **_settings: object) -> None:
        raise KeyboardInterrupt

    # The head of the film has been written then.
    monkeypatch.setattr(pictures.GifImagePlugin, "getdata", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export.save(target, recording, export.Style(width=80))
    assert target.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["film.gif"]


def test_states_now_at_each_stride_and_at_the_end(splash: Scene) -> None:
    solver, twin = MpmSolver(splash), MpmSolver(splash)
    solver.advance(2)
    steps: list[int] = []
    recording = record(solver, 7, every=3, on_progress=steps.append)
    assert recording.frames.tolist() == [2, 5, 8, 9]
    assert steps == [3, 3, 1]
    for row, frame in enumerate(recording.frames.tolist()):
        twin.advance(frame - twin.frame)
        np.testing.assert_array_equal(recording.positions[row], twin.positions)
        np.testing.assert_array_equal(recording.velocities[row], twin.velocities)


def test_no_frames_is_one_state(splash: Scene) -> None:
    recording = record(MpmSolver(splash), 0)
    assert recording.frames.tolist() == [0]
    assert recording.positions.shape[0] == 1


def test_too_large_or_senseless(solver: MpmSolver) -> None:
    per_state = 2 * 4 * 2 * solver.particle_count
    with pytest.raises(ConfigError, match=r"must fit in 4 GiB.*raise `every` or lower `frames`"):
        record(solver, min(MAX_BYTES // per_state + 1, 1_000_000))
    with pytest.raises(ConfigError, match=r"every must be in \[1, 1000000\], got 0"):
        record(solver, 1, every=0)
    with pytest.raises(ConfigError, match=r"frames must be in \[0, 1000000\], got -1"):
        record(solver, -1)
    assert solver.frame == 0


def disc(material: str, center: tuple[float, ...]) -> Scene:
    return Scene(dim=len(center), bodies=(Ball(material=material, center=center, radius=0.12),))


def picture(scene: Scene, width: int = 200) -> np.ndarray:
    particles = scene.sample()
    return view_of(scene, particles.types, width).draw(particles.x, particles.v).astype(int)


def empty(scene: Scene, width: int = 200) -> np.ndarray:
    """Return the picture without particles."""
    none = np.empty((0, scene.dim), dtype=np.float32)
    return view_of(scene, np.empty(0, dtype=np.uint8), width).draw(none, none).astype(int)


@pytest.mark.parametrize("width", [64, 101, 300])
@pytest.mark.parametrize("center", [(0.5, 0.5), (0.5, 0.5, 0.5)])
def test_sizes_are_even(width: int, center: tuple[float, ...]) -> None:
    image = picture(disc("water", center), width)
    assert image.shape[1] == width + width % 2
    assert image.shape[0] % 2 == 0
    assert image.shape[2] == 3


def test_shape_follows_the_walls() -> None:
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 0.25))
    scene = Scene(dim=2, walls=walls, bodies=(Box(material="water", lower=(0, 0), upper=(0.1, 0.1)),))
    height, width, _ = picture(scene, 400).shape
    assert height / width == pytest.approx(0.31 / 1.06, abs=0.01)


@pytest.mark.parametrize("center", [(0.35, 0.65), (0.7, 0.3)])
def test_flat_pictures_cover_the_disc_and_only_it(center: tuple[float, float]) -> None:
    scene = disc("water", center)
    covered = np.abs(picture(scene) - empty(scene)).sum(axis=-1) > 60
    rows, columns = np.nonzero(covered)
    scale = 200 / 0.848  # walls of 0.8 m and a margin of 3 % on each side
    x, y = 0.1 - 0.024 + (columns + 0.5) / scale, 0.9 + 0.024 - (rows + 0.5) / scale
    assert (x.mean(), y.mean()) == pytest.approx(center, abs=2e-3)
    assert covered.sum() / scale**2 == pytest.approx(np.pi * 0.12**2, rel=0.1)


@pytest.mark.parametrize("dim", [2, 3])
def test_materials_are_told_apart(dim: int) -> None:
    hues = {}
    for material in ("water", "sand", "elastic"):
        scene = disc(material, (0.5,) * dim)
        image, background = picture(scene), empty(scene)
        changed = np.abs(image - background).sum(axis=-1) > 90
        hues[material] = int(np.median(image[changed].argmax(axis=-1)))
    assert hues == {"water": 2, "sand": 0, "elastic": 1}


@pytest.mark.parametrize("kind", [5, 6, 7])
def test_fast_is_brighter_than_slow(kind: int) -> None:
    ramp = by_speed(kind, np.linspace(0.0, 5.0, 20)).sum(axis=-1)
    assert (np.diff(ramp) >= 0).all()
    assert ramp[-1] > 1.3 * ramp[0]


def test_obstacles_hide_what_is_behind_them_in_2d() -> None:
    obstacle = BoxObstacle(lower=(0.4, 0.4), upper=(0.6, 0.6))
    plain = Scene(dim=2, bodies=(Ball(material="water", center=(0.2, 0.2), radius=0.02),))
    scene = plain.model_copy(update={"obstacles": (obstacle,)})
    image, without = empty(scene), empty(plain)
    assert (image[100, 100] != without[100, 100]).any()
    covered = np.abs(image - without).sum(axis=-1) > 60
    assert covered.sum() / (200 / 0.848) ** 2 == pytest.approx(0.04, rel=0.1)
    on_it = np.full((1, 2), 0.5, dtype=np.float32)
    drawn = view_of(scene, np.array([5], dtype=np.uint8), 200).draw(on_it, on_it)
    np.testing.assert_array_equal(drawn, image)


def test_near_hides_far_in_3d() -> None:
    """The eye is in front (large z), above, to the right: of two balls in line the near one is seen."""
    obstacle = BallObstacle(center=(0.5, 0.5, 0.5), radius=0.1)
    scene = disc("sand", (0.3, 0.3, 0.3)).model_copy(update={"obstacles": (obstacle,)})
    background = empty(scene)
    toward = np.array([0.498, 0.342, 0.797])  # of the camera's angles, 32 and 20 degrees
    for sign, seen in ((1, True), (-1, False)):
        x = (np.full(3, 0.5) + sign * 0.25 * toward)[None].astype(np.float32)
        drawn = view_of(scene, np.array([6], dtype=np.uint8), 200).draw(x, 0 * x)
        middle = np.s_[40:110, 60:140]
        changed = np.abs(drawn.astype(int) - background)[middle].sum(axis=-1).max()
        assert (changed > 30) == seen


def test_shadow_lies_under_the_fluid_in_3d() -> None:
    scene = disc("water", (0.5, 0.5, 0.5))
    darker = (picture(scene).sum(axis=-1) - empty(scene).sum(axis=-1)) < -20
    rows, _ = np.nonzero(darker)
    assert darker.sum() > 100
    assert rows.mean() > 100


def test_out_of_sight_is_no_error() -> None:
    for dim in (2, 3):
        scene = disc("water", (0.5,) * dim)
        x = np.full((1, dim), -3.0, dtype=np.float32)
        drawn = view_of(scene, np.array([5], dtype=np.uint8), 100).draw(x, 0 * x)
        assert drawn.shape[1] == 100


@pytest.mark.parametrize("width", [63, 4097, -1])
def test_bad_width(width: int) -> None:
    with pytest.raises(ConfigError, match=rf"width must be in \[64, 4096\] pixels, got {width}"):
        view_of(disc("water", (0.5, 0.5)), np.empty(0, dtype=np.uint8), width)


def test_merged_particles_are_drawn_as_large_as_they_are() -> None:
    block = Box(lower=(0.3, 0.3), upper=(0.6, 0.6), material="water")
    scene = Scene(dim=2, resolution=64, bodies=[block])
    covered = []
    for r_p in (1.0, 1 / 8):
        solver = MpmSolver(scene, r_p=r_p)
        view = view_of(scene, solver.materials, 120, solver.particle_spacing)
        drawn = view.draw(solver.positions, solver.velocities).astype(int)
        covered.append(float((np.abs(drawn - empty(scene, 120)).max(axis=2) > 40).mean()))
    assert covered[0] == pytest.approx(0.3**2 / 0.848**2, rel=0.1)
    assert covered[1] == pytest.approx(covered[0], rel=0.1)


@pytest.mark.needs("pxr", "usd")
def test_usd_has_the_particles_of_each_state(tmp_path: Path, recording: Recording) -> None:
    from pxr import Usd, UsdGeom

    export.save(tmp_path / "film.usdc", recording)
    stage = Usd.Stage.Open(str(tmp_path / "film.usdc"))
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Y", 1.0)
    assert stage.GetTimeCodesPerSecond() == pytest.approx(1 / recording.scene.frame_dt)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 24)
    prims = [UsdGeom.Points(prim) for prim in stage.GetDefaultPrim().GetChildren()]
    assert len(prims) == len(np.unique(recording.types))
    for row, frame in enumerate(recording.frames.tolist()):
        x = np.concatenate([prim.GetPointsAttr().Get(frame) for prim in prims])
        ids = np.concatenate([prim.GetIdsAttr().Get(frame) for prim in prims])
        np.testing.assert_array_equal(x[np.argsort(ids), :2], recording.positions[row])
        assert not x[:, 2].any()
        bounds = UsdGeom.BBoxCache(frame, ["default"]).ComputeWorldBound(stage.GetDefaultPrim())
        lowest = recording.positions[row].min(axis=0) - recording.scene.spacing / 2
        np.testing.assert_allclose(list(bounds.ComputeAlignedRange().GetMin())[:2], lowest, rtol=1e-5)
