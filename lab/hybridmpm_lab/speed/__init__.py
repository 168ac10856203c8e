"""Benchmarks of time: the solver, batches, growth with size, sleeping regions and the neighbour search."""
