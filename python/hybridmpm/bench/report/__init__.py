"""What a benchmark leaves behind: where its figures come from, which are stale, and fronts."""
