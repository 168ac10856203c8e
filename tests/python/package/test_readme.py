"""The README's Python example does what its text says."""

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parents[3] / "README.md"


def test_the_example_runs_and_moves_the_water_by_the_arrow(tmp_path: Path) -> None:
    example, *_others = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    result = subprocess.run(
        [sys.executable, "-c", example], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    match = re.search(r"\) \[ *(\S+) +(\S+?)\]", result.stdout)
    assert match, result.stdout
    assert all(abs(float(number) - 0.2) < 0.01 for number in match.groups()), result.stdout
