"""`python -m hybridmpm_lab ...`: measure, print a table, write rows (--json), draw (--chart)."""

from hybridmpm.cli import commands_of

_MODULES = {
    "all": "harness.results",
    "batch": "speed.solver",
    "control": "control.table",
    "coarse": "compare.lists",
    "contact": "speed.contact",
    "findings": "compare.findings",
    "forces": "speed.forces",
    "fit": "fitting.levels",
    "hybrid": "compare.hybrid",
    "models": "compare.lists",
    "networks": "speed.networks",
    "packages": "speed.packages",
    "plan-errors": "compare.plan_errors",
    "playing": "speed.playing",
    "scaling": "compare.scaling",
    "service": "service.command",
    "speed": "speed.solver",
    "stability": "stability.map",
    "tradeoff": "compare.lists",
    "validate": "validation.page",
}
"""Module of each command."""

cli = commands_of("hybridmpm_lab", _MODULES, "Measure the published results of hybridmpm on this machine.")


def main() -> None:
    """Run the command line and exit."""
    cli(prog_name="python -m hybridmpm_lab")
