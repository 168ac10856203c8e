"""Measurements that anyone can repeat; each module makes the rows of one `hybridmpm bench` command."""
