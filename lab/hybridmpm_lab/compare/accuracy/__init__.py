"""Benchmarks of error against time: fewer particles, learned simulators, and the rollouts that both share."""
