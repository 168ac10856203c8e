"""How long the service lets its clients wait: a process of its own, of which nothing is imported."""
