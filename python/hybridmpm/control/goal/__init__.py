"""The goal of a sketch: places for all particles, paths to them, and the effort of these."""
