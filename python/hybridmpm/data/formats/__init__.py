"""The formats of data sets, and their detection."""

import json
from pathlib import Path

from hybridmpm.data.formats.gns import GNS
from hybridmpm.data.formats.groups import HYBRIDMPM, LAGRANGEBENCH
from hybridmpm.data.formats.layout import Format
from hybridmpm.data.formats.neuralmpm import NEURALMPM
from hybridmpm.data.formats.tfrecord import DEEPMIND
from hybridmpm.errors import DataError

__all__ = ["FORMATS", "Format", "detect"]

FORMATS = {form.name: form for form in (HYBRIDMPM, LAGRANGEBENCH, GNS, NEURALMPM, DEEPMIND)}


def detect(folder: Path) -> Format:
    """Return the format of a data set, found by its files and, where these do not decide, its metadata.

    Raises
    ------
    DataError
        The folder has no data set; or the data set is in LagrangeBench's layout without a mark of whose
        particle types it has, DeepMind's or LagrangeBench's.
    """
    if not folder.is_dir():
        raise DataError(f"{folder} is no folder; a data set is a folder with metadata.json and its splits")
    for form in (DEEPMIND, GNS, NEURALMPM):
        if form.splits(folder):
            return form
    if not HYBRIDMPM.splits(folder):
        raise DataError(f"{folder} holds no split of any known format: {', '.join(FORMATS)}")
    try:
        name = json.loads((folder / "metadata.json").read_text(encoding="utf-8"))["hybridmpm"]["format"]
        return FORMATS[name]
    except (OSError, ValueError, KeyError, TypeError):
        raise DataError(
            f"{folder} has LagrangeBench's layout, whose particle types have two conventions: name the "
            "format lagrangebench (3 is a rigid body) or hybridmpm (DeepMind's, 3 is kinematic)"
        ) from None
