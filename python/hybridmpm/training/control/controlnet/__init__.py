"""Training of the Fluid ControlNet, the diffusion over force fields of the paper."""
