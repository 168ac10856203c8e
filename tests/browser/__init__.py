"""A package, so that fixtures of its scope end with it: the browser must not outlive its tests."""
