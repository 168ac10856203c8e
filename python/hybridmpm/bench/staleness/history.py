"""Files of a checkout today, beside what they were at an earlier commit, wherever they lay then."""

import functools
from pathlib import Path

from hybridmpm.bench.report.git import git, git_bytes
from hybridmpm.bench.staleness.program import program
from hybridmpm.errors import ConfigError


class History:
    """A checkout with its history.

    Parameters
    ----------
    folder : Path
        Folder in the checkout.

    Raises
    ------
    ConfigError
        The folder is in no checkout.
    """

    def __init__(self, folder: Path) -> None:
        self.root = Path(git(folder, "rev-parse", "--show-toplevel"))
        """Top folder of the checkout."""
        self._earlier = functools.cache(self._earlier_names)
        self._was_other = functools.cache(self._had_another_program)

    def name(self, file: Path) -> str:
        """Return the path of a file relative to the checkout."""
        return file.relative_to(self.root).as_posix()

    def has(self, commit: str) -> bool:
        """Whether a commit is in the history."""
        try:
            git(self.root, "cat-file", "-e", f"{commit}^{{commit}}")
        except ConfigError:
            return False
        return True

    def is_changed(self, file: Path, commit: str) -> bool:
        """Whether a file computes something else than at a commit; a new file, whether it computes at all."""
        earlier = self._earlier(commit)
        name = self.name(file)
        is_untouched = name in earlier and earlier[name] is None
        return not is_untouched and self._was_other(commit, earlier.get(name), file)

    def _earlier_names(self, commit: str) -> dict[str, str | None]:
        """Return the name at a commit of each file that was there, by today's name; None where untouched."""
        names: dict[str, str | None] = dict.fromkeys(
            git(self.root, "ls-tree", "-r", "-z", "--name-only", commit).split("\0")
        )
        # Weak pairs too, since programs are compared: a moved file may have all of its prose reworded. And
        # without a limit to their number, since a commit may move all files.
        words = iter(git(self.root, "diff", "-z", "-M10%", "-l0", "--name-status", commit).split("\0"))
        for status in filter(None, words):
            before = next(words)
            names.pop(before, None)
            if status.startswith("R"):
                names[next(words)] = before
            elif status not in {"A", "D"}:
                names[before] = before
        return names

    def _had_another_program(self, commit: str, earlier: str | None, file: Path) -> bool:
        before = b"" if earlier is None else git_bytes(self.root, "show", f"{commit}:{earlier}")
        return program(file.name, before) != program(file.name, file.read_bytes())
