"""What a sketch asks for: places for all particles, the paths there, and what these take."""
