"""Holding a Fluid ControlNet in training against cases that it is not trained on."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from hybridmpm.training.control.controlnet.cases import NodeCase
from hybridmpm.training.control.controlnet.trainer import ControlNetTrainer
from hybridmpm.training.run import VALIDATION, log_row


def log_unexplained(
    trainer: ControlNetTrainer, folder: Path, groups: Mapping[str, Sequence[NodeCase]]
) -> None:
    """Add to `validation.jsonl` `ControlNetTrainer.unexplained` for arrows and ovals of each scenario.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    row = {}
    for scenario, cases in groups.items():
        for kind, arrow in (("arrow", True), ("oval", False)):
            of_kind = [case for case in cases if case.is_arrow is arrow]
            if of_kind:
                row[f"{scenario}_{kind}"] = trainer.unexplained(of_kind)
    log_row(folder / VALIDATION, {"step": trainer.step_count, "seconds": trainer.seconds, **row})
