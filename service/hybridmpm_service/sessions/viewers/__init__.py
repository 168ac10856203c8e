"""Viewers of a session: their mailboxes, and what all of them get."""
