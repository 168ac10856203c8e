"""Holding a transport network in training against scenes that it is not trained on."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.training.control.pasts import Past
from hybridmpm.training.control.transport.trainer import TransportTrainer
from hybridmpm.training.control.transport.windows import Sample, drawn
from hybridmpm.training.run import VALIDATION, log_row

_EACH = 2
"""Samples for each scene."""


def held_out(groups: Mapping[str, Sequence[Past]], spec: TransportSpec) -> dict[str, list[Sample]]:
    """Return samples of held-out pasts, the same in each call, by scenario and kind of sketch.

    Parameters
    ----------
    groups : mapping
        Pasts by scenario.
    spec : TransportSpec
        For the range of times.
    """
    found: dict[str, list[Sample]] = {}
    for scenario, pasts in groups.items():
        rng = np.random.default_rng(0)
        for _ in range(_EACH * len(pasts)):
            sample = drawn(rng, pasts, shortest=spec.shortest, longest=spec.longest)
            kind = "arrow" if sample.is_arrow else "oval"
            found.setdefault(f"{scenario}_{kind}", []).append(sample)
    return found


def log_unexplained(trainer: TransportTrainer, folder: Path, groups: Mapping[str, Sequence[Sample]]) -> None:
    """Add to `validation.jsonl` the mean of `TransportTrainer.unexplained` for each group of samples.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    row = {name: float(trainer.unexplained(samples).mean()) for name, samples in groups.items()}
    log_row(folder / VALIDATION, {"step": trainer.step_count, "seconds": trainer.seconds, **row})
