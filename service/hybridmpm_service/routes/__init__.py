"""The routes: each parses a request, calls a session or the manager once, and shapes the answer."""
