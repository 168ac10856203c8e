"""Sessions without HTTP: the simulation, its worker and player, limits and expiry."""
