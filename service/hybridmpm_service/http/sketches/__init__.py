"""Sketches over HTTP: how they are sent, and what is answered."""
