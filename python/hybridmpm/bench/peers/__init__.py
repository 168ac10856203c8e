"""Solvers by others that `hybridmpm bench` measures beside ours; each module needs an extra of its own."""
