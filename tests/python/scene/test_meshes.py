"""Bodies within surfaces of triangles: inside, mass, files, and what encloses nothing."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import Ball, ConfigError, DataError, Mesh, MpmSolver, Scene, SceneError, check, export
from hybridmpm.recording import record

pytestmark = pytest.mark.needs("trimesh", "shapes")

CENTER = (0.5, 0.4, 0.5)


def _body(surface: Any, **fields: Any) -> Mesh:
    vertices, triangles = np.asarray(surface.vertices) + CENTER, np.asarray(surface.faces)
    return Mesh(vertices=vertices.tolist(), triangles=triangles.tolist(), **{"material": "water"} | fields)


def test_inside_and_mass_agree_with_closed_forms() -> None:
    import trimesh

    ring = trimesh.creation.torus(0.2, 0.08, major_sections=60, minor_sections=40)
    block = trimesh.creation.box((0.3, 0.2, 0.1))
    inner = trimesh.creation.box((0.1, 0.1, 0.05))
    inner.invert()
    x = np.random.default_rng(0).random((20_000, 3))
    # Points of a lattice lie right over edges, diagonals and corners of the block.
    axes = (np.linspace(0.2, 0.7, 21), np.linspace(0.2, 0.7, 21), np.linspace(0.201, 0.701, 21))
    x = np.concatenate([x, np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)])
    off = x - CENTER
    away = np.hypot(np.hypot(off[:, 0], off[:, 1]) - 0.2, off[:, 2])
    in_block, in_inner = ((np.abs(off) < one.extents / 2).all(axis=1) for one in (block, inner))
    on_edge = (np.abs(np.abs(off) - np.array(block.extents) / 2) < 1e-9).any(axis=1)
    assert (_body(ring).contains(x) != (away < 0.08)).mean() < 0.002
    hollow = _body(trimesh.util.concatenate([block, inner]), material="elastic")
    np.testing.assert_array_equal(hollow.contains(x)[~on_edge], (in_block & ~in_inner)[~on_edge])
    assert hollow.measure == pytest.approx(0.006 - 0.0005)
    assert _body(block).smallest_extent == pytest.approx(0.1, rel=0.05)
    for body in (_body(ring), hollow):
        scene = Scene(dim=3, resolution=32, bodies=(body,))
        assert Scene.from_json(scene.to_json()) == scene
        particles = scene.sample()
        assert particles.mass.sum() == pytest.approx(1000 * body.measure, rel=1e-5)
        assert body.contains(particles.x.astype(np.float64)).all()
        assert len(particles.x) == pytest.approx(body.measure * 64**3, rel=0.1)
        assert check(scene).stable
    assert "fill" in scene._repr_html_()
    MpmSolver(scene).advance(2)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb"])
def test_files_of_other_programs(suffix: str, tmp_path: Path) -> None:
    import trimesh

    path = tmp_path / f"ball.{suffix}"
    ball = trimesh.creation.icosphere(3, 7.0)
    ball.export(path)
    body = Mesh.read(path, CENTER, 0.3, material="sand", velocity=(0, -1, 0), seed=2)
    assert (len(body.vertices), len(body.triangles)) == (len(ball.vertices), len(ball.faces))
    assert body.measure == pytest.approx(ball.volume * (0.3 / 14) ** 3, rel=1e-5)
    np.testing.assert_allclose(body.bounds, [np.subtract(CENTER, 0.15), np.add(CENTER, 0.15)], atol=1e-6)
    path.write_bytes(b"solid nothing")
    with pytest.raises(DataError, match=r"ball\.\w+ (cannot be read|has no triangles)"):
        Mesh.read(path, CENTER, 0.3, material="sand")


@pytest.mark.needs("pysplashsurf", "surfaces")
def test_a_surface_of_a_simulation_becomes_a_body(tmp_path: Path) -> None:
    ball = Ball(material="water", center=CENTER, radius=0.1)
    scene = Scene(dim=3, resolution=32, bodies=(ball,))
    export.save(tmp_path / "ball.glb", record(MpmSolver(scene), 0))
    body = Mesh.read(tmp_path / "ball.glb", CENTER, 0.2, material="water")
    assert body.measure == pytest.approx(ball.measure, rel=0.08)  # its bumps make it higher


def test_surfaces_that_enclose_nothing_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    box = trimesh.creation.box((0.2, 0.2, 0.2))
    vertices, faces = (np.asarray(box.vertices) + CENTER).tolist(), np.asarray(box.faces).tolist()
    cases: list[tuple[list[Any], str]] = [
        (faces[1:], r"have 3 open edges: vertices 0 and 1, \(0\.4, 0\.3, 0\.4\) to \(0\.4, 0\.3, 0\.6\) m"),
        ([faces[0][::-1], *faces[1:]], "must turn the same way round"),
        ([[0, 1, 8], *faces[1:]], r"triangles\[0\]: must be indices in \[0, 7\]"),
        ([*faces, [0, 1, 10**30]], r"triangles\[12\]: must be indices in \[0, 7\]"),
        (faces[:3], "must have 4 or more items"),
    ]
    for triangles, text in cases:
        with pytest.raises(SceneError, match=text):
            Mesh(vertices=vertices, triangles=triangles, material="water")
    body = {"shape": "mesh", "material": "water", "vertices": vertices, "triangles": faces}
    with pytest.raises(SceneError, match=r"bodies\[0\]\.shape: mesh is for dim 3 only"):
        Scene.parse({"dim": 2, "bodies": [body]})
    with pytest.raises(SceneError, match=r"vertices\[0\]: must have 3 numbers"):
        Scene.parse({"dim": 2, "bodies": [body | {"vertices": [one[:2] for one in vertices]}]})
    with pytest.raises(ConfigError, match=r"end in \.stl, \.obj, \.ply, \.glb; got 'a\.step'"):
        Mesh.read(tmp_path / "a.step", CENTER, 0.1, material="water")
    with pytest.raises(DataError, match="cannot be read"):
        Mesh.read(tmp_path / "none.stl", CENTER, 0.1, material="water")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ConfigError, match=r"pip install 'hybridmpm\[shapes\]'"):
        Mesh.read(tmp_path / "none.stl", CENTER, 0.1, material="water")


def test_scene_files_name_files_of_shapes(tmp_path: Path) -> None:
    import trimesh
    from PIL import Image, ImageDraw

    trimesh.creation.icosphere(2).export(tmp_path / "ball.stl")
    picture = Image.new("L", (80, 80), "white")
    ImageDraw.Draw(picture).rectangle((20, 30, 59, 49), fill="black")
    picture.save(tmp_path / "bar.png")
    (tmp_path / "disc.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"><circle r="5"/></svg>')
    (tmp_path / "space.yaml").write_text(
        "dim: 3\nresolution: 20\nbodies:\n"
        "- {file: ball.stl, center: [0.5, 0.6, 0.5], height: 0.2, material: water}\n"
        "obstacles:\n- {file: ball.stl, center: [0.5, 0.3, 0.5], height: 0.2, contact: sticky}\n"
    )
    scene = Scene.load(tmp_path / "space.yaml")
    assert [part.shape for part in (*scene.bodies, *scene.obstacles)] == ["mesh", "mesh"]
    assert scene.bodies[0].measure == pytest.approx(4 / 3 * np.pi * 0.1**3, rel=0.04)
    flat = (
        '{"dim": 2, "bodies": [{"file": "disc.svg", "center": [0.5, 0.6], "height": 0.2, "material": "sand"}]'
    )
    bar = '"obstacles": [{"file": "bar.png", "center": [0.5, 0.3], "height": 0.1}]}'
    (tmp_path / "flat.json").write_text(f"{flat}, {bar}")
    scene = Scene.load(tmp_path / "flat.json")
    assert scene.bodies[0].measure == pytest.approx(np.pi * 0.01, rel=0.01)
    low, high = scene.obstacles[0].bounds
    assert (high - low).tolist() == pytest.approx([0.2, 0.1], rel=0.02)
    (tmp_path / "bad.json").write_text(flat.replace("disc", "none") + ', "obstacles": [{"file": "bar.png"}]}')
    with pytest.raises(SceneError) as caught:
        Scene.load(tmp_path / "bad.json")
    assert [field for field, _ in caught.value.problems] == ["bodies[0].file", "obstacles[0].center"]
