"""`bench tradeoff`: every method of the library and its peers, error against time, from one committed table."""
