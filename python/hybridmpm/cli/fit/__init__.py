"""`hybridmpm fit ...`: learns constants of the solver from scenes."""

from hybridmpm.cli.fit.command import fit

__all__ = ["fit"]
