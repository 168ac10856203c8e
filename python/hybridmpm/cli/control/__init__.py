"""`hybridmpm control`."""

from hybridmpm.cli.control.command import control

__all__ = ["control"]
