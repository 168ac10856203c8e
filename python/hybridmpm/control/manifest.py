"""The networks of control that come with the library: each folder has a manifest with their digests."""

import json
from pathlib import Path

from hybridmpm._support.files import read_checked
from hybridmpm.errors import DataError

_MANIFEST = "manifest.json"


def networks(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each network's file, by the network's name, those to be preferred first.

    Raises
    ------
    DataError
        The manifest is missing or damaged.
    """
    path = folder / _MANIFEST
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
        return {str(name): str(entry["sha256"]) for name, entry in plain.items()}
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise DataError(f"{path} is missing or damaged: {error!r}; install the library anew") from None


def read_network(name: str, folder: Path) -> bytes:
    """Return the bytes of a network's file, once its digest has been checked.

    Raises
    ------
    DataError
        There is no network of this name, its file is missing, or is not the one that the manifest names.
    """
    known = networks(folder)
    if name not in known:
        raise DataError(f"there is no network {name!r}; known are {', '.join(known) or 'none'}")
    return read_checked(folder / f"{name}.onnx", known[name])


def write_digest(name: str, sha256: str, folder: Path) -> Path:
    """Add a network to the manifest, or replace the one of this name; return the manifest's path."""
    path = folder / _MANIFEST
    known = networks(folder) if path.exists() else {}
    entries = {key: {"sha256": value} for key, value in known.items()} | {name: {"sha256": sha256}}
    path.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
    return path
