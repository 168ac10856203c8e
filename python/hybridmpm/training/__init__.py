"""Training of learned simulators with torch: pip install 'hybridmpm[train]'."""
