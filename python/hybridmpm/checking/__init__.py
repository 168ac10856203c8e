"""What is known of a simulation before its first frame: whether it is stable, what it costs, and what may go wrong."""

from hybridmpm.checking.check import check, check_with, findings, resolution_of
from hybridmpm.checking.report import Finding, SceneCheck, Severity

__all__ = ["Finding", "SceneCheck", "Severity", "check", "check_with", "findings", "resolution_of"]
