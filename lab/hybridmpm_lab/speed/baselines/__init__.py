"""Other solvers that ours is measured beside: Taichi, its fork quadrants, and Warp."""

import importlib.util

from hybridmpm.errors import ConfigError

SOLVERS = ("taichi", "quadrants", "warp")
"""Packages in which a plain MLS-MPM solver is written; quadrants is Taichi's maintained fork."""


def require_installed(package: str) -> None:
    """Raise a `ConfigError` unless the package of a baseline is installed; does not import it."""
    try:
        found = importlib.util.find_spec(package) is not None
    except ValueError:  # a module that is blocked
        found = False
    if not found:
        raise ConfigError(f"the baseline {package} is not installed: pip install --editable lab")
