"""What `make release` makes: archives equal from build to build, which serve where nothing compiles."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import venv
from pathlib import Path
from typing import Any

import httpx
import pytest

ROOT = Path(__file__).parents[3]
PROGRAM = """
import json, sys
from hybridmpm import MpmSolver, physics, scenarios
solver = MpmSolver(scenarios.water_2d(0))
solver.advance(20)
for name in physics.models():
    physics.NeuralModel.load(name)
print(json.dumps({"digest": solver.digest(), "torch": "torch" in sys.modules}))
"""


def released(folder: Path) -> list[Path]:
    """Return the archives that `make release` puts into a folder, without the tests' own settings."""
    hidden = ("PYTHONPATH", "CARGO_TARGET_DIR", "VIRTUAL_ENV")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    command = ["make", "release", f"DIST={folder}", f"PYTHON={sys.executable}"]
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True)
    return [file for kind in ("whl", "tar.gz", "tgz") for file in sorted(folder.glob(f"*.{kind}"))]


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_a_release_is_reproducible_and_serves_without_a_compiler(tmp_path: Path) -> None:
    first = released(tmp_path / "first")
    shutil.rmtree(ROOT / "target" / "wheel")
    second = released(tmp_path / "second")
    assert [file.name for file in first] == [file.name for file in second]
    assert len(first) == 5, "a wheel and the sources of library and service, and the client for npm"
    assert "manylinux" in first[0].name
    assert "abi3" in first[0].name
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in second]
    sums = (tmp_path / "first" / "SHA256SUMS").read_text().split()
    assert set(sums[::2]) == {hashlib.sha256(file.read_bytes()).hexdigest() for file in first}
    assert (tmp_path / "first" / "RELEASE.md").read_text().startswith("## ")

    venv.create(tmp_path / "bare", with_pip=True)
    programs = tmp_path / "bare" / "bin"
    bare = {"PATH": str(programs), "HOME": str(tmp_path)}
    install = [programs / "pip", "install", "--quiet", "--only-binary", ":all:"]
    source = ["--find-links", tmp_path / "first", "hybridmpm[service]"]
    subprocess.run([*install, *source], env=bare | pip_settings(), check=True, cwd=tmp_path)
    ran = printed(programs / "python", cwd=tmp_path, env=bare)
    assert ran == printed(Path(sys.executable), cwd=ROOT)
    assert ran["torch"] is False
    assert "<title>" in served(programs / "hybridmpm", bare, tmp_path)


def printed(python: Path, **settings: Any) -> dict[str, Any]:
    """Return what an interpreter prints in the program."""
    command = [python, "-c", PROGRAM]
    ran = subprocess.run(command, check=True, capture_output=True, text=True, **settings)
    answer: dict[str, Any] = json.loads(ran.stdout)
    return answer


def pip_settings() -> dict[str, str]:
    """Return the settings by which pip finds its index on this machine."""
    kept = ("PIP_", "SSL_", "REQUESTS_")
    return {name: value for name, value in os.environ.items() if name.startswith(kept)}


def served(program: Path, environment: dict[str, str], folder: Path) -> str:
    """Return the page that `hybridmpm serve` sends."""
    with (folder / "log").open("w") as log:
        server = subprocess.Popen(
            [program, "serve", "--port", "0"], env=environment, cwd=folder, stdout=log, stderr=log
        )
        try:
            while server.poll() is None:
                lines = (folder / "log").read_text().split()
                found = [word for word in lines if word.startswith("http://127.0.0.1:")]
                if found:
                    return httpx.get(found[0], follow_redirects=True).text
                time.sleep(0.1)
        finally:
            server.terminate()
            server.wait()
    return ""
