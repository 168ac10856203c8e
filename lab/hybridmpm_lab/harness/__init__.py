"""Rows of figures: their origin, their files, the timing behind them, and which methods others dominate."""
