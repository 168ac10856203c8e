"""The stability map: the scenes that each method survives."""
