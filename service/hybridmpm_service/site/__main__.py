"""The command `python -m hybridmpm_service.site FOLDER [NAME ...]`."""

import argparse
import sys
from pathlib import Path

from hybridmpm import ConfigError, ExportError
from hybridmpm_service.site import entries, write_site


def main() -> str | None:
    """Write the site; return what went wrong, if anything."""
    parser = argparse.ArgumentParser(prog="python -m hybridmpm_service.site")
    parser.description = "Write the gallery as a folder of pages that play in any browser, without a server."
    parser.add_argument("folder", type=Path, help="folder of the site")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(one.name for one in entries()))
    given = parser.parse_args()

    def report(page: Path) -> None:
        sys.stdout.write(f"wrote {page}: {page.stat().st_size / 1e6:.2f} MB\n")

    try:
        write_site(given.folder, given.names or None, report)
    except (ConfigError, ExportError) as error:
        return str(error)
    return None


sys.exit(main())
