"""HTTP and WebSocket service of hybridmpm: it owns running simulations and serves the page.

`serve()` runs the service, and `main()` does so for a command line. `create_app(settings)` builds the
application for another server or a test.
"""

from hybridmpm_service.app import create_app
from hybridmpm_service.server import ServeError, main, serve
from hybridmpm_service.settings import Settings

__all__ = ["ServeError", "Settings", "create_app", "main", "serve"]
