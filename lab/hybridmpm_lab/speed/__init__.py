"""Speed of the solver, of batches and of the neighbour graph, and how it scales; other solvers beside it."""
