"""What the built distribution carries."""

import importlib.util
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

SERVICE = Path(__file__).parents[2] / "service"


@pytest.mark.skipif(
    importlib.util.find_spec("hatchling") is None, reason="needs the build backend: pip install hatchling"
)
def test_the_wheel_carries_the_page_and_every_module(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)],
        cwd=SERVICE,
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    package = SERVICE / "hybridmpm_service"
    expected = {
        str(file.relative_to(SERVICE))
        for file in package.rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert names == expected
    assert "hybridmpm_service/page/index.html" in names
