"""`hybridmpm scenarios`, `schema` and `doctor`: reports on the library and its installation."""

from hybridmpm.cli.report.commands import doctor, scenarios, schema

__all__ = ["doctor", "scenarios", "schema"]
