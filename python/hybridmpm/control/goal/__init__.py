"""What a sketch asks for: places for all particles, the ways there, and what these take."""
