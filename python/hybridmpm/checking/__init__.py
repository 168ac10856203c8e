"""What is known of a scene before its first frame: whether it is stable, what it costs, what may go wrong."""

from hybridmpm.checking.check import check, check_with, findings
from hybridmpm.checking.report import Finding, SceneCheck, Severity

__all__ = ["Finding", "SceneCheck", "Severity", "check", "check_with", "findings"]
