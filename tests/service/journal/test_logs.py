"""Logs of sessions over HTTP: what is answered makes the same session again, and nonsense is refused."""

import base64
import copy
import gzip
import hashlib
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from tests.service.conftest import SMALL_SCENE

from hybridmpm import DataError, MpmSolver, ReplayWarning, replay
from hybridmpm.cli import cli

_OVAL = {"points": [[0.6, 0.5], [0.5, 0.6], [0.4, 0.5], [0.5, 0.4]], "kind": "ellipse"}


@pytest.fixture(scope="module")
def logged(service: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Return the path of a session that has been steered, and its log."""
    path = service.create()
    service.http.post(f"{path}/advance", json={"frames": 4})
    answer = service.http.post(f"{path}/sketches", json={"strokes": [_OVAL], "frames": 30})
    assert answer.status_code == 200, answer.text
    service.http.post(f"{path}/advance", json={"frames": 10})
    service.http.delete(f"{path}/sketches")
    service.http.post(f"{path}/advance", json={"frames": 2})
    yield path, service.http.get(f"{path}/log").json()
    service.http.delete(path)


def test_it_tells_what_acted_and_its_digest_can_be_checked(
    service: Any, logged: tuple[str, dict[str, Any]]
) -> None:
    path, log = logged
    assert (log["frame"], log["scenario"], log["solver"]) == (16, None, "mpm")
    assert [(one["kind"], one["frame"]) for one in log["inputs"]] == [("sketch", 4), ("release", 14)]
    answer = service.http.get(f"{path}/particles", headers={"Accept": "application/x-npz"})
    state = np.load(io.BytesIO(answer.content))
    digest = hashlib.sha256(state["ids"].astype("<u8").tobytes())
    for name in ("positions", "velocities"):
        digest.update(state[name].astype("<f4").tobytes())
    assert log["digest"] == digest.hexdigest()


def test_it_makes_the_same_session_again(service: Any, logged: tuple[str, dict[str, Any]]) -> None:
    _, log = logged
    answer = service.http.post("/v1/sessions", json={"log": log})
    assert answer.status_code == 201, answer.text
    made = answer.json()
    assert (made["frame"], made["notice"], made["kept"]) == (16, None, "memory")
    assert service.http.get(made["links"]["log"]).json() == log
    service.http.delete(made["links"]["self"])


def test_the_library_computes_it_again(
    service: Any, logged: tuple[str, dict[str, Any]], tmp_path: Path
) -> None:
    _, log = logged
    assert replay(log).digest() == log["digest"]
    assert replay(log, 7).frame == 7
    # From a file, and from a link; with pushes over a sketch of one body.
    path = service.create(SMALL_SCENE)
    with service.stream(path) as stream:
        service.http.post(f"{path}/advance", json={"frames": 3})
        arrow = {"points": [[0.4, 0.4], [0.6, 0.6]], "kind": "arrow"}
        settings = {"strokes": [arrow], "frames": 20, "hold": 5, "who": {"particle": 3}}
        assert service.http.post(f"{path}/sketches", json=settings).status_code == 200
        stream.send(type="push", point=[0.5, 0.4], velocity=[1.0, 0.5], radius=0.2)
        stream.send(type="step", frames=6)
        stream.reach(9)
        stream.send(type="push_end")
        stream.send(type="step", frames=30)
        stream.reach(39)
    pushed = service.http.get(f"{path}/log").json()
    assert [one["kind"] for one in pushed["inputs"]] == ["sketch", "push", "push"]
    file = tmp_path / "run.json"
    file.write_text(json.dumps(pushed))
    assert replay(file, threads=2).digest() == pushed["digest"]
    end = tmp_path / "end.hmpm"
    done = CliRunner().invoke(cli, ["simulate", "--run", str(file), "--save", str(end)])
    assert done.exit_code == 0, done.output
    assert MpmSolver.load(end).digest() == pushed["digest"]
    picture = tmp_path / "end.png"
    shown = []
    for frames in ("27", "28"):  # the arrow leads 25 frames from frame 3 on
        arguments = ["simulate", "--run", str(file), "--frames", frames, "--out", str(picture)]
        assert CliRunner().invoke(cli, arguments).exit_code == 0
        red, green, _ = np.moveaxis(np.asarray(Image.open(picture).convert("RGB"), dtype=int), -1, 0)
        shown.append(int(np.count_nonzero(red > green + 80)))
    assert shown[0] > 50
    assert shown[1] == 0
    for more, message in [(["--frames", "40"], "at most 39"), (["--seed", "1"], "drop '--seed'")]:
        refused = CliRunner().invoke(cli, ["simulate", "--run", str(file), *more])
        assert refused.exit_code == 2
        assert message in refused.output
    packed = base64.urlsafe_b64encode(gzip.compress(file.read_bytes())).decode().rstrip("=")
    assert replay(f"http://a.example/#replay={packed}").digest() == pushed["digest"]
    with pytest.warns(ReplayWarning, match="version 1 of the solver made it"):
        replay(pushed | {"versions": {"solver": 1}, "digest": "0" * 64})
    for wrong, message in [
        (f"#replay={packed[:-20]}", "the link is damaged"),
        ({"scene": {}}, "format, solver, frame, inputs, digest is missing"),
        (pushed | {"inputs": [{"kind": "push", "frame": 0}]}, "an input of the log is malformed"),
        (tmp_path / "none.json", "cannot be read"),
    ]:
        with pytest.raises(DataError, match=message):
            replay(wrong)
    with pytest.raises(DataError, match=r"frame must be in \[0, 39\]"):
        replay(pushed, 40)
    service.http.delete(path)


def test_a_changed_log_is_played_and_says_that_the_end_is_another(
    service: Any, logged: tuple[str, dict[str, Any]]
) -> None:
    changed = copy.deepcopy(logged[1])
    changed["inputs"][1]["frame"] = 9
    made = service.http.post("/v1/sessions", json={"log": changed}).json()
    assert "not the one that the log ends with: the log was changed" in made["notice"]
    service.http.delete(made["links"]["self"])


def _with(log: dict[str, Any], *keys: Any, value: Any) -> dict[str, Any]:
    changed = copy.deepcopy(log)
    inner: Any = changed
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    return changed


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("frame",), 10**6, "body.log.frame: must be at most 20000, got 1000000"),
        (("frame",), 3, "an input acts in frame 14, after the end of the log at 3"),
        (("inputs", 1, "frame"), 2, "frames of the inputs must ascend"),
        (("inputs", 0, "drawn_frame"), 5, "was planned in frame 5, after it began to steer"),
        (("inputs", 0, "settings", "most"), 10**6, "at most 400 may be"),
        (("inputs", 0, "sketch", "axes"), [0.1, -1], "two lengths"),
        (
            ("inputs", 1),
            {
                "kind": "push",
                "frame": 14,
                "push": {"point": [0.1, 0.1, 0.1], "velocity": [1, 1], "radius": 1, "cap": 1},
            },
            "must have 2 numbers, got 3",
        ),
        (("solver",), "neural", "body.model: is required with a scene of your own"),
        (("scene", "dim"), 4, "dim"),
        (("format",), 2, "body.log.format"),
    ],
)
def test_nonsense_is_refused_with_its_field(
    service: Any, logged: tuple[str, dict[str, Any]], keys: tuple[Any, ...], value: Any, message: str
) -> None:
    answer = service.http.post("/v1/sessions", json={"log": _with(logged[1], *keys, value=value)})
    assert answer.status_code == 422, answer.text
    assert message in answer.text


@pytest.mark.parametrize(
    ("beside", "message"),
    [
        ({"scenario": "water_2d"}, "give one of"),
        ({"scene": SMALL_SCENE}, "give one of"),
        ({"solver": "hybrid"}, 'solver\\" cannot be given beside'),
    ],
)
def test_a_log_has_its_own_scene_and_simulator(
    service: Any, logged: tuple[str, dict[str, Any]], beside: dict[str, Any], message: str
) -> None:
    answer = service.http.post("/v1/sessions", json={"log": logged[1]} | beside)
    assert answer.status_code == 422
    assert message in answer.text


def test_a_log_of_minutes_of_pushing_can_be_sent(service: Any, path: str) -> None:
    service.http.post(f"{path}/advance", json={"frames": 1})
    log = service.http.get(f"{path}/log").json()
    hand = {"point": [0.5, 0.4], "velocity": [0.0, 0.0], "radius": 0.05, "cap": 15.0}
    log["inputs"] = [{"kind": "push", "frame": 1, "push": hand}] * 10_000
    again = service.http.post("/v1/sessions", json={"log": log})
    assert again.status_code == 201, again.text
    assert again.json()["notice"] is None
    assert service.http.delete(again.json()["links"]["self"]).status_code == 204
