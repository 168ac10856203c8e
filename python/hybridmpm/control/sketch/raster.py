"""From the raster form of a sketch, a PNG, to an arrow or an ellipse."""

import numpy as np

from hybridmpm.control.sketch.picture.arrow import read_arrow
from hybridmpm.control.sketch.picture.ink import read_ink
from hybridmpm.control.sketch.picture.marks import grown, main_mark
from hybridmpm.control.sketch.picture.oval import read_oval
from hybridmpm.control.sketch.picture.png import decode_png
from hybridmpm.control.sketch.sketch import Sketch
from hybridmpm.errors import SketchError

_EDGE = 2
"""Distance from a mark [pixels] within which weaker pixels belong to its smoothed edge."""


def parse_png(data: bytes) -> Sketch:
    """Return the sketch that a PNG shows.

    The ground is the colour of most pixels. Red ink is an arrow, green ink an oval; ink of any other colour
    is an oval if it goes round, else an arrow. The head of an arrow is the end with more ink beside the
    line. Gaps of up to 12 pixels (of 512) are bridged, an oval may be open by up to 70 degrees or be drawn
    round more than once. The width of the line gives the widths of the sketch, and so the depth in 3D.

    Parameters
    ----------
    data : bytes
        A still, square PNG of 16 to 2048 pixels a side and at most 1 MiB. Transparent pixels are white.

    Raises
    ------
    SketchError
        The data are no such PNG; or the picture is blank, has too little or too much ink, several marks, or
        red and green ink together; or an outline is open, filled or no oval; or an arrow is too short, its
        head cannot be told from its tail, or there are other lines beside it.
    """
    ink = read_ink(decode_png(data))
    mark, bridged = main_mark(ink.mask)
    coverage = np.where(grown(mark, _EDGE), ink.coverage, 0.0)
    if ink.color == "red":
        return read_arrow(coverage, bridged)
    if ink.color == "green":
        return read_oval(coverage)
    try:
        return read_oval(coverage)
    except SketchError:
        return read_arrow(coverage, bridged)
