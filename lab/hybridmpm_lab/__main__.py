"""The command `python -m hybridmpm_lab`."""

from hybridmpm_lab.commands import main

main()
