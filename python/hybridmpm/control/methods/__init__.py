"""Methods: ways to find the law that follows a sketch. `choice.METHODS` lists them by name."""
