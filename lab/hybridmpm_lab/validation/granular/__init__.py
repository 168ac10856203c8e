"""Sand that collapses: planar columns, and round ones."""
