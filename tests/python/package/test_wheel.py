"""The library's wheel works outside the checkout."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PROGRAM = """
import hybridmpm
from hybridmpm import MpmSolver, scenarios
assert hybridmpm.__file__.startswith({folder!r}), hybridmpm.__file__
solver = MpmSolver(scenarios.water_2d(0))
solver.advance(2)
for name in hybridmpm.physics.models():
    hybridmpm.physics.NeuralModel.load(name)
hybridmpm.play(solver, "page.html")
print(solver.frame)
"""


@pytest.mark.timeout(600)
def test_wheel_runs_outside_the_checkout(tmp_path: Path) -> None:
    maturin = shutil.which("maturin", path=str(Path(sys.executable).parent))
    assert maturin, "maturin is in the dev group and belongs beside the interpreter"
    wheels, site = tmp_path / "wheels", tmp_path / "site"
    # In the checkout's target folder, so that nothing compiles twice.
    subprocess.run(
        [maturin, "build", "--release", "--locked", "--interpreter", sys.executable, "--out", wheels],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = wheels.iterdir()
    assert "abi3" in wheel.name
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, wheel], check=True
    )
    for name in ("py.typed", "_native.pyi", "cli/__init__.py", "control/__init__.py"):
        assert (site / "hybridmpm" / name).is_file(), name
    weights = "python/hybridmpm/physics/weights"
    carried = {file.name for file in (site / "hybridmpm/physics/weights").iterdir()}
    assert carried == {file.name for file in (ROOT / weights).iterdir()}
    program = f"import sys; sys.path.insert(0, {str(site)!r})" + PROGRAM.format(folder=str(site))
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    assert result.stdout == "2\n"
    assert (tmp_path / "page.html").stat().st_size > 400_000  # with the solver in it
