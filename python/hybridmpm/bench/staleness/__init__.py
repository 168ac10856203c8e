"""Whether a committed result is older than the code that made it."""
