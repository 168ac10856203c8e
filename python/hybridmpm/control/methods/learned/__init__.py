"""The method "learned": a network proposes where each particle is to be, and guidance leads it there.

The network has learned from simulated fluids where their particles had come from.
"""
