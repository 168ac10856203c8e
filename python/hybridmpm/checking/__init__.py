"""Checks of a scene before its first frame: stability, cost, and likely faults."""

from hybridmpm.checking.check import check, check_with, findings
from hybridmpm.checking.report import Finding, SceneCheck, Severity

__all__ = ["Finding", "SceneCheck", "Severity", "check", "check_with", "findings"]
