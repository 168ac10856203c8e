"""What all measurements of errors hold to: test scenes, frames, and numbers of particles."""

FIRST_SEED = 1_100_000
"""Seed of the first test scene of each scenario: no data set for training or validation goes so far."""
AT = (40, 100, 200)
"""Frames, counted from the start of a measurement, whose errors are reported alone."""
EVERY = 10
"""Frames between two states that are compared."""

RATIOS = {"1": 1.0, "1/1.75": 1 / 1.75, "1/4": 1 / 4, "1/8": 1 / 8, "1/16": 1 / 16}
"""r_p by label: shares of the particles that networks and MPM are measured with."""
LADDER = {**RATIOS, "1/32": 1 / 32, "1/64": 1 / 64}
"""r_p of the coarse levels of MPM by label: down to where MPM is as quick as the quickest network."""


def ratio_label(r_p: float) -> str:
    """Return the label of an r_p: that of the ladder where it is one of its levels."""
    return next((label for label, level in LADDER.items() if abs(level - r_p) < 1e-6), f"{r_p:.3g}")
