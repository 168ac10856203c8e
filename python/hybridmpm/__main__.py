"""`python -m hybridmpm` is the `hybridmpm` command."""

from hybridmpm.cli import main

main()
