"""What is known of a scene before its first frame: stability, cost, and what may go wrong."""

from hybridmpm.checking.check import check, findings
from hybridmpm.checking.report import Finding, SceneCheck, Severity

__all__ = ["Finding", "SceneCheck", "Severity", "check", "findings"]
