"""Keys of the service: who calls, what a key may do, and how much of the service it may take."""
