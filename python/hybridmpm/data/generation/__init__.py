"""Making data sets: each trajectory from its seed, in parallel; a run can be interrupted and resumed."""
