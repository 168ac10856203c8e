"""Benchmarks of stability: at which CFL numbers the solver fails."""
