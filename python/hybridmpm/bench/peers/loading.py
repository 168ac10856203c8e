"""Importing peers, each of which needs packages that a plain installation lacks."""

import importlib
from types import ModuleType

from hybridmpm.errors import ConfigError

_MODULES = {"taichi": "taichi_mpm", "scipy": "scipy_tree"}
"""Module of each peer in this folder."""


def peer_module(name: str, known: str) -> ModuleType:
    """Import the module of a peer.

    Parameters
    ----------
    name : str
        Peer asked for.
    known : str
        The peer that the benchmark can be measured beside.

    Raises
    ------
    ConfigError
        Another peer is asked for, or what the peer needs is not installed.
    """
    if name != known:
        raise ConfigError(f"the peer must be {known}, got {name!r}")
    try:
        return importlib.import_module(f"hybridmpm.bench.peers.{_MODULES[name]}")
    except ImportError:
        raise ConfigError(f"the peer {name} is not installed: pip install 'hybridmpm[bench]'") from None
