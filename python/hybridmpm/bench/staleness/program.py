"""The part of a source file that computes: a change of anything else cannot change a result."""

import ast
import json
import re
import tomllib

from hybridmpm._support.protobuf import messages

_ONNX_GRAPH = 7
"""Field of an ONNX file that holds the graph; other fields tell about the network, such as its errors."""
_USE_OR_MODULE = re.compile(r"^\s*(pub(\([^)]*\))?\s+)?(use\s[^;]*|mod\s+\w+);", re.MULTILINE)
_COMMENT = re.compile(r"^\s*//.*$", re.MULTILINE)
_UNIT_TESTS = re.compile(r"^#\[cfg\(test\)\]\s*mod \w+ \{.*?^\}", re.MULTILINE | re.DOTALL)


def program(name: str, content: bytes) -> str | bytes:
    """Return what a file computes, to be compared with another version of the file.

    Imports, `__all__`, comments and docstrings are left out of Python. Imports, lists of modules, comments
    and unit tests are left out of Rust. Of a crate's manifest, features and dependencies on other projects
    are kept; of a network, its graph with the weights. Any other file is returned as it is.

    Parameters
    ----------
    name : str
        Name of the file, whose suffix says what the file is.
    content : bytes
        Contents of the file.
    """
    if name.endswith(".py"):
        return ast.dump(_Computation().visit(ast.parse(content)))
    if name.endswith(".rs"):
        text = content.decode()
        for left_out in (_UNIT_TESTS, _COMMENT, _USE_OR_MODULE):
            text = left_out.sub("", text)
        return " ".join(text.split())
    if name.endswith("Cargo.toml"):
        return _manifest(content.decode())
    if name.endswith(".onnx"):
        return b"".join(part for number, part in messages(memoryview(content)) if number == _ONNX_GRAPH)
    return content


class _Computation(ast.NodeTransformer):
    """Removes the statements that compute nothing."""

    def visit_Import(self, _node: ast.Import) -> None:
        """Remove the import."""

    def visit_ImportFrom(self, _node: ast.ImportFrom) -> None:
        """Remove the import."""

    def visit_Assign(self, node: ast.Assign) -> ast.AST | None:
        """Remove the list of public names."""
        is_list = isinstance(node.targets[0], ast.Name) and node.targets[0].id == "__all__"
        return None if is_list else self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        """Remove a text that stands alone: a docstring of a module, a class, a function or a field."""
        is_text = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if is_text else self.generic_visit(node)

    def visit_If(self, node: ast.If) -> ast.AST | None:
        """Remove a branch that held only imports for types."""
        self.generic_visit(node)
        return node if node.body or node.orelse else None


def _manifest(text: str) -> str:
    manifest = tomllib.loads(text)
    kept = {
        part: {
            name: value
            for name, value in manifest.get(part, {}).items()
            if not (isinstance(value, dict) and "path" in value)
        }
        for part in ("dependencies", "build-dependencies", "features")
    }
    return json.dumps(kept, sort_keys=True)
