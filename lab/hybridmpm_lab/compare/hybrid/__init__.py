"""Benchmarks of the hybrid simulator: its guards, its handoff and whole rollouts."""
