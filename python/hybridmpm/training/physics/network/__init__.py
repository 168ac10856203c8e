"""The network that steps a fluid, in torch: features, message passing, relaxation of density, one step."""
