"""The command `python -m hybridmpm_service`."""

import sys

from hybridmpm_service.server import main

sys.exit(main(sys.argv[1:]))
