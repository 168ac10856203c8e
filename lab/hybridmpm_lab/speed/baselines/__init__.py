"""Code of others that `hybridmpm bench` measures beside ours; it needs packages of the extra `bench`."""
