"""What a tradeoff measures: scenarios, held-out seeds, frames, and how often it times."""

from dataclasses import dataclass

from hybridmpm import scenarios
from hybridmpm.physics.manifest import models
from hybridmpm.physics.track import warmup_frames
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED
from hybridmpm_lab.harness.rows import Row

PAPER = {"paper r_p 1, r_t 1": ("1", 1), "paper r_p 1/1.75, r_t 2": ("1/1.75", 2)}
"""Label of r_p, and r_t, by the label of a setting of the paper: 10 layers of 128 numbers."""
PAPER_PART = "paper"
"""First field of the keys of the paper's latencies; scenario and name follow."""


@dataclass(frozen=True, kw_only=True)
class TradeoffSettings:
    """The committed configuration of the chart; the defaults are those of docs/results/tradeoff.json."""

    scenarios: tuple[str, ...] = scenarios.NAMES
    """Scenarios of the scenes."""
    scenes: int = 10
    """Number of held-out scenes of each scenario, from seed `FIRST_SEED` on."""
    span: int = 200
    """Number of frames that errors count over and that are timed."""
    passes: int = 9
    """Number of times that each frame is timed; the lower quartile counts."""
    threads: int = 1
    """Threads of every simulator of ours; a peer may take two."""
    peers: tuple[str, ...] = ()
    """Packages of peers, of `peers.loading.SOLVERS`."""
    patterns: tuple[str, ...] = ()
    """Shell patterns of the names of entrants; without any all enter."""

    @property
    def seeds(self) -> range:
        """Seeds of the scenes: no data set and no fit goes so far."""
        return range(FIRST_SEED, FIRST_SEED + self.scenes)

    def shared(self) -> Row:
        """Return what runs must share to stand in one table."""
        return {"first_seed": FIRST_SEED, "span": self.span, "threads": self.threads}


def warm_up(scenario: str) -> int:
    """Return the frames that MPM makes for the slowest to begin of the networks that serve a scenario."""
    strides = [entry.r_t for entry in models().values() if scenario in entry.scenarios]
    return max((warmup_frames(r_t) for r_t in strides), default=0)
