"""HTTP and WebSocket service of hybridmpm: it owns running simulations and serves the page.

`serve()` runs the service, and `main()` does so for a command line; `make_key()` is the command that makes
keys. `create_app(settings)` builds the application for another server or a test.
"""

from hybridmpm_service.app import create_app
from hybridmpm_service.keys.command import main as make_key
from hybridmpm_service.server import ServeError, main, serve
from hybridmpm_service.settings import Settings

__all__ = ["ServeError", "Settings", "create_app", "main", "make_key", "serve"]
