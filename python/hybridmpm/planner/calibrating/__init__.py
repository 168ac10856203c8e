"""`bench calibrate`: what this machine takes for each kind of work, in under a minute, for plans."""
