"""Scene files with ranges: a template from which each seed draws a scene.

Any value under `bodies` and `obstacles` may be one of these ranges:

- `{uniform: [low, high]}` draws a number, or a vector where low and high are lists;
- `{integer: [low, high]}` draws a whole number, both ends included;
- `{choice: [a, b, ...]}` draws one of the listed values. These may be of any kind, also a whole list of
  bodies, and may have ranges themselves.

A body or obstacle may have a `shift`, D numbers [m] that are added to its place. A body without `seed` draws
the seed of its particles.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm.errors import SceneError
from hybridmpm.scene import Scene
from hybridmpm.scene.fields import RANGES
from hybridmpm.scene.plain_data import from_yaml

_SALT = 2**20
"""Number that the random generator gets besides the seed; those of the scenarios are small."""
_DRAWS = 100
"""Number of draws tried for a seed."""
_PLACES = ("lower", "upper", "center", "start", "end", "point")
_RANGED = ("bodies", "obstacles")


@dataclass(frozen=True)
class SceneTemplate:
    """A scene with ranges.

    Raises
    ------
    SceneError
        A value other than bodies and obstacles has a range, or no valid scene can be drawn.
    """

    data: dict[str, Any]
    """The scene file as plain data."""

    def __post_init__(self) -> None:
        if not isinstance(self.data, dict):
            raise SceneError("a scene file must be an object with named fields")
        for key, value in self.data.items():
            if key not in _RANGED and _contains_range(value):
                raise SceneError.of([(key, "must have no range: it is the same in all scenes of a data set")])
        self.draw(0)

    @staticmethod
    def is_in(path: str | Path) -> bool:
        """Whether a scene file has ranges, or a `shift`, so that it is no scene; OSError for the file."""
        try:
            data = _read(Path(path))
        except SceneError:
            return False
        parts = [part for key in _RANGED for part in _items(data, key) if isinstance(part, dict)]
        return _contains_range(data) or any("shift" in part for part in parts)

    @classmethod
    def load(cls, path: str | Path) -> "SceneTemplate":
        """Read a .yaml, .yml or .json file; raises `SceneError` for its content, OSError for the file."""
        return cls(_read(Path(path)))

    def draw(self, seed: int) -> Scene:
        """Draw the scene of a seed. With one version of numpy, the same seed always gives the same scene.

        Raises
        ------
        SceneError
            None of 100 draws is a valid scene; the message says what is wrong with the last one.
        """
        rng = np.random.default_rng([_SALT, seed])
        for attempt in range(1, _DRAWS + 1):
            drawn = {key: _drawn(value, rng, key) for key, value in self.data.items()}
            drawn["name"] = f"{self.data.get('name', 'scene')} seed {seed}"
            for key in _RANGED:
                drawn[key] = [_placed(part, rng, body=key == "bodies") for part in _listed(drawn, key)]
            try:
                return Scene.parse(drawn)
            except SceneError as error:
                if attempt == _DRAWS:
                    text = f"none of {_DRAWS} draws of seed {seed} is a valid scene; the last: {error}"
                    raise SceneError(text, error.problems) from None
        raise AssertionError("unreachable")


def _read(path: Path) -> Any:
    try:
        # A JSON file is a YAML file, too.
        return from_yaml(path.read_bytes())
    except ValueError as error:
        raise SceneError(f"{path} is not YAML: {error}") from None


def _items(data: Any, key: str) -> list[Any]:
    items = data.get(key) if isinstance(data, dict) else None
    return items if isinstance(items, list) else []


def _listed(drawn: dict[str, Any], key: str) -> list[Any]:
    parts = drawn.get(key, [])
    if not isinstance(parts, list):
        raise SceneError.of([(key, f"must be a list, got {parts!r}")])
    return parts


def _is_range(value: Any) -> bool:
    return isinstance(value, dict) and len(value) == 1 and next(iter(value)) in RANGES


def _contains_range(value: Any) -> bool:
    if _is_range(value):
        return True
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return any(_contains_range(part) for part in parts)


def _drawn(value: Any, rng: np.random.Generator, path: str) -> Any:
    if _is_range(value):
        ((kind, given),) = value.items()
        return _drawn(_pick(kind, given, rng, f"{path}.{kind}"), rng, path)
    if isinstance(value, dict):
        return {key: _drawn(part, rng, f"{path}.{key}") for key, part in value.items()}
    if isinstance(value, list):
        return [_drawn(part, rng, f"{path}[{index}]") for index, part in enumerate(value)]
    return value


def _pick(kind: str, given: Any, rng: np.random.Generator, path: str) -> Any:
    if not isinstance(given, list) or not given:
        raise SceneError.of([(path, f"must be a list, got {given!r}")])
    if kind == "choice":
        return given[int(rng.integers(len(given)))]
    try:
        low, high = (np.asarray(end, dtype=np.float64) for end in given)
    except (TypeError, ValueError):
        low = high = np.array(np.nan)
    if (
        low.shape != high.shape
        or low.ndim > 1
        or not (low <= high).all()
        or not np.isfinite(high - low).all()
    ):
        text = f"must be [low, high] with low <= high, two numbers or two lists of them, got {given!r}"
        raise SceneError.of([(path, text)])
    if kind == "uniform":
        return np.asarray(rng.uniform(low, high)).tolist()
    if low.ndim or low != np.floor(low) or high != np.floor(high) or max(abs(low), abs(high)) > 2**53:
        raise SceneError.of([(path, f"must be two whole numbers, got {given!r}")])
    return int(rng.integers(int(low), int(high), endpoint=True))


def _placed(part: Any, rng: np.random.Generator, *, body: bool) -> Any:
    """Return a body or obstacle with its shift applied, a body also with a seed.

    Anything else than a mapping is returned as it is, for `Scene` to refuse.
    """
    if not isinstance(part, dict):
        return part
    part = dict(part)
    seed = int(rng.integers(2**31))
    if body:
        part.setdefault("seed", seed)
    shift = part.pop("shift", None)
    if shift is None:
        return part
    try:
        for key in _PLACES:
            if key in part:
                part[key] = _shifted(part[key], shift)
        if "vertices" in part:
            part["vertices"] = [_shifted(vertex, shift) for vertex in part["vertices"]]
    except (TypeError, ValueError):
        raise SceneError(f"shift must be as many numbers as the place that it moves, got {shift!r}") from None
    return part


def _shifted(place: Any, shift: Any) -> list[float]:
    return [a + b for a, b in zip(place, shift, strict=True)]
