"""Training of the transport network, which tells `learned` control where particles are to end."""
