"""Training of learned simulators: the network in torch, its features, its samples and its loss."""
