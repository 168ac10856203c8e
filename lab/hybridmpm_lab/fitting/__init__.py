"""Fitting of coarse levels: constants of coarse MPM, found on the truth of scenes."""
