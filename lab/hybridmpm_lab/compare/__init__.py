"""Comparisons of methods by error and time."""
