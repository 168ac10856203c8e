"""The table of versions in the documentation is that of the code."""

import re
from pathlib import Path

from hybridmpm import SOLVER_VERSION, MpmSolver, _core, scenarios, snapshots
from hybridmpm.control import guidance
from hybridmpm.hybrid import simulator as hybrid
from hybridmpm.mpm import stepper
from hybridmpm.physics import simulator as physics
from hybridmpm.planner import auto

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "snapshots.md"
MAGIC = re.compile(r"HMPM[A-Z]{4}")


def expected() -> dict[str, str]:
    """Return the version of each format by its magic; without a number where the format has none."""
    solver = MpmSolver(scenarios.water_2d(0), r_p=1 / 16, show_all=True)
    joint = solver.snapshot()
    mpm, shown = stepper._parted(joint)
    assert shown is not None
    assert int.from_bytes(mpm[8:12], "little") == _core.SNAPSHOT_VERSION
    assert int.from_bytes(mpm[12:16], "little") == SOLVER_VERSION
    assert int.from_bytes(shown[8:12], "little") == _core.UPSAMPLER_VERSION
    versions = {
        snapshots.MAGIC: snapshots.VERSION,
        mpm[:8]: _core.SNAPSHOT_VERSION,
        shown[:8]: _core.UPSAMPLER_VERSION,
        physics._MAGIC: physics._VERSION,
        hybrid._MAGIC: hybrid._VERSION,
        auto._MAGIC: auto._VERSION,
        guidance._MAGIC: guidance._VERSION,
    }
    return {magic.decode(): str(version) for magic, version in versions.items()} | {
        joint[:8].decode(): "none"
    }


def rows(title: str) -> list[list[str]]:
    """Return the cells of the table below a title of the page."""
    text = PAGE.read_text(encoding="utf-8").split(f"## {title}\n", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_table_of_formats_is_that_of_the_code() -> None:
    assert {magic: version for _, magic, version in rows("Versions of formats")} == expected()


def test_no_format_of_the_code_is_missing() -> None:
    sources = [*ROOT.glob("python/hybridmpm/**/*.py"), *ROOT.glob("rust/**/*.rs")]
    found = {magic for file in sources for magic in MAGIC.findall(file.read_text(encoding="utf-8"))}
    assert found == set(expected())


def test_each_version_of_the_solver_has_its_row() -> None:
    assert [row[0] for row in rows("Versions of the solver")] == [
        str(number) for number in range(1, SOLVER_VERSION + 1)
    ]
