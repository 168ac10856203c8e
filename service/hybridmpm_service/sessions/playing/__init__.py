"""A player that computes frames at a chosen speed."""
