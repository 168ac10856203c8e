"""What is known of a simulation before its first frame: whether it is stable, what it costs, and what may go wrong."""

from hybridmpm.checking.check import check, findings
from hybridmpm.checking.report import Finding, SceneCheck, Severity

__all__ = ["Finding", "SceneCheck", "Severity", "check", "findings"]
