"""`bench tradeoff`: every method of the library, and peers, by error and time, from one committed table."""
