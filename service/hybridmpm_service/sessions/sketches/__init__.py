"""Sketches of a session: prepared beside it, then steering it."""
