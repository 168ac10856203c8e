"""Guards in a saved file: their names and settings, from which the library's own guards are made again."""

from collections.abc import Iterable
from typing import Any, TypeAlias

from hybridmpm.errors import SnapshotError
from hybridmpm.hybrid.guard import Guard
from hybridmpm.hybrid.guards import GUARDS

Description: TypeAlias = dict[str, Any] | None
"""Name and settings of a guard of the library; None for a guard of the caller's own."""


def described(guards: Iterable[Guard]) -> list[Description]:
    """Return what a file holds of guards, besides what they remember."""
    return [
        {"name": guard.name, "settings": guard.settings()} if type(guard) is GUARDS.get(guard.name) else None
        for guard in guards
    ]


def recalled(descriptions: Iterable[Description]) -> list[Guard]:
    """Return the guards of a file.

    Raises
    ------
    SnapshotError
        A guard was the caller's own: the file does not hold its code.
    """
    guards: list[Guard] = []
    for description in descriptions:
        if description is None:
            raise SnapshotError(
                "the file was saved with guards of your own: give all guards as `guards` to "
                "HybridSimulator.load"
            )
        guards.append(GUARDS[description["name"]](**description["settings"]))
    return guards
