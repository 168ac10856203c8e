"""Sessions without HTTP: a simulation with its thread, its player and its viewers, limits and expiry."""
