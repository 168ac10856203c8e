"""Fitting of levels: constants of coarse MPM that carries all particles, learned from the truth of scenes."""
