"""Bodies within surfaces of triangles: inside, mass, files, and what encloses nothing."""

import base64
import json
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    Ball,
    ConfigError,
    DataError,
    Mesh,
    MeshObstacle,
    MpmSolver,
    Polygon,
    Scene,
    SceneError,
    check,
    export,
)
from hybridmpm.recording import record
from hybridmpm.scene import shape_in

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


def _stl(corners: Any, count: int | None = None, behind: bytes = b"") -> bytes:
    """Return a binary .stl of triangles (T, 3, 3) without normals."""
    rows = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("note", "<u2")])
    rows["corners"] = corners
    number = np.uint32(len(corners) if count is None else count)
    return bytes(80) + number.tobytes() + rows.tobytes() + behind


def test_files_in_disorder_are_put_in_order(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box((0.4, 0.2, 0.3))
    corners = np.asarray(box.vertices)[np.asarray(box.faces)]
    some = np.where(np.arange(12)[:, None, None] < 5, corners[:, ::-1], corners)
    noise = np.random.default_rng(0).normal(0, 2e-7, corners.shape)
    files = {
        "count.stl": _stl(corners, 99),
        "none.stl": _stl(corners, 0),
        "behind.stl": _stl(corners, behind=b"made by hand"),
        "turned.stl": _stl(some),
        "inside out.stl": _stl(corners[:, ::-1]),
        "twice.stl": _stl(np.concatenate([corners, corners])),
        "both sides.stl": _stl(np.concatenate([corners, corners[:, ::-1]])),
        "one twice.stl": _stl(np.concatenate([corners, corners[3:4]])),
        "flat.stl": _stl(np.concatenate([corners, corners[:1, [0, 0, 1]]])),
        "noise.stl": _stl(corners + noise),
        "far.stl": _stl(1000 * corners + 1e6),
        "tabs.obj": box.export(file_type="obj").replace(" ", "\t").encode(),
        "notes.obj": b"  " + box.export(file_type="obj").replace("\n", " # note\r\n").encode(),
    }
    # A box within a box is a hole, whichever way round it turns; so are parts that lie apart.
    nested = _stl(np.concatenate([corners, corners / 2]))
    apart = _stl(np.concatenate([corners, corners[:, ::-1] + [0.5, 0, 0]]))
    found = [*((name, data, 1.0) for name, data in files.items())]
    for name, data, share in [*found, ("nested.stl", nested, 0.875), ("apart.stl", apart, 2.0)]:
        (tmp_path / name).write_bytes(data)
        body = Mesh.read(tmp_path / name, (1.0, 0.4, 0.5), 0.2, material="water")
        assert body.measure == pytest.approx(0.024 * share, rel=1e-3), name
        x = np.random.default_rng(1).uniform(*body.bounds, (4000, 3))
        room = np.prod(np.subtract(*body.bounds[::-1]))
        assert body.contains(x).mean() * room == pytest.approx(body.measure, rel=0.02), name
    lost = corners.copy()
    lost[7, 1, 2] = np.nan
    for data, text in [
        (_stl(lost), r"triangle 7 of 12 has a vertex at \(.*nan\); coordinates must be finite"),
        (_stl(corners)[:400], "have 6 open edges"),
        (b"", "has no triangles: it may be damaged"),
        (_stl(np.concatenate([corners[:1], corners[:1] + 1e5])), "must have 4 or more items"),
        (_stl(np.random.default_rng(1).random((9000, 3, 3))), "have 27000 open edges"),
    ]:
        (tmp_path / "bad.stl").write_bytes(data)
        with pytest.raises((DataError, SceneError), match=text):
            Mesh.read(tmp_path / "bad.stl", (1.0, 0.4, 0.5), 0.2, material="water")
    path = tmp_path / "far.stl"
    for center, height, text in [
        ((0.5, 0.5), 0.2, r"center must be 3 finite numbers \[m\], got \(0\.5, 0\.5\)"),
        ((0.5, np.nan, 0.5), 0.2, "center must be 3 finite numbers"),
        (
            (0.5, 0.5, 0.5),
            2.0,
            r"reaches from \(-1\.5, -0\.5, -1\) to .* move its center, or make its height",
        ),
    ]:
        with pytest.raises(ConfigError, match=text):
            Mesh.read(path, center, height, material="water")


def test_surfaces_that_cross_or_lie_in_each_other_have_the_mass_of_what_is_inside() -> None:
    import trimesh

    box = trimesh.creation.box((0.4, 0.2, 0.3))
    other = box.copy().apply_translation((0.1, 0.05, 0.03))
    crossed = _body(trimesh.util.concatenate([box, other]))
    # By the even-odd rule the common part is empty.
    assert crossed.measure == pytest.approx(2 * 0.024 - 2 * 0.3 * 0.15 * 0.27, rel=0.005)
    inner = trimesh.creation.box((0.2, 0.1, 0.1))
    with pytest.raises(SceneError, match=r"those of the part at \(.*\) turn against the others; reverse"):
        _body(trimesh.util.concatenate([box, inner]))


def test_many_rows_are_one_text_in_files_and_come_back_with_their_bits(tmp_path: Path) -> None:
    import trimesh

    ball = trimesh.creation.icosphere(3, 0.1)
    vertices, triangles = np.asarray(ball.vertices) + np.array(CENTER), np.asarray(ball.faces)
    body = Mesh(vertices=vertices, triangles=triangles, material="sand")
    assert body == Mesh(
        vertices=vertices.tolist(), triangles=[*map(tuple, triangles.tolist())], material="sand"
    )
    scene = Scene(dim=3, bodies=(body,), obstacles=(MeshObstacle(vertices=vertices, triangles=triangles),))
    record = json.loads(scene.to_json())["bodies"][0]
    text = record["triangles"]
    assert base64.b64decode(text) == triangles.astype("<u4").tobytes()
    scene.save(tmp_path / "scene.yaml")
    for again in (Scene.load(tmp_path / "scene.yaml"), Scene.from_json(scene.to_json())):
        assert again == scene
        assert hash(again) == hash(scene)
        np.testing.assert_array_equal(again.bodies[0].vertices, vertices)
    assert pickle.loads(pickle.dumps(scene)) == scene == scene.model_copy(deep=True)  # noqa: S301 - our own
    assert Mesh.model_validate(body.model_dump()) == body
    far = base64.b64encode((vertices + 5000).tobytes()).decode()
    wrong = base64.b64encode(np.append(triangles[1:], [[0, 1, 99_999]], axis=0).astype("<u4")).decode()
    cases = [
        ({"triangles": "no base 64"}, "triangles: must be lists, or text in base 64, which it is not"),
        ({"triangles": text[:-4]}, r"triangles: as text must have rows of three uint32, 12 bytes, and has"),
        ({"triangles": "A" * 10_000_000}, "triangles: must have 200000 or fewer rows"),
        ({"triangles": wrong}, r"triangles\[1279\]: must be indices in \[0, 641\], got \[0, 1, 99999\]"),
        ({"triangles": text[: 16 * 100]}, "open edges"),
        (
            {"vertices": base64.b64encode(vertices * np.nan).decode()},
            r"^.*vertices\[9\]\[2\]: must be in[^;]*$",
        ),
        ({"vertices": ""}, "vertices: must have 4 or more items, got 0"),
        ({"vertices": far}, r"vertices\[0\]\[0\]: must be in \[0, 4096\] m, got 5000"),
    ]
    for change, message in cases:
        with pytest.raises(SceneError, match=message):
            Mesh(**record | change)
    with pytest.raises(
        SceneError, match=r"bodies\[0\]\.vertices\[\d+\]\[1\]: must be in \[0, 0.45\] m, got 0.4[5-9]"
    ):
        Scene.parse({"dim": 3, "world": {"size": [1, 0.45, 1]}, "bodies": [record]})


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


@pytest.mark.needs("svgpathtools", "shapes")
def test_drawings_count_as_they_are_seen(tmp_path: Path) -> None:
    bar = '<rect width="40" height="20"/>'
    frame = '<rect width="400" height="400" {}/>' + bar
    round_bar = (800 - (4 - np.pi) * 25) / 1e4
    parts: dict[str, float] = {
        f'<g transform="translate(9 3) scale(2,1) rotate(90)">{bar}</g>': 0.2 * 0.2 * 40 / 40,
        '<rect width="40mm" height="2cm"/>': 0.08,
        '<rect style="width:40px;height:20"/>': 0.08,
        f'<rect width="100%" height="100%" fill="white"/>{bar}': 0.08,
        '<rect width="20%" height="50%"/>': 0.08,
        '<rect width="40" height="20" rx="5"/>': round_bar,
        '<rect width="40" height="20" rx="90"/>': np.pi * 0.02,
        frame.format('display="none"'): 0.08,
        frame.format('style="display: none !important"'): 0.08,
        frame.format('visibility="hidden"'): 0.08,
        "<style>/* a */ .a, .b { display: none } .c{fill:#fff}</style>" + frame.format('class="x b"'): 0.08,
        f'<style>.c{{fill:#fff}}</style>{bar}<rect class="c" x="30" width="20" height="20"/>': 0.06,
        frame.format('fill="none"'): 0.08,
        f'<g fill="none" stroke="red">{bar}</g>': 0.08,
        f'<rect width="0" height="400"/>{bar}': 0.08,
        "<style>#a, rect.b{display:none}</style>" + frame.format('id="a"'): 0.08,
        frame.format('fill="transparent"') + frame.format('fill-opacity="0"'): 0.08,
        frame.format('fill="rgba(0, 0, 0, 0)"') + frame.format('fill="rgb(0 0 0 / 0%)"'): 0.08,
        f'<g fill-opacity="0"><g fill-opacity="1" fill="rgb(0,0,0)">{bar}</g></g>': 0.08,
        '<path d="M0 0Q20 40 40 0z"/>': 2 / 3 * 0.08,
        '<defs><circle id="c" r="10"/></defs><use href="#c"/><use href="#c" x="20"/>': 2 * np.pi * 0.01,
        f'<symbol id="s" viewBox="0 0 40 20">{bar}</symbol><use href="#s" width="8" height="9"/>': 0.08,
        f'<a href="x"><switch>{bar}<circle r="90"/></switch></a>': 0.08,
        f'<svg x="5" viewBox="0 0 40 20" width="80" height="20" preserveAspectRatio="none">{bar}</svg>': 0.16,
        f"<text>no path</text>{bar}": 0.08,
        bar + bar: 0.08,
        f'{bar}<rect x="20" width="40" height="20"/>': 0.12,
        '<rect x="10" width="10" height="30"/><rect y="10" width="30" height="10"/>': 500 * (0.2 / 30) ** 2,
        '<circle cx="10" cy="10" r="10"/><rect x="10" width="30" height="20"/>': (np.pi * 50 + 600) / 1e4,
        f'{bar}<circle cx="20" cy="10" r="5" fill="white"/>': 0.08 - np.pi * 0.0025,
        f'<rect width="400" height="400" fill="#FFF"/>{bar}': 0.08,
        f'<g fill="white">{bar}</g>': 0.08,
        f'{bar}<rect x="20" width="40" height="20"/><circle cx="20" cy="10" r="5" fill="white"/>'
        '<circle cx="20" cy="10" r="2"/>': 0.12 - np.pi * 21e-4,
        '<path d="M0 0h40v20h-40zM10 5v10h10v-10z"/>': 0.07,
        '<path d="M0 0h40v20h-40zM10 5h10v10h-10z"/>': 0.08,
        '<g fill-rule="evenodd"><path d="M0 0h40v20h-40zM10 5h10v10h-10z"/></g>': 0.07,
        '<polygon points="50,0 21,90 98,35 2,35 79,90"/>': 0.013774,
    }
    path = tmp_path / "drawing.svg"
    for part, area in parts.items():
        path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 200 40">{part}</svg>')
        body = Polygon(material="water", **_fields(path))
        assert body.measure == pytest.approx(area, rel=0.005), part
    for text, coding in [
        (f"<svg>{bar}</svg>", "utf-8"),
        (f'<?xml version="1.0"?><svg>{bar}</svg>', "utf-16"),
    ]:
        path.write_bytes(text.encode(coding))
        assert Polygon(material="water", **_fields(path)).measure == pytest.approx(0.08)
    loop = '<g id="a"><use href="#a"/></g>'
    circles = "".join(f'<circle cx="{3 * (i % 20)}" cy="{3 * (i // 20)}" r="1"/>' for i in range(40))
    for part, fault in [
        ("<text>wave</text>", "encloses nothing; there must be a path, .* make paths of texts"),
        (
            '<rect width="40%" height="20"/>',
            "width must be a number, with or without one of px, .* got '40%'",
        ),
        ('<use href="#none"/>', "it uses '#none', which is not in the file"),
        ('<rect width="4" height="2" style="transform: rotate(9deg)"/>', "transform stands in a style"),
        (loop, "more than 100000 parts, or 50 within each other"),
        (
            '<path fill-rule="evenodd" d="M0 0h4v2h-4zM0 0h4v2h-4z"/>',
            "enclose no area, as where each is there twice",
        ),
        ('<path d="M0 0h1v1z"/>' * 501, "has 501 parts, at most 500 are allowed"),
        (2 * circles.replace('r="1"', 'r="99"'), "overlap in too many ways; unite them"),
        (circles, "too many details: .* in 40 lines.* leave details out"),
    ]:
        path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{part}</svg>')
        with pytest.raises(DataError, match=fault):
            shape_in(path, (0.5, 0.5), 0.2)
    path.write_bytes('<!DOCTYPE svg [<!ENTITY a "b">]><svg/>'.encode("utf-16"))
    with pytest.raises(DataError, match="entities of their own are not read; save it as plain SVG"):
        shape_in(path, (0.5, 0.5), 0.2)
    with pytest.raises(DataError, match="null byte"):
        shape_in("\0.svg", (0.5, 0.5), 0.2)


@pytest.mark.needs("contourpy", "shapes")
def test_pictures_of_all_kinds_show_the_same_shape(tmp_path: Path) -> None:
    from PIL import Image, ImageDraw

    def bar(mode: str, ground: Any, ink: Any) -> Any:
        picture = Image.new(mode, (80, 80), ground)
        ImageDraw.Draw(picture).rectangle((20, 30, 59, 49), fill=ink)
        return picture

    grey = np.full((80, 80), 40_000, dtype=np.uint16)
    grey[30:50, 20:60] = 1000
    clear = (0, 0, 0, 0)
    pictures = [
        bar("L", 255, 0),
        bar("1", 1, 0),
        bar("LA", (255, 255), (0, 255)),
        bar("RGBA", clear, (10, 20, 30, 255)),
        bar("RGBA", clear, (255, 255, 255, 255)),  # a white logo
        bar("RGBA", clear, (0, 0, 0, 255)).quantize(),
        Image.fromarray(grey),
    ]
    for number, picture in enumerate(pictures):
        picture.save(tmp_path / "bar.png")
        body = Polygon(material="water", **_fields(tmp_path / "bar.png"))
        assert body.measure == pytest.approx(0.08, rel=0.005), number
    for picture in (Image.new("L", (9, 9), 0), Image.new("RGBA", (9, 9), clear)):
        picture.save(tmp_path / "plain.png")
        with pytest.raises(
            DataError, match="equally dark; a shape needs dark parts on a light or transparent"
        ):
            shape_in(tmp_path / "plain.png", (0.5, 0.5), 0.2)
    turned = Image.Exif()
    turned[0x112] = 6
    pictures[0].save(tmp_path / "turned.png", exif=turned.tobytes())
    low, high = Polygon(material="water", **_fields(tmp_path / "turned.png")).bounds
    assert (high - low)[0] == pytest.approx(0.1, rel=0.01)
    noise = np.random.default_rng(1).integers(0, 256, (900, 900), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    with pytest.raises(DataError, match=r"too many details: .* leave details out"):
        shape_in(tmp_path / "noise.png", (0.5, 0.5), 0.2)
    Image.new("1", (2001, 2000)).save(tmp_path / "large.png")
    with pytest.raises(DataError, match=r"large\.png has 4002000 pixels, at most 4000000 are allowed; make"):
        shape_in(tmp_path / "large.png", (0.5, 0.5), 0.2)


def _fields(path: Path) -> dict[str, Any]:
    return {"vertices": shape_in(path, (0.5, 0.5), 0.2)["vertices"]}


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
    trimesh.creation.box().subdivide().subdivide().subdivide().subdivide().export(tmp_path / "box.stl")
    crate = "rigid:\n- {file: box.stl, center: [0.5, 0.8, 0.5], height: 0.1, density: 400}\n"
    space = (tmp_path / "space.yaml").read_text() + crate
    (tmp_path / "space.yaml").write_text(space)
    scene = Scene.load(tmp_path / "space.yaml")
    assert [part.shape for part in (*scene.bodies, *scene.obstacles)] == ["mesh", "mesh"]
    assert scene.rigid[0].mass == pytest.approx(0.4)
    trimesh.creation.icosphere(4).export(tmp_path / "box.stl")
    with pytest.raises(SceneError, match=r"rigid\[0\].file: its hull has 2562 corners, at most 1000"):
        Scene.load(tmp_path / "space.yaml")
    assert scene.bodies[0].measure == pytest.approx(4 / 3 * np.pi * 0.1**3, rel=0.04)
    flat = (
        '{"dim": 2, "bodies": [{"file": "disc.svg", "center": [0.5, 0.6], "height": 0.2, "material": "sand"}]'
    )
    bar = '"obstacles": [{"file": "bar.png", "center": [0.5, 0.3], "height": 0.1}]'
    bar += ', "rigid": [{"file": "bar.png", "center": [0.5, 0.8], "height": 0.1, "density": 300}]}'
    (tmp_path / "flat.json").write_text(f"{flat}, {bar}")
    scene = Scene.load(tmp_path / "flat.json")
    assert scene.bodies[0].measure == pytest.approx(np.pi * 0.01, rel=0.01)
    low, high = scene.obstacles[0].bounds
    assert (high - low).tolist() == pytest.approx([0.2, 0.1], rel=0.02)
    assert scene.rigid[0].mass == pytest.approx(6.0, rel=0.02)
    good = {"file": "bar.png", "center": [0.5, 0.5], "height": 0.1}
    for changed, expected in [
        (
            {"file": "no.svg"},
            f"file: there is no file '{tmp_path}/no.svg'; paths begin at",
        ),
        ({"file": "\0.svg"}, "file: there is no file"),
        ({"file": "ball.stl"}, "file: .stl is for dim 3 only; dim 2 allows .svg, .png"),
        ({"file": "ball.txt"}, "file: files of shapes end in"),
        ({"height": 0}, "height: must be in [1e-06, 4096], got 0"),
        ({"height": True}, "height: must be in [1e-06, 4096], got True"),
        ({"center": 0.5}, "center: must be 2 finite numbers [m], got 0.5"),
        ({"shape": "box"}, "shape: stands beside file, whose shape is a hull; leave it out"),
        ({"points": [[0, 0]]}, "points: stands beside file"),
    ]:
        data = {"dim": 2, "bodies": [], "rigid": [good | changed], "obstacles": [{"file": "bar.png"}]}
        (tmp_path / "bad.json").write_text(json.dumps(data))
        with pytest.raises(SceneError) as caught:
            Scene.load(tmp_path / "bad.json")
        found = [f"{field}: {text}" for field, text in caught.value.problems]
        assert found[0] == "obstacles[0].center: is required beside file, in metres"
        assert found[1].startswith("obstacles[0].height: ")
        assert found[2].startswith(f"rigid[0].{expected}")
