"""The service imports public names of the library only.

Public are `hybridmpm` and the modules directly in it, unless they begin with an underscore, and of each the
names in its `__all__`, or all without an underscore where it has none.
"""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

SERVICE = Path(__file__).parents[2] / "service" / "hybridmpm_service"


def library_imports(source: str) -> Iterator[tuple[str, str]]:
    """Yield the module and the name of each import from the library; the name is empty for whole modules."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found = [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found = [(node.module or "", alias.name) for alias in node.names]
        else:
            continue
        yield from (one for one in found if one[0].split(".")[0] == "hybridmpm")


def is_public(module: str, name: str) -> bool:
    """Return whether an import is public by the rule above."""
    if module.count(".") > 1 or any(part.startswith("_") for part in module.split(".")):
        return False
    found = importlib.import_module(module)
    exported = getattr(found, "__all__", None)
    if not name or (exported is not None and name in exported):
        return True
    # A module in a package needs no place in its `__all__`: its own name says whether it is public.
    is_module = module == "hybridmpm" and importlib.util.find_spec(f"hybridmpm.{name}") is not None
    return not name.startswith("_") and (exported is None or is_module)


def test_the_service_imports_public_names_of_the_library_alone() -> None:
    imports = [
        (file.relative_to(SERVICE).as_posix(), *found)
        for file in SERVICE.rglob("*.py")
        for found in library_imports(file.read_text(encoding="utf-8"))
    ]
    assert len(imports) > 50
    assert [one for one in imports if not is_public(one[1], one[2])] == []


@pytest.mark.parametrize(
    ("statement", "public"),
    [
        ("import hybridmpm", True),
        ("from hybridmpm import Scene, checking", True),
        ("from hybridmpm.errors import ConfigError", True),
        ("from hybridmpm.control import Goal", True),
        ("from hybridmpm.control.goal.goal import Goal", False),
        ("from hybridmpm.control import follow, laws", False),
        ("from hybridmpm._core import CancelFlag", False),
        ("from hybridmpm.simulator import _secret", False),
    ],
)
def test_the_rule_tells_public_names_from_others(statement: str, *, public: bool) -> None:
    assert all(is_public(*one) for one in library_imports(statement)) == public
