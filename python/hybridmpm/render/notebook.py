"""Pictures in notebooks: as HTML, and shown while a cell runs; elsewhere the system's viewer shows them."""

import base64
import html
import io
import sys
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ExportError
from hybridmpm.render import View, view_of
from hybridmpm.scene import Scene

WIDTH = 480
"""Width of the pictures that stand for an object in a notebook [pixels]."""

Picture = npt.NDArray[np.uint8]

_views: WeakKeyDictionary[object, tuple[object, View]] = WeakKeyDictionary()
"""The latest view of each owner, and what it was made for: making one takes as long as ten pictures."""
_shown: WeakKeyDictionary[object, tuple[int, Any]] = WeakKeyDictionary()
"""For each owner of a picture the number of the cell that shows it, and the handle of that display."""


def view_for(owner: object, scene: Scene, types: npt.NDArray[np.uint8], width: int, spacing: float) -> View:
    """Return `view_of`, cached for each owner, whose scene stays the same."""
    wanted = (width, spacing, types.tobytes())
    made_for, view = _views.get(owner, (None, None))
    if view is None or made_for != wanted:
        view = view_of(scene, types, width, spacing)
        _views[owner] = wanted, view
    return view


def figure(picture: Picture, caption: str) -> str:
    """Return HTML for a picture (H, W, 3) over a line of text, complete in itself."""
    stream = io.BytesIO()
    _image(picture).save(stream, format="PNG")
    data = base64.b64encode(stream.getvalue()).decode()
    height, width, _ = picture.shape
    return (
        f'<figure style="margin: 0"><img width="{width}" height="{height}" alt="" '
        f'src="data:image/png;base64,{data}"><figcaption>{html.escape(caption)}</figcaption></figure>'
    )


def show(owner: object, picture: Picture, caption: str) -> None:
    """Show a picture in the running cell of a notebook, or else in the system's viewer of pictures.

    Parameters
    ----------
    owner : object
        Whose picture it is. Its next one takes the place of this one, as long as the same cell runs.
    picture : uint8 (H, W, 3)
    caption : str
        Line under the picture in a notebook.

    Raises
    ------
    ExportError
        There is neither a notebook nor a viewer.
    """
    shell = _notebook()
    if shell is None:
        _view(picture)
        return
    bundle = {"text/html": figure(picture, caption), "text/plain": caption}
    before = _shown.get(owner)
    if before is not None and before[0] == shell.execution_count:
        before[1].update(bundle, raw=True)
        return
    display = sys.modules["IPython"].display.display
    _shown[owner] = (shell.execution_count, display(bundle, raw=True, display_id=True))


def _notebook() -> Any:
    """Return the shell of the notebook that runs this; None in any other place, a terminal among them."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell if getattr(shell, "kernel", None) is not None else None


def _view(picture: Picture) -> None:
    from PIL import ImageShow  # noqa: PLC0415 - only for those who look

    if not ImageShow.show(_image(picture), title="hybridmpm"):
        raise ExportError(
            "there is no program here to show pictures: use a notebook, or write a file, as "
            "`hybridmpm simulate ... --out fluid.png` does"
        )


def _image(picture: Picture) -> Any:
    from PIL import Image  # noqa: PLC0415 - takes a moment, and only pictures need it

    return Image.fromarray(picture)
