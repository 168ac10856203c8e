"""The methods that the chart holds against each other, for each scenario: one committed table."""

import fnmatch
from collections.abc import Iterator, Sequence

from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import default_model, models
from hybridmpm.planner.candidates import Candidate, candidates

THRESHOLDS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9)
"""r_c of the hybrids that only the cosine watches, beside checks of sound states."""
_SOUND = ("non-finite", "outside", "cosine")


def entrants(scenario: str, patterns: Sequence[str] = ()) -> dict[str, Candidate]:
    """Return the entrants of a scenario by name, those whose names match one of the patterns.

    They are the truth itself, all that a plan chooses among, and hybrids over r_c.

    Raises
    ------
    ConfigError
        There are patterns, and no entrant matches; the message lists the names.
    """
    truth = Candidate(
        method="mpm", label="truth", variant="plain", r_p=1.0, settings={"substeps": "reference"}
    )
    found = {truth.name: truth} | candidates(scenario) | {one.name: one for one in _by_cosine(scenario)}
    chosen = {
        name: one
        for name, one in found.items()
        if not patterns or any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)
    }
    if not chosen:
        listed = ", ".join(found)
        raise ConfigError(f"no entrant of {scenario} matches {', '.join(patterns)}; there are {listed}")
    return chosen


def _by_cosine(scenario: str) -> Iterator[Candidate]:
    """Yield hybrids over r_c, with the model that the scenario gets where none is named."""
    name = default_model(scenario)
    entry = models()[name]
    for r_c in THRESHOLDS:
        yield Candidate(
            method="hybrid",
            label=f"{name} r_c {r_c}",
            variant="cosine",
            r_p=entry.r_p,
            r_t=entry.r_t,
            settings={"r_c": r_c, "guards": _SOUND},
            model=name,
        )
