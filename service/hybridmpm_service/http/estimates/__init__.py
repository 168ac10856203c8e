"""What is known before a session is made: checks of scenes, and plans."""
