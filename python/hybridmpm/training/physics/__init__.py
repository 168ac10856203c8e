"""Training of learned simulators: their samples, their loss and their rollouts."""
