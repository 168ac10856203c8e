"""Importing peers, each of which needs packages that a plain installation lacks."""

import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence
from types import ModuleType

from hybridmpm.errors import ConfigError

SOLVERS = ("taichi", "quadrants", "warp")
"""Packages in which a plain MLS-MPM solver is written; quadrants is Taichi's maintained fork."""
_MODULES = {
    "taichi": "taichi_mpm",
    "quadrants": "taichi_mpm",
    "warp": "warp_mpm",
    "scipy": "scipy_tree",
}
"""Module of each peer in this folder, by the package that it needs."""


def check_peer(name: str, known: Sequence[str]) -> None:
    """Check that a peer is known and its package installed, without importing it.

    Parameters
    ----------
    name : str
        Peer asked for.
    known : sequence of str
        The peers that the benchmark can be measured beside.

    Raises
    ------
    ConfigError
        Another peer is asked for, or its package is not installed.
    """
    if name not in known:
        raise ConfigError(f"the peer must be {' or '.join(known)}, got {name!r}")
    try:
        found = importlib.util.find_spec(name) is not None
    except ValueError:  # a module that is blocked
        found = False
    if not found:
        raise ConfigError(f"the peer {name} is not installed: pip install 'hybridmpm[bench]'")


def peer_module(name: str, known: Sequence[str]) -> ModuleType:
    """Import the module of a peer; parameters and errors as for `check_peer`.

    A process can have Taichi or quadrants, not both: they share a module.
    """
    check_peer(name, known)
    if name == "quadrants":
        # The fork has the same names; this is how programs written for Taichi run on it.
        os.environ.setdefault("ENABLE_QUADRANTS_HEADER_PRINT", "False")
        sys.modules["taichi"] = importlib.import_module("quadrants")
    return importlib.import_module(f"hybridmpm_lab.speed.baselines.{_MODULES[name]}")
