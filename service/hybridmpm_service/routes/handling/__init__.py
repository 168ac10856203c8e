"""What routes have in common: their calls, keys of calls that are sent again, what they depend on."""
