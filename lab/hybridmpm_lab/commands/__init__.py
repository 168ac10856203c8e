"""`python -m hybridmpm_lab ...`: measure, print a table, write rows (--json), draw (--chart)."""

from hybridmpm.cli import commands_of

_MODULES = {
    "all": "all",
    "batch": "speed",
    "control": "control",
    "coarse": "compare",
    "fit": "fit",
    "hybrid": "compare",
    "models": "compare",
    "plan-errors": "compare",
    "service": "service",
    "speed": "speed",
    "stability": "stability",
    "tradeoff": "compare",
    "validate": "validate",
}
"""Module of this package that has each command."""

cli = commands_of(__name__, _MODULES, "Measure the published results of hybridmpm on this machine.")


def main() -> None:
    """Run the command line and exit."""
    cli(prog_name="python -m hybridmpm_lab")
