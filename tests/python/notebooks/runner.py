"""Runs the notebooks of docs/guide/notebooks; `python -m tests.python.notebooks.runner` writes their outputs.

Cells are plain Python, so this needs no Jupyter: a cell is executed, and what its last line stands for is
shown as a notebook shows it, by its HTML, its picture or its `repr`.
"""

import ast
import base64
import contextlib
import io
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

FOLDER = Path(__file__).parents[3] / "docs" / "guide" / "notebooks"

Bundle = dict[str, Any]
"""An output by its media types."""


class Shell:
    """What `IPython.get_ipython` answers within a notebook."""

    def __init__(self, *, kernel: bool = True) -> None:
        self.kernel = kernel or None
        self.execution_count = 0
        self.outputs: list[Bundle] = []
        # matplotlib asks to be told of the ends of cells; `_figures` looks for what it has drawn instead.
        self.events = SimpleNamespace(register=lambda *_: None)

    def display(self, bundle: Bundle, *, raw: bool, display_id: bool) -> SimpleNamespace:
        """Show a bundle; the handle's `update` puts another one in its place."""
        assert raw
        assert display_id
        place, outputs = len(self.outputs), self.outputs
        outputs.append(bundle)

        def update(newer: Bundle, *, raw: bool) -> None:
            assert raw
            outputs[place] = newer

        return SimpleNamespace(update=update)


def run(path: Path) -> dict[str, Any]:
    """Return the notebook of a file with the outputs of all its cells."""
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    shell, names = Shell(), {"__name__": "__main__"}
    with as_ipython(shell):
        for cell in notebook["cells"]:
            if cell["cell_type"] == "code":
                shell.execution_count += 1
                cell["execution_count"] = shell.execution_count
                cell["outputs"] = list(_executed("".join(cell["source"]), names, shell))
    return notebook


@contextlib.contextmanager
def as_ipython(shell: Shell) -> Iterator[None]:
    """Let the library find itself in a notebook."""
    module = ModuleType("IPython")
    display = SimpleNamespace(display=shell.display)
    vars(module).update(get_ipython=lambda: shell, display=display, version_info=(9, 0))
    before = sys.modules.get("IPython")
    sys.modules["IPython"] = module
    try:
        yield
    finally:
        del sys.modules["IPython"]
        if before is not None:
            sys.modules["IPython"] = before


def _executed(source: str, names: dict[str, Any], shell: Shell) -> Iterator[dict[str, Any]]:
    """Run a cell, and yield its outputs as a notebook file has them."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    shell.outputs, printed, value = [], io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), names)  # noqa: S102 - a notebook of ours
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # noqa: S307
    if printed.getvalue():
        yield {
            "output_type": "stream",
            "name": "stdout",
            "text": printed.getvalue().splitlines(keepends=True),
        }
    for bundle in (*shell.outputs, *_figures()):
        yield {"output_type": "display_data", "data": bundle, "metadata": {}}
    if value is not None:
        count = shell.execution_count
        yield {
            "output_type": "execute_result",
            "data": _bundle(value),
            "metadata": {},
            "execution_count": count,
        }


def _figures() -> Iterator[Bundle]:
    """Yield the charts that a cell has left open, and close them."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    for number in [] if pyplot is None else pyplot.get_fignums():
        stream = io.BytesIO()
        pyplot.figure(number).savefig(stream, format="png", dpi=80, metadata={"Software": None})
        pyplot.close(number)
        yield {"text/plain": "<Figure>", "image/png": base64.b64encode(stream.getvalue()).decode()}


def _bundle(value: Any) -> Bundle:
    """Return what a notebook shows of a value."""
    bundle: Bundle = {"text/plain": repr(value)}
    if hasattr(value, "_repr_html_"):
        bundle["text/html"] = value._repr_html_()
    elif hasattr(value, "_repr_png_"):
        bundle["image/png"] = base64.b64encode(value._repr_png_()).decode()
    return bundle


if __name__ == "__main__":
    for file in sorted(FOLDER.glob("*.ipynb")):
        text = json.dumps(run(file), indent=1, ensure_ascii=False)
        file.write_text(text + "\n", encoding="utf-8")
        sys.stdout.write(f"{file.name}: {file.stat().st_size} bytes\n")
