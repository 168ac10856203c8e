"""The suite: which sketches are drawn on which states of which scenes."""
