"""What has acted on a session, kept so that it can be computed again, and a crash loses nothing of it."""
