"""Names of the compiled module `_native`, whose stub documents them; no other file imports it."""

from hybridmpm._native import *  # noqa: F403 - all of them, whatever the build has
from hybridmpm._native import __version__ as __version__  # noqa: PLC0414 - the form that re-exports
