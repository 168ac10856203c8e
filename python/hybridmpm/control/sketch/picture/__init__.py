"""Reading a sketch from the pixels of a picture: its ink, its one mark, and what that shows."""
