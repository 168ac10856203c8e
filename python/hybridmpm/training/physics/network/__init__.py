"""The network that steps a fluid, in torch: features, message passing, one step."""
