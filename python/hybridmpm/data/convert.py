"""Converting a data set from one format to another, one trajectory at a time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hybridmpm.data import metadata
from hybridmpm.data.formats import Format
from hybridmpm.data.statistics import Statistics
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import ConfigError, DataError, ExportError
from hybridmpm.scene.particle_types import NAMES, TO_LAGRANGEBENCH, UNCHANGED


@dataclass(frozen=True, kw_only=True)
class Converted:
    """Result of a conversion."""

    trajectories: dict[str, int]
    """Number of trajectories written, by split."""
    lost: tuple[str, ...]
    """Columns of the source that the target cannot store: "force", "mass", "scene", "control"."""


def convert(
    source: Path,
    origin: Format,
    out: Path,
    target: Format,
    *,
    on_progress: Callable[[int], object] = lambda _count: None,
) -> Converted:
    """Write the data set in `source` to a new folder `out`.

    Positions keep their bits, and particle types are translated. `metadata.json` keeps its keys and gains
    those that readers of the target format need.

    Parameters
    ----------
    source, out : Path
        Folders of the data set and of its conversion.
    origin, target : Format
        Formats of both folders.
    on_progress : callable
        Called with the number of trajectories done since its last call.

    Raises
    ------
    ConfigError
        The target format cannot be written, or `out` is not empty.
    DataError
        The source is damaged or incomplete; the message names file and key.
    ExportError
        A file cannot be written. Splits written before it are complete.
    """
    if target.write is None:
        raise ConfigError(f"the format {target.name} is only read; choose another one to write")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ConfigError(f"{out} is not empty; choose a new folder")
    about = metadata.read(source)
    splits = origin.splits(source)
    if not splits:
        raise DataError(f"{source} holds no split in the format {origin.name}: {origin.text}")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(f"cannot write {out}: {error.strerror or error}") from error
    present: set[str] = set()
    statistics = {split: Statistics() for split in splits}
    for split in splits:

        def counted(split: str = split) -> Iterator[Trajectory]:
            for trajectory in origin.read(source, split, None):
                statistics[split].add(trajectory)
                present.update(
                    key
                    for key in ("force", "mass", "scene", "control")
                    if getattr(trajectory, key) is not None
                )
                yield trajectory
                on_progress(1)

        target.write(out, split, counted())
    ours = {**about.get("hybridmpm", {}), "format": target.name, "type_names": _type_names(target)}
    metadata.write(
        out,
        {
            **statistics[splits[0]].metadata(),
            **about,
            **metadata.lagrangebench_keys(statistics),
            "hybridmpm": ours,
        },
    )
    return Converted(
        trajectories={split: part.trajectories for split, part in statistics.items()},
        lost=tuple(sorted(present - target.keeps)),
    )


def _type_names(target: Format) -> dict[str, str]:
    table = TO_LAGRANGEBENCH if target.name == "lagrangebench" else UNCHANGED
    return {str(table[number]): name for number, name in NAMES.items()}
