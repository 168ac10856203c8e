"""The addresses: each parses, calls once, and shapes the answer."""
