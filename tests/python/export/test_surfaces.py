"""Surfaces are closed, keep the volume, and open in another program's reader."""

import sys
from pathlib import Path

import numpy as np
import pytest

from hybridmpm import Ball, Box, ExportError, MpmSolver, RigidBox, RigidCylinder, RoundEmitter, Scene, export
from hybridmpm.recording import Recording, record

pytestmark = [pytest.mark.needs("pysplashsurf", "surfaces"), pytest.mark.needs("trimesh", "surfaces")]

BALL = Ball(material="water", center=(0.5, 0.5, 0.5), radius=0.15)
BOX = Box(material="sand", lower=(0.3, 0.2, 0.4), upper=(0.6, 0.4, 0.6))
FALLING = Box(material="water", lower=(0.3, 0.1, 0.3), upper=(0.5, 0.3, 0.5), velocity=(2.0, -2.0, 1.0))


def _scene(*bodies: Ball | Box) -> Scene:
    return Scene(dim=3, resolution=32, bodies=bodies)


def _read(path: Path) -> dict[str, "trimesh.Trimesh"]:  # type: ignore[name-defined]  # noqa: F821
    """Return the meshes of a file by name, as trimesh reads them; a PLY has one."""
    import trimesh

    found = trimesh.load_scene(path, process=False, split_object=True, group_material=False)
    return {found.graph[name][1]: found.geometry[found.graph[name][1]] for name in found.graph.nodes_geometry}


@pytest.mark.parametrize(
    ("scene", "frames", "bound"),
    [(_scene(BALL), 0, 0.03), (_scene(BOX), 0, 0.03), (_scene(FALLING), 60, 0.05)],
    ids=["ball", "box", "splash"],
)
def test_a_surface_is_closed_and_keeps_the_volume(
    scene: Scene, frames: int, bound: float, tmp_path: Path
) -> None:
    recording = record(MpmSolver(scene), frames, every=max(frames, 1))
    (surface,) = export.Surfaces(recording).at(-1)
    assert surface.volume == pytest.approx(scene.sample().volume.sum(dtype=np.float64), rel=bound)
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1, rtol=1e-5)
    for suffix in ("ply", "obj", "glb"):
        path, style = tmp_path / f"one.{suffix}", export.Style(surface=True)
        assert export.save(path, recording, style) == [path]
        written = path.read_bytes()
        ((name, mesh),) = _read(path).items()
        assert suffix == "ply" or name == surface.name
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume == pytest.approx(surface.volume, rel=1e-5)
        np.testing.assert_allclose(mesh.vertices, surface.vertices, rtol=1e-6)
        np.testing.assert_array_equal(mesh.faces, surface.triangles)
        np.testing.assert_allclose(mesh.vertex_normals, surface.normals, atol=1e-4)
        # Normals point out of the fluid, as the triangles do.
        facing = np.einsum("ij,ikj->ik", mesh.face_normals, mesh.vertex_normals[mesh.faces]).mean(axis=1)
        assert (facing > 0).mean() > 0.999
        export.save(path, recording, style)
        assert path.read_bytes() == written


def test_elastic_bodies_have_surfaces_of_their_own(tmp_path: Path) -> None:
    left = Box(material="elastic", lower=(0.3, 0.2, 0.4), upper=(0.4, 0.3, 0.5))
    right = Box(material="elastic", lower=(0.4, 0.2, 0.4), upper=(0.5, 0.3, 0.5))
    drop, other = (Ball(material="water", center=(x, 0.7, 0.5), radius=0.06) for x in (0.3, 0.7))
    recording = record(MpmSolver(_scene(drop, left, right, other)), 2)
    export.save(tmp_path / "s%02d.glb", recording)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["s00.glb", "s01.glb", "s02.glb"]
    meshes = _read(tmp_path / "s02.glb")
    assert set(meshes) == {"water", "elastic_1", "elastic_2"}
    assert meshes["water"].body_count == 2
    assert meshes["elastic_1"].centroid[0] == pytest.approx(0.35, abs=0.005)
    assert meshes["elastic_2"].volume == pytest.approx(0.001, rel=0.08)  # its edges are round
    assert meshes["water"].visual.material.name == "water"
    export.save(tmp_path / "all.ply", recording, export.Style(surface=True))
    (whole,) = _read(tmp_path / "all.ply").values()
    assert whole.is_watertight
    assert whole.volume == pytest.approx(sum(mesh.volume for mesh in meshes.values()), rel=1e-5)


def test_rigid_bodies_are_closed(tmp_path: Path) -> None:
    bodies = (
        RigidBox(lower=(0.3, 0.3, 0.3), upper=(0.45, 0.4, 0.5), rotation=(0.3, 0.5, 0.2)),
        RigidCylinder(start=(0.7, 0.3, 0.6), end=(0.8, 0.4, 0.7), radius=0.05),
    )
    recording = record(MpmSolver(Scene(dim=3, resolution=32, bodies=(BALL,), rigid=bodies)), 3)
    volume = sum(one.volume for one in export.Surfaces(recording).at(-1))
    for suffix in ("ply", "obj", "glb"):
        path = tmp_path / f"one.{suffix}"
        export.save(path, recording, export.Style(surface=True))
        meshes = _read(path).values()
        assert all(mesh.is_watertight for mesh in meshes)
        assert sum(mesh.volume for mesh in meshes) == pytest.approx(volume, rel=1e-5)


def test_states_without_particles_are_valid_files(tmp_path: Path) -> None:
    spout = RoundEmitter(material="water", center=(0.5, 0.6, 0.5), radius=0.1, velocity=(0.0, -1.0, 0.0))
    recording = record(MpmSolver(Scene(dim=3, resolution=32, bodies=(), emitters=(spout,))), 0)
    assert recording.positions.shape[1] == 0
    for suffix in ("ply", "obj", "glb"):
        path = tmp_path / f"none.{suffix}"
        export.save(path, recording, export.Style(surface=True))
        assert _read(path) == {} or suffix == "ply"
    assert b"element face 0\n" in (tmp_path / "none.ply").read_bytes()


def test_points_stay_points_unless_surfaces_are_asked_for(tmp_path: Path, cube: Scene) -> None:
    recording = record(MpmSolver(cube), 0)
    export.save(tmp_path / "points.ply", recording)
    assert b"element vertex 512\nproperty float x" in (tmp_path / "points.ply").read_bytes()


def test_what_surfaces_need(
    tmp_path: Path, splash: Scene, cube: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    flat, deep = record(MpmSolver(splash), 0), record(MpmSolver(cube), 0)
    with pytest.raises(ExportError, match="need a scene in 3D"):
        export.save(tmp_path / "a.obj", flat)
    with pytest.raises(ExportError, match="need a scene in 3D"):
        export.Surfaces(flat)
    with pytest.raises(ExportError, match=r"must be a Recording.* of type MpmSolver"):
        export.Surfaces(MpmSolver(cube))  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "pysplashsurf", None)
    assert _refused(tmp_path / "a.glb", deep) == _refused(tmp_path / "a.ply", deep)
    export.save(tmp_path / "a.ply", deep)


def _refused(path: Path, recording: Recording) -> str:
    with pytest.raises(ExportError, match=r"pip install 'hybridmpm\[surfaces\]'") as refusal:
        export.save(path, recording, export.Style(surface=True))
    return str(refusal.value)
