"""`Control`: the sketch and the true motion of a controlled trajectory."""

import io
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from hybridmpm.control import Arrow, Ellipse, Stroke, StrokeSketch
from hybridmpm.control.reversal import STARTS, Start

if TYPE_CHECKING:
    import hashlib

Floats = npt.NDArray[np.float32]

_SKETCHES: dict[str, type[Arrow | Ellipse]] = {"arrow": Arrow, "ellipse": Ellipse}
_DIGITS = 6
"""Digits after the point of what is stored of sketches, so that rounding in other libraries does not show."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Control:
    """Columns of an example of control. N particles, T frames, D dimensions.

    The force of the trajectory is that of a reversed case, its positions are where that force leads.
    """

    sketch: StrokeSketch
    """StrokeSketch of the motion, without distortion."""
    stroke: Stroke
    """The same as a hand draws it, with times."""
    picture: bytes
    """The same as a PNG, with an arrow's head and with gaps of the line: what `control.parse_png` reads."""
    control_frame: int
    """Frame of the forward run at which control starts."""
    start: Start
    """Whether the velocities at the start are those of the forward run ("live") or their negative."""
    cap: float
    """Largest force on a particle that was allowed [g]."""
    velocity: Floats
    """Velocities at the start (N, D) [m/s]."""
    target: Floats
    """True positions at the end (N, D) [m]."""
    smoothed_force: Floats
    """The trajectory's force smoothed over time, (T, N, D) [m/s^2]."""

    @property
    def name(self) -> str:
        """Kind of the sketch and of the start, e.g. "arrow, live"."""
        return f"{self.sketch.kind}, {self.start}"

    @property
    def arrays(self) -> dict[str, Floats]:
        """The arrays by the keys that they have in files."""
        return {key: getattr(self, key) for key in ("velocity", "target", "smoothed_force")}

    @property
    def texts(self) -> dict[str, str]:
        """StrokeSketch and stroke as JSON, by the keys that they have in files."""
        return {
            "sketch": json.dumps(_plain(self.sketch)),
            "stroke": self.stroke.model_dump_json(exclude_none=True),
        }

    @property
    def attributes(self) -> dict[str, int | float | str]:
        """The numbers and words, by the keys that they have in files."""
        return {"control_frame": self.control_frame, "start": self.start, "cap": self.cap}

    def digest_into(self, total: "hashlib._Hash") -> None:
        """Add everything to a digest; of the picture the pixels, since packers of PNGs differ."""
        for name, text in {**self.texts, **self.attributes}.items():
            total.update(f"{name} {text}\n".encode())
        for name, array in self.arrays.items():
            total.update(f"{name} <f4 {array.shape}\n".encode())
            total.update(np.ascontiguousarray(array, dtype="<f4").data)
        total.update(pixels(self.picture).tobytes())

    @classmethod
    def read(
        cls, texts: dict[str, str], attributes: dict[str, Any], arrays: dict[str, Floats], picture: bytes
    ) -> "Control":
        """Return what `texts`, `attributes` and `arrays` hold.

        Raises
        ------
        ValueError
            A text is no JSON, or not of a sketch; the start is unknown; or the picture is no PNG.
        KeyError
            Something is missing.
        """
        if attributes["start"] not in STARTS:
            raise ValueError(f"start must be one of {', '.join(STARTS)}, got {attributes['start']!r}")
        pixels(picture)
        return cls(
            sketch=_sketch(json.loads(texts["sketch"])),
            stroke=Stroke.model_validate_json(texts["stroke"]),
            picture=picture,
            control_frame=int(attributes["control_frame"]),
            start=attributes["start"],
            cap=float(attributes["cap"]),
            **arrays,
        )


def pixels(picture: bytes) -> npt.NDArray[np.uint8]:
    """Return the pixels of a PNG, uint8 (512, 512, 4) RGBA; raises ValueError where it cannot be read."""
    try:
        with Image.open(io.BytesIO(picture), formats=["PNG"]) as image:
            return np.asarray(image.convert("RGBA"))
    except (OSError, SyntaxError) as error:
        raise ValueError(f"the picture is no PNG: {error}") from error


def rounded(values: npt.ArrayLike) -> Any:
    """Return a number, or an array as lists, with the digits that are stored."""
    return np.round(np.asarray(values, dtype=np.float64), _DIGITS).tolist()


def _plain(sketch: StrokeSketch) -> dict[str, Any]:
    fields = {key: rounded(value) for key, value in vars(sketch).items() if value is not None}
    return {"kind": sketch.kind, **fields}


def _sketch(fields: Any) -> StrokeSketch:
    if not isinstance(fields, dict) or fields.get("kind") not in _SKETCHES:
        raise ValueError(f"a sketch must be of the kind {' or '.join(_SKETCHES)}")
    kind = fields.pop("kind")
    try:
        return _SKETCHES[kind](**fields)
    except TypeError as error:
        raise ValueError(f"a sketch has wrong fields: {error}") from None
