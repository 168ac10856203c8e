"""Training of the transport network, which predicts the ends of particles for `learned` control."""
