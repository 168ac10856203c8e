"""Each row of the table in docs/reference/http-api.md, on a real server."""

import io
import re
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image
from tests.service.conftest import arrays_of, problem

from hybridmpm import MpmSolver, Scene, scenarios

NPZ = {"Accept": "application/x-npz"}


def test_scenarios_are_listed_with_what_a_chooser_needs(service: Any) -> None:
    listed = service.http.get("/v1/scenarios").json()["scenarios"]
    assert [scenario["name"] for scenario in listed] == list(scenarios.NAMES)
    assert listed[0]["dim"] == 2
    assert listed[0]["frames"] == 1000
    assert listed[0]["max_particles"] == 4000
    assert all(scenario["text"] for scenario in listed)


@pytest.mark.parametrize("name", scenarios.NAMES)
def test_the_scene_of_a_seed_is_that_of_the_library_and_can_be_sent_back(service: Any, name: str) -> None:
    answer = service.http.get(f"/v1/scenarios/{name}", params={"seed": 5})
    assert Scene.parse(answer.json()) == scenarios.get(name, 5)
    created = service.http.post("/v1/sessions", json={"scene": answer.json()})
    assert created.status_code == 201
    service.http.delete(created.json()["links"]["self"])


def test_a_session_lives_from_post_to_delete(service: Any) -> None:
    created = service.http.post("/v1/sessions", json={"scenario": "water_2d", "seed": 3})
    assert created.status_code == 201
    body = created.json()
    path = f"/v1/sessions/{body['id']}"
    assert created.headers["location"] == path == body["links"]["self"]
    solver = MpmSolver(scenarios.get("water_2d", 3))
    expected = {
        "scenario": "water_2d",
        "seed": 3,
        "dim": 2,
        "particles": solver.particle_count,
        "frame": 0,
        "time": 0.0,
        "frame_dt": 0.0025,
        "playing": False,
        "speed": 0.25,
        "control": None,
        "last_frame": None,
    }
    assert expected.items() <= body.items()
    assert body["centroid"] == pytest.approx(solver.diagnostics().centroid)
    assert service.http.get(path).json() == body
    assert body in service.http.get("/v1/sessions").json()["sessions"]
    deleted = service.http.delete(path)
    assert (deleted.status_code, deleted.content) == (204, b"")
    assert service.http.get(path).status_code == 404


def test_advancing_gives_the_librarys_bits(service: Any, path: str) -> None:
    answer = service.http.post(f"{path}/advance", json={"frames": 12})
    assert answer.status_code == 200
    body = answer.json()
    assert (body["frame"], body["time"]) == (12, pytest.approx(0.03))
    assert body["last_frame"]["substeps"] >= 1
    assert body["last_frame"]["bound"] in {"sound", "speed", "frame"}
    solver = MpmSolver(service.session(path).scene)
    solver.advance(12)
    arrays = arrays_of(service.http.get(f"{path}/particles", headers=NPZ).content)
    assert arrays["positions"].dtype == np.float32
    assert np.array_equal(arrays["positions"], solver.positions)
    assert np.array_equal(arrays["velocities"], solver.velocities)
    assert np.array_equal(arrays["types"], solver.materials)
    assert arrays["frame"] == 12


def test_particles_as_json_are_those_of_the_npz(service: Any, path: str) -> None:
    body = service.http.get(f"{path}/particles").json()
    arrays = arrays_of(service.http.get(f"{path}/particles", headers=NPZ).content)
    np.testing.assert_array_equal(np.array(body["positions"], dtype=np.float32), arrays["positions"])
    assert body["types"] == [5] * len(body["positions"])
    assert (body["frame"], body["time"]) == (0, 0.0)


def test_particles_as_point_clouds(service: Any, path: str) -> None:
    arrays = arrays_of(service.http.get(f"{path}/particles", headers=NPZ).content)
    count = len(arrays["positions"])
    ply = service.http.get(f"{path}/particles", headers={"Accept": "application/x-ply"})
    assert ply.headers["content-type"] == "application/x-ply"
    header, _, body = ply.content.partition(b"end_header\n")
    assert f"element vertex {count}\n".encode() in header
    vertices = np.frombuffer(body, dtype=[("numbers", "<f4", 6), ("type", "u1")])
    np.testing.assert_array_equal(vertices["numbers"][:, :2], arrays["positions"])
    np.testing.assert_array_equal(vertices["numbers"][:, 3:5], arrays["velocities"])
    vtp = service.http.get(f"{path}/particles", headers={"Accept": "application/x-vtp"})
    assert f'NumberOfPoints="{count}"' in vtp.text


@pytest.mark.needs("pysplashsurf", "surfaces")
@pytest.mark.needs("trimesh", "shapes")
def test_the_surface_of_a_session_is_a_closed_mesh(service: Any, path: str) -> None:
    import trimesh

    assert "3D" in problem(service.http.get(f"{path}/surface"), 422)["detail"]
    ball = {"shape": "ball", "material": "water", "center": [0.5, 0.5, 0.5], "radius": 0.2}
    body = {"scene": {"dim": 3, "resolution": 24, "bodies": [ball]}}
    path = service.http.post("/v1/sessions", json=body).json()["links"]["self"]
    for media_type, kind in (("model/gltf-binary", "glb"), ("application/x-ply", "ply")):
        answer = service.http.get(f"{path}/surface", headers={"Accept": media_type})
        assert answer.headers["content-type"] == media_type
        mesh = trimesh.load_mesh(io.BytesIO(answer.content), file_type=kind)
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.2**3, rel=0.06)


def test_the_pressure_grows_with_depth(service: Any) -> None:
    pool = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.9, 0.3]}
    body = {"scene": {"dim": 2, "resolution": 128, "bodies": [pool]}, "coarse": "1/16"}
    path = service.http.post("/v1/sessions", json=body).json()["links"]["self"]
    assert service.http.get(f"{path}/pressure").json()["frame"] == 0
    for _ in range(2):
        service.http.post(f"{path}/advance", json={"frames": 400}).raise_for_status()
    field = service.http.get(f"{path}/pressure").json()
    points, pressure = np.array(field["points"]), np.array(field["pressure"])
    assert len(points) == len(pressure) > 20
    # At rest it is that of rho g h.
    for low, high in ((0.12, 0.18), (0.18, 0.24)):
        layer = (points[:, 1] > low) & (points[:, 1] < high)
        depth = 0.3 - points[layer, 1].mean()
        assert pressure[layer].mean() == pytest.approx(9810 * depth, rel=0.1)
    service.http.delete(path)


def test_the_page_is_served_with_a_strict_policy(service: Any) -> None:
    answer = service.http.get("/")
    assert answer.headers["content-type"].startswith("text/html")
    policy = answer.headers["content-security-policy"]
    assert "default-src 'self'" in policy
    # The page runs the compiled solver, and nothing else that is not a file of the service.
    assert policy.count("unsafe") == policy.count("script-src 'self' 'wasm-unsafe-eval';") == 1
    assert answer.headers["x-content-type-options"] == "nosniff"
    script = service.http.get("/main.js")
    assert "javascript" in script.headers["content-type"]


def test_files_are_compressed_and_kept_while_they_are_the_present_ones(service: Any) -> None:
    def get(path: str, **headers: str) -> Any:
        return service.http.get(path, headers={"Accept-Encoding": "br, gzip", **headers})

    front = get("/")
    assert (front.headers["content-encoding"], front.headers["cache-control"]) == ("gzip", "no-cache")
    named = re.findall(r'(?:href|src)="(page-([0-9a-f]{16})/([^"]+))"', front.text)
    assert {"main.js", "style.css", "icon.svg"} == {name for _, _, name in named}
    assert not re.findall(r'<(?:script|link)[^>]*(?:src|href)="(?!page-)', front.text)
    ((digest, other),) = {(digest, digest[::-1]) for _, digest, _ in named}
    for name in ("frames.js", "style.css", "modules/plane.wasm"):
        packed, plain = get(f"/page-{digest}/{name}"), get(f"/{name}", **{"Accept-Encoding": "gzip;q=0, br"})
        assert packed.headers["cache-control"] == "public, max-age=31536000, immutable"
        assert int(packed.headers["content-length"]) < 0.5 * int(plain.headers["content-length"])
        assert packed.content == plain.content
        assert "content-encoding" not in plain.headers
        assert packed.headers["vary"] == plain.headers["vary"] == "Accept-Encoding"
        assert packed.headers["etag"] != plain.headers["etag"]
        tag = packed.headers["etag"]
        for known, status in ((tag, 304), (f"W/{tag}, x", 304), ('"x"', 200)):
            assert get(f"/page-{digest}/{name}", **{"If-None-Match": known}).status_code == status
        # A page of before an update goes on, and keeps nothing.
        late = get(f"/page-{other}/{name}")
        assert (late.content, late.headers["cache-control"]) == (plain.content, "no-cache")
    assert "content-encoding" not in get("/share/preview.png").headers
    problem(service.http.post("/main.js"), 405)
    problem(get(f"/page-{digest}/missing.js"), 404)
    # The modules of the start are one file; each of them is there by itself, too.
    assert get("/main.js").text.startswith("// Puts the parts together")
    assert "export { $" in get(f"/page-{digest}/main.js").text
    # Addresses of the service that clients make up are not kept for ever.
    for number in range(20):
        made_up = get("/", Host=f"localhost:{number + 1}")
        assert f"http://localhost:{number + 1}/share/preview.png" in made_up.text
    assert "content-encoding" not in made_up.headers


def test_a_link_to_the_page_has_a_picture_beside_it(service: Any) -> None:
    answer = service.http.get("/")
    found = re.search(r'property="og:image" content="([^"]+)"', answer.text)
    assert found[1].startswith("http://")
    picture = service.http.get(urlsplit(found[1]).path)
    assert picture.headers["content-type"] == "image/png"
    with Image.open(io.BytesIO(picture.content)) as image:
        assert image.size == (1200, 630)
    again = service.http.get("/", headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_files_outside_the_page_are_not_served(service: Any) -> None:
    for address in ("/../app.py", "/%2e%2e/app.py", "/..%2fapp.py"):
        problem(service.http.get(address), 404)


JET = {"shape": "rectangle", "material": "sand", "lower": [0.1, 0.6], "upper": [0.1, 0.7], "velocity": [2, 0]}
OPEN_SCENE: dict[str, Any] = {
    "dim": 2,
    "resolution": 32,
    "bodies": [{"shape": "box", "lower": [0.4, 0.4], "upper": [0.6, 0.6], "material": "water"}],
    "emitters": [JET],
    "sinks": [{"shape": "box", "lower": [0.5, 0.3], "upper": [0.55, 0.7]}],
}


def test_frames_of_version_2_have_ids_and_types(service: Any) -> None:
    path, solver = service.create(OPEN_SCENE), MpmSolver(Scene.parse(OPEN_SCENE))
    with service.stream(path, version="2") as stream:
        hello = stream.receive()
        assert (hello["version"], hello["types"]) == (2, None)
        assert hello["spacing"] == pytest.approx(solver.particle_spacing)
        assert [emitter["shape"] for emitter in hello["scene"]["emitters"]] == ["rectangle"]
        assert len(hello["scene"]["sinks"]) == 1
        for _ in range(3):
            stream.send(type="step", frames=4)
            solver.advance(4)
            frame = stream.reach(solver.frame)
            assert frame.population.ids.tolist() == solver.ids.tolist()
            assert frame.population.types.tolist() == solver.materials.tolist()
            np.testing.assert_allclose(frame.positions, solver.positions, atol=1e-5)
    particles = service.http.get(f"{path}/particles").json()
    assert particles["ids"] == solver.ids.tolist()
    assert service.http.get(path).json()["particles"] == solver.particle_count
    service.http.delete(path)


def test_a_trajectory_has_null_for_particles_that_have_left(service: Any) -> None:
    path = service.create(OPEN_SCENE)
    body = {"strokes": [{"points": [[0.4, 0.5], [0.6, 0.5]], "kind": "arrow"}], "frames": 10}
    answer = service.http.post(f"{path}/trajectories", json=body, params={"stride": 10}).json()
    before, after = answer["positions"]
    assert [None, None] not in before
    gone = np.array([row == [None, None] for row in after])
    arrays = arrays_of(
        service.http.post(f"{path}/trajectories", json=body, params={"stride": 10}, headers=NPZ).content
    )
    assert gone.any()
    assert np.array_equal(np.isnan(arrays["positions"][1]).all(axis=1), gone)
    service.http.delete(path)


@pytest.mark.parametrize(
    ("scene", "version", "reason"),
    [
        (OPEN_SCENE, None, "version=2"),
        (OPEN_SCENE, "1", "version=2"),
        (None, "4", "1, 2 or 3"),
        (None, "x", "1, 2 or 3"),
    ],
)
def test_an_unavailable_version_closes_the_stream(
    service: Any, scene: dict[str, Any] | None, version: str | None, reason: str
) -> None:
    path = service.create(scene)
    with service.stream(path, version=version) as stream:
        assert stream.end() == 4406
        assert reason in stream.connection.protocol.close_reason
    service.http.delete(path)


def test_a_fork_goes_on_by_itself_with_the_same_bits(service: Any, path: str) -> None:
    service.http.post(f"{path}/advance", json={"frames": 5})
    made = service.http.post(f"{path}/fork")
    fork = made.json()
    assert made.status_code == 201
    assert made.headers["location"] == fork["links"]["self"] != path
    origin = service.http.get(path).json()
    for name in fork.keys() - {"id", "links", "last_frame"}:
        assert fork[name] == origin[name], name
    first, second = (
        arrays_of(service.http.post(f"{each}/advance", json={"frames": 9}, headers=NPZ).content)
        for each in (path, fork["links"]["self"])
    )
    assert first.keys() == second.keys() > {"ids", "positions"}
    assert all(np.array_equal(first[name], second[name]) for name in first)
    service.http.delete(path)
    assert service.http.post(f"{fork['links']['self']}/advance", json={}).json()["frame"] == 15
    service.http.delete(fork["links"]["self"])


def test_a_coarse_session_shows_all_particles_and_so_does_its_fork(service: Any) -> None:
    made = service.http.post("/v1/sessions", json={"scenario": "water_2d", "seed": 3, "coarse": "1/16"})
    scene = scenarios.get("water_2d", 3)
    solver = MpmSolver(scene, coarse="1/16")
    assert (made.json()["coarse"], made.json()["r_p"]) == ("1/16", 1 / 16)
    path = made.json()["links"]["self"]
    fork = service.http.post(f"{path}/fork").json()
    assert fork["coarse"] == "1/16"
    solver.advance(6)
    for each in (path, fork["links"]["self"]):
        answer = service.http.post(f"{each}/advance", json={"frames": 6}, headers=NPZ)
        assert np.array_equal(arrays_of(answer.content)["positions"], solver.positions)
        service.http.delete(each)
    assert solver.particle_count == MpmSolver(scene).particle_count
