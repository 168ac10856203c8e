"""The client in JavaScript as a package for npm: Node runs it, and TypeScript knows its types."""

import json
import os
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]
PROGRAM = """
import { Client, Problem } from "hybridmpm";

const client = new Client(process.argv[2]);
const session = await client.create({ scenario: "water_2d", seed: 7 });
const { method } = await session.steer([[0.3, 0.3], [0.5, 0.5]], { frames: 20, method: "analytic" });
await session.advance(3);
const { frame, positions, types } = await session.particles();
const stream = await session.stream();
stream.step(2);
let shown;
for await (shown of stream.frames()) if (shown.number === 5) break;
const after = await session.particles();
const off = Math.max(...shown.positions.map((x, i) => Math.abs(x - after.positions[i])));
stream.close();
const job = await session.record({ frames: 4 });
const size = (await job.result()).size;
await session.delete();
const problem = await session.refresh().catch((error) => error);
const { status, kind, message } = problem;
const numbers = positions.length / types.length;
const refused = { isProblem: problem instanceof Problem, status, kind, message };
console.log(JSON.stringify({ method, frame, numbers, off, size, phase: job.info.phase, ...refused }));
"""
USE = """
import { Client, Problem, type Drawing, type Frame, type api } from "hybridmpm";
import type { HybridmpmView } from "hybridmpm/element";

const client = new Client("http://127.0.0.1:8000", { key: null });
const session = await client.create({ scenario: "water_2d", seed: 7, coarse: "1/16" });
const drawing: Drawing = [[0.3, 0.3], [0.5, 0.5]];
const needed: number = (await session.steer(drawing, { hold: 3 })).needs.acceleration;
const stream = await session.stream();
stream.addEventListener("frame", ({ detail }) => {
  const frame: Frame = detail;
  console.log(frame.positions[0], needed);
});
stream.push({ point: [0.5, 0.3], velocity: [1, 0], radius: 0.1 });
for await (const frame of stream.frames()) if (frame.number > 10) break;
const info: api.SessionBody = session.info;
const view: HybridmpmView = document.createElement("hybridmpm-view");
view.addEventListener("status", ({ detail }) => console.log(detail.frame));
session.refresh().catch((error: unknown) => error instanceof Problem && error.kind);
// @ts-expect-error a number is no drawing
session.steer(3);
// @ts-expect-error there is no such field
client.create({ scenari: "water_2d" });
// @ts-expect-error there is no such field
info.frames;
"""
NPM = ("npm", "install", "--silent", "--no-audit", "--no-fund")

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(shutil.which("npm") is None, reason="npm is missing"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an empty folder in which the packed client is installed."""
    packed, folder = tmp_path_factory.mktemp("packed"), tmp_path_factory.mktemp("installed")
    subprocess.run(["make", "npm", f"DIST={packed}"], cwd=ROOT, check=True, capture_output=True)
    (archive,) = packed.glob("hybridmpm-*.tgz")
    version = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]
    assert archive.name == f"hybridmpm-{version['version']}.tgz"
    subprocess.run([*NPM, "--offline", archive], cwd=folder, check=True, capture_output=True)
    return folder


def test_node_uses_a_service_by_the_package(folder: Path, start_module: Callable[..., Any]) -> None:
    service = start_module()
    (folder / "program.mjs").write_text(PROGRAM, encoding="utf-8")
    # Node 20 has a WebSocket behind this flag, later ones without it.
    flags = ["--experimental-websocket", "--no-warnings"]
    command = ["node", *flags, "program.mjs", f"http://{service.address}"]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=200)
    assert ran.returncode == 0, ran.stderr
    found = json.loads(ran.stdout)
    assert (found["method"], found["frame"], found["numbers"], found["phase"]) == ("analytic", 3, 2, "done")
    assert found["off"] <= 0.5 / 65535 + 1e-6
    assert found["size"] > 10_000
    assert (found["isProblem"], found["status"], found["kind"]) == (True, 404, "session-not-found")
    assert found["message"].startswith("Unknown session: there is no session ")


@pytest.mark.parametrize("resolution", ["nodenext", "bundler"])
def test_typescript_knows_the_types(folder: Path, resolution: str) -> None:
    if not (folder / "node_modules" / "typescript").exists():
        got = subprocess.run([*NPM, "typescript@5"], cwd=folder, check=False, env=os.environ, timeout=200)
        if got.returncode:
            pytest.skip("typescript cannot be had from npm")
    (folder / "use.mts").write_text(USE, encoding="utf-8")
    kind = "nodenext" if resolution == "nodenext" else "esnext"
    flags = ["--noEmit", "--strict", "--target", "es2022", "--lib", "es2022,dom,dom.iterable"]
    command = ["node_modules/.bin/tsc", *flags, "--module", kind, "--moduleResolution", resolution, "use.mts"]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout
