"""Prints the digest of all sources that the WebAssembly modules are built from.

A test compares it with the one that was printed when the committed modules were built.
"""

import hashlib
from pathlib import Path

CRATES = Path(__file__).parents[1]


def digest() -> str:
    """Return the SHA-256 of names and contents of the sources of five crates, without their tests."""
    total = hashlib.sha256()
    files = [
        file
        for crate in ("guidance", "mpm", "rigid", "threads", "web")
        for file in (CRATES / crate).rglob("*")
    ]
    files = [file for file in files if "tests" not in file.relative_to(CRATES).parts]
    for file in sorted(file for file in files if file.suffix in {".rs", ".toml"}):
        name = file.relative_to(CRATES).as_posix().encode()
        total.update(name + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()


if __name__ == "__main__":
    print(digest())  # noqa: T201 - a command
