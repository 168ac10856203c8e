"""Diffusion without its network: the noise schedule, and samplers of few steps, on any arrays."""
