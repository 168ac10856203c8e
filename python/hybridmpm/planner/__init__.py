"""Plans: which rung of all ladders simulates a scene within an error, or within a time."""
