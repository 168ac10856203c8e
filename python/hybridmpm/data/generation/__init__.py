"""Making data sets: each trajectory from its seed, in parallel, to be interrupted and resumed."""
