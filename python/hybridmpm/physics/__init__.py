"""Learned simulators: what they are and how they run. Nothing here needs torch; `hybridmpm.training` does."""
