"""Sketches: what they mean, how a picture or strokes are read, and how one is drawn."""
