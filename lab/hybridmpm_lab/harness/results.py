"""The published results: their files, commands and order, and which are no longer of what ships."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import click

from hybridmpm.errors import ConfigError
from hybridmpm.planner.store import SHIPPED
from hybridmpm_lab.harness.provenance import has_gpu, outdated
from hybridmpm_lab.harness.rows import Row, print_table, read_rows

FOLDER = Path(__file__).resolve().parents[3] / "docs/results"
"""Folder of the published rows; the laboratory is run in its checkout."""


@dataclass(frozen=True, kw_only=True)
class Result:
    """A published table of rows, NAME.json in `FOLDER`."""

    name: str
    """Name of the file of rows, and of the chart."""
    command: str
    """Command of the laboratory with its options, without those for files."""
    minutes: int
    """Time that the command takes on two idle cores [min]."""
    needs: tuple[str, ...] = ()
    """Results that have to be fresh before."""
    has_chart: bool = True
    """Whether the command draws."""
    has_runs: bool = False
    """Whether the command can be resumed."""
    needs_gpu: bool = False
    """Whether the command needs a GPU of CUDA."""
    after: str | None = None
    """Command that passes the rows on."""

    @property
    def file(self) -> Path:
        """File of the rows."""
        return FOLDER / f"{self.name}.json"

    def rows(self) -> list[Row]:
        """Return the rows that are committed."""
        return read_rows(self.file)

    def reasons(self) -> list[str]:
        """Return the ingredients of its rows that are no longer those that ship; none of a fresh result."""
        return sorted({reason for row in self.rows() if (reason := outdated(row)) is not None})

    def words(self, runs: Path) -> list[str]:
        """Return the arguments of the command; runs are appended to a file in a folder."""
        words = [*self.command.split(), "--json", str(self.file)]
        words += ["--chart", str(self.file.with_suffix(".svg"))] if self.has_chart else []
        return words + (["--runs", str(runs / f"{self.name}.jsonl")] if self.has_runs else [])


_PEERS = "--peer taichi --peer quadrants"
_BASELINES = (
    "--baseline taichi --baseline quadrants --baseline warp --instructions avx512 --instructions avx2"
)
_GPU = "--device cuda --baseline warp --baseline taichi --threads 2 --threads 16"
RESULTS = (
    Result(name="mpm", command=f"speed {_BASELINES}", minutes=25),
    Result(name="mpm-gpu", command=f"speed {_GPU}", minutes=3, needs_gpu=True),
    Result(
        name="networks-gpu",
        command="networks --device cuda --way eager --way captured --way compiled",
        minutes=10,
        has_chart=False,
        needs_gpu=True,
    ),
    Result(name="packages", command="packages", minutes=5, has_chart=False),
    Result(name="scaling", command="scaling", minutes=10),
    Result(name="batch", command="batch --scenes 16 --scenes 256", minutes=2, has_chart=False),
    Result(name="coarse", command="coarse", minutes=25, has_runs=True),
    Result(
        name="tradeoff",
        command=f"tradeoff {_PEERS}",
        minutes=110,
        has_runs=True,
        after=f"plan-errors {FOLDER / 'tradeoff.json'} {SHIPPED}",
    ),
    Result(name="models", command="models", minutes=25, has_runs=True),
    Result(name="hybrid", command="hybrid --bounded 200", minutes=240, has_runs=True),
    Result(
        name="hybrid-worst",
        command="hybrid --scenes 24 --first 5200500 --method hybrid*fluids* --method coarse*unfitted*",
        minutes=15,
        has_chart=False,
        has_runs=True,
    ),
    Result(name="stability-map", command="stability", minutes=20, has_runs=True),
    Result(name="control", command="control", minutes=180, has_runs=True),
    Result(name="service", command="service", minutes=10, has_chart=False),
    Result(name="attacks", command="service --part attacks --seconds 8", minutes=8, has_chart=False),
    Result(name="door", command="service --part door --part sizes --calls 2000", minutes=3, has_chart=False),
    Result(name="visit", command="service --part visit --repeats 5 --seconds 8", minutes=2, has_chart=False),
)
"""All results of rows, in the order in which they are made."""
_BEFORE = "of solver version 5; places of particles, obstacles, sand changed since; hours of an idle machine"
STALE = {
    "neighbors": _BEFORE,
}
"""Results that are known to be stale, with the reason why nobody can make them today."""


@click.command("all")
@click.option("--stale", is_flag=True, help="List the stale results, and make none.")
@click.option(
    "--runs",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs"),
    show_default=True,
    metavar="FOLDER",
    help="Folder of the runs so far; the same command resumes with them after an interruption.",
)
def all(*, stale: bool, runs: Path) -> None:  # noqa: A001 - the name of the command
    """Make the stale published results anew, in order; times need an idle machine.

    A result is stale where the solver, a network, a fitted table or a result that took part is no longer the
    one that ships.
    """
    found: dict[str, tuple[Result, list[str]]] = {}
    for one in RESULTS:
        if reasons := one.reasons() + [f"needs {name}" for name in one.needs if name in found]:
            found[one.name] = one, reasons
    rows = [
        {
            "result": one.name,
            "minutes": one.minutes,
            "needs": ", ".join(one.needs),
            "command": " ".join(["python -m hybridmpm_lab", *one.words(runs)]),
            "reason": "; ".join(reasons),
        }
        for one, reasons in found.values()
    ]
    if rows:
        print_table(rows, tuple(rows[0]))
    minutes = sum(one.minutes for one, _ in found.values())
    click.echo(f"{len(found)} of {len(RESULTS)} results are stale; making them takes {minutes} minutes")
    if stale:
        return
    runs.mkdir(parents=True, exist_ok=True)
    for one, _ in found.values():
        if one.needs_gpu and not has_gpu():
            click.echo(f"{one.name} needs a GPU of CUDA, and stays as it is")
            continue
        for words in (one.words(runs), (one.after or "").split()):
            command = [sys.executable, "-m", "hybridmpm_lab", *words]
            if words and subprocess.run(command, check=False).returncode:  # noqa: S603 - constants
                raise ConfigError(f"{one.name} could not be made; the same command resumes here")
